"""A console on another computer, without the bridge's own client: Zenoh, a key, and the payloads.

    pip install eclipse-zenoh==1.10.2
    python examples/zenoh_console.py 192.168.1.10:7447 alice-4f1c22d0 [--command]

The second argument is the folder of a key (`i2ris bridge key`); its name is the id of the key. Prints the
operating state and the measured angles. With `--command` it then holds the lease for one second by repeating
the present setpoint; nothing moves. The robot must be ENABLED and have a model.
"""

import secrets
import struct
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

import zenoh
from i2ris.payload import (
    INTERFACE_VERSION, JointState, OperatingStateMsg, Payload, ServoJp, StateCommandReply, StateCommandRequest,
)

REFUSALS = {1: "other version of the interface", 2: "too many clients", 3: "the session has ended",
            4: "the key was revoked"}
OUTCOMES = {2: "the controller did not answer", 3: "this key may watch only", 4: "too late"}
NEWEST = {"reliability": zenoh.Reliability.BEST_EFFORT, "priority": zenoh.Priority.REAL_TIME,
          "congestion_control": zenoh.CongestionControl.DROP, "express": True}

P = TypeVar("P", bound=Payload)


class Refused(Exception):
    """The server or the controller refuses."""


class Clock:
    """Bounds of the lead of the controller's clock over ours, as far apart as the smallest round trip."""

    DRIFT = 1e-3

    def __init__(self) -> None:
        self.bounds: tuple[int, int, int] | None = None

    def note(self, sent: int, there: int, arrived: int) -> None:
        least, most = there - arrived, there - sent
        if self.bounds is not None:
            old_least, old_most = self.widened(arrived)
            if old_least <= most and least <= old_most:
                least, most = max(least, old_least), min(most, old_most)
        self.bounds = (least, most, arrived)

    def widened(self, now: int) -> tuple[int, int]:
        assert self.bounds is not None, "nothing was heard yet"
        least, most, at = self.bounds
        drift = int((now - at) * self.DRIFT) + 1
        return least - drift, most + drift

    def there(self, stamp: int) -> int:
        """A stamp on the controller's clock, never later than it was: commands do not become younger."""
        return stamp + self.widened(time.monotonic_ns())[0]

    def here(self, stamp: int) -> int:
        """A stamp of the controller on our clock, never later than it was."""
        return stamp - self.widened(time.monotonic_ns())[1]


class Console:
    """One session. It ends for ever when either end is silent: then make another one, and look before you go on."""

    def __init__(self, address: str, key_folder: str, patience_s: float = 10.0):
        key = Path(key_folder)
        config = zenoh.Config()
        tls = "transport/link/tls"
        for name, value in {
            "mode": '"client"',
            "scouting/multicast/enabled": "false",
            "connect/endpoints": f'["quic/{address}?mixed_rel=1"]',
            f"{tls}/enable_mtls": "true",
            f"{tls}/root_ca_certificate": f'"{key}/ca.pem"',
            f"{tls}/connect_certificate": f'"{key}/certificate.pem"',
            f"{tls}/connect_private_key": f'"{key}/key.pem"',
        }.items():
            config.insert_json5(name, value)
        self.zenoh = zenoh.open(config)
        self.source = f"i2ris/from/{key.name}/{secrets.randbits(64):016x}"
        self.clock = Clock()
        self.newest: dict[str, bytes] = {}
        self.ended: str | None = None
        self.commands = self.controller = False
        self.client_id, self.sequence, self.questions = secrets.randbits(63) + 1, 0, 0
        self.servo = self.zenoh.declare_publisher(f"{self.source}/servo_jp", **NEWEST)
        self.states = self.zenoh.declare_subscriber("i2ris/state/**", self.keep)
        self.heard = time.monotonic()
        if not self.alive(patience_s):
            raise Refused(self.ended or "no answer: the key may not be in the list of the server")
        self.thread = threading.Thread(target=self.live, daemon=True)
        self.thread.start()

    def keep(self, sample: Any) -> None:
        self.newest[str(sample.key_expr).removeprefix("i2ris/state/")] = sample.payload.to_bytes()

    def alive(self, timeout_s: float) -> bool:
        """Asks for a sign of life: whether we are admitted, and how the clocks stand."""
        sent = time.monotonic_ns()
        for reply in self.zenoh.get(f"{self.source}/alive", payload=struct.pack("<IIII", INTERFACE_VERSION, 0, 0, 0),
                                    timeout=timeout_s):
            if reply.ok is None:
                continue
            arrived = time.monotonic_ns()
            answer = reply.ok.payload.to_bytes()
            now, _, refusal, commands, controller = struct.unpack_from("<QIIII", answer)
            if refusal:
                self.ended = REFUSALS.get(refusal, f"refusal {refusal}")
                return False
            self.clock.note(sent, now, arrived)
            self.commands, self.controller = commands == 1, controller == 1
            self.heard = time.monotonic()
            return True
        return False

    def live(self) -> None:
        """Twenty signs of life a second. Half a second without an answer ends the session."""
        while self.ended is None:
            self.alive(0.5)
            if time.monotonic() - self.heard > 0.5:
                self.ended = self.ended or "the server is silent"
            time.sleep(0.05)

    def read(self, stream: str, payload: type[P], patience_s: float = 5.0) -> P:
        """The newest message of a stream, with its stamp on our clock."""
        end = time.monotonic() + patience_s
        while (message := self.newest.get(stream)) is None:
            if self.ended or time.monotonic() > end:
                raise Refused(self.ended or f"no {stream}")
            time.sleep(0.005)
        value: Any = payload.from_buffer_copy(message)
        value.stamp_ns = self.clock.here(value.stamp_ns)
        return cast(P, value)

    def servo_jp(self, position: Sequence[float]) -> None:
        """Go to these angles now, rad."""
        if self.ended:
            raise Refused(self.ended)
        self.sequence += 1
        command = ServoJp(self.sequence, self.clock.there(time.monotonic_ns()), self.client_id, 0)
        command.position[: len(position)], command.count = position, len(position)
        self.servo.put(bytes(command))

    def state_command(self, number: int) -> StateCommandReply:
        """A change of state. The number makes sure that it is carried out once, however often it is asked."""
        self.questions += 1
        request = struct.pack("<QQ", self.questions, self.clock.there(time.monotonic_ns()))
        request += bytes(StateCommandRequest(self.client_id, number))
        end = time.monotonic() + 1.0
        while self.ended is None and time.monotonic() < end:
            for reply in self.zenoh.get(f"{self.source}/request/state_command", payload=request, timeout=0.3):
                if reply.ok is None:
                    continue
                answer = reply.ok.payload.to_bytes()
                outcome, _ = struct.unpack_from("<II", answer)
                if outcome != 1:
                    raise Refused(OUTCOMES.get(outcome, f"outcome {outcome}"))
                return StateCommandReply.from_buffer_copy(answer, 8)
        raise Refused(self.ended or "no answer")

    def close(self) -> None:
        self.ended = self.ended or "closed"
        self.thread.join()
        leaving = struct.pack("<IIII", INTERFACE_VERSION, 1, 0, 0)
        list(self.zenoh.get(f"{self.source}/alive", payload=leaving, timeout=0.5))
        self.zenoh.close()


def main() -> None:
    console = Console(sys.argv[1], sys.argv[2])
    state, joints = console.read("operating_state", OperatingStateMsg), console.read("measured_js", JointState)
    print("state", state.state, "measured", list(joints.position[: joints.count]), "rad")
    print("age", (time.monotonic_ns() - joints.stamp_ns) / 1e6, "ms; commands pass:", console.commands)
    if "--command" in sys.argv:
        setpoint = console.read("setpoint_js", JointState)
        for _ in range(200):
            console.servo_jp(list(setpoint.position[: setpoint.count]))
            time.sleep(0.005)
    console.close()


if __name__ == "__main__":
    main()

"""The robot as CRTK sees an arm: streams, states, motions, and commands that keep the lease.

::

    import math, time
    from i2ris.arm import Arm

    with Arm() as arm:
        arm.enable().wait()
        arm.move_jp([0.1, 0.0]).wait()
        start = arm.setpoint_js().position
        for k in range(1000):
            arm.servo_jp(start + [0.05 * math.sin(0.01 * k), 0.0])
            time.sleep(0.005)
        print(arm.measured_js().position)

- A command that is refused raises ``Refused`` with the reason, also a command of a stream: the next ``servo_jp`` after
  the refusal raises.
- ``enable``, ``home``, ``move_jp`` and the like return when the controller has accepted them. ``wait()`` of the result
  returns when they are carried out, and raises if they cannot be: ``Fault``, ``Stopped``.
- Send ``servo_jp`` faster than the deadline (default 50 ms), or the robot stops and holds. A stream that was silent for
  half a second after it had moved the snake is refused until ``hold()`` or another state command of this arm.
- At the end of the ``with`` block, also after an exception, the robot holds and the lease is free. Without ``with``, as
  in a notebook, ``arm = Arm()`` connects; ``arm.close()`` or the end of Python holds and frees the lease.
- The domain is that of the argument, or of the environment variable ``I2RIS_DOMAIN``, or ``i2ris``.

Homing makes the present pose the zero, unless a hard stop is configured: straighten the snake before ``home``.
"""

from __future__ import annotations

import atexit
import os
import secrets
import time
import weakref
from typing import Any, Callable, Sequence, TypeVar

import numpy as np

from .fixtures import FixtureArm
from .link import Link, NoController, OtherInterface, client, of_this_process, publisher, subscriber
from .motors import ActuatorArm, JawArm
from .operation import Operation
from .payload import (
    ActuatorState,
    ExternalPosition,
    JointState,
    MoveRequest,
    OperatingStateMsg,
    Payload,
    PeriodStatistics,
    ReasonMsg,
    ServoJp,
    StateCommandReply,
    StateCommandRequest,
    Version,
    VersionRequest,
)
from .reasons import FAULTS, POWER
from .recording import Recording
from .requests import MARGIN_S, POLL_S, REPLY_TIMEOUT_S, Pending
from .slots import ModelArm
from .values import (
    FAULT_KIND,
    REFUSAL_KIND,
    STATES,
    Actuators,
    Fault,
    Joints,
    LoadedModel,
    ModelSlots,
    NoReply,
    OperatingState,
    OutOfReach,
    Reason,
    Refused,
    Stopped,
    measurement,
    refusal_text,
    text,
)

__all__ = [
    "Actuators",
    "Arm",
    "Fault",
    "Joints",
    "LoadedModel",
    "ModelSlots",
    "NoController",
    "NoReply",
    "OperatingState",
    "Operation",
    "OtherInterface",
    "OutOfReach",
    "Reason",
    "Recording",
    "Refused",
    "Stopped",
]

COMMANDS = {
    "enable": 1,
    "disable": 2,
    "pause": 3,
    "resume": 4,
    "home": 5,
    "unhome": 6,
    "condition": 7,
    "acknowledge": 8,
    "release": 9,
    "hold": 10,
}
#: Number of causes that ``why`` lists.
WHY = 3
#: Messages of ``error`` and of ``warning`` that are kept.
REASONS = 16
#: Time for the message of a refusal, which comes after the count of refusals, s.
REASON_TIMEOUT_S = 0.25
#: Time limit for drives that are starting, s.
DRIVES_TIMEOUT_S = 15.0
#: Refusal while they are.
DRIVES_NOT_READY = 16
#: Refusal of a pose that cannot be reached.
OUT_OF_REACH = 23
#: Time for the first message of a stream: the slowest one that a client needs comes once a second, s.
FIRST_TIMEOUT_S = 3.0

P = TypeVar("P", bound=Payload)


class Arm:
    """A client of a domain's controller. ``with`` holds and releases the lease at the end."""

    def __init__(self, domain: str | None = None, deadline_s: float | None = None, strict: bool = True):
        """
        - ``domain``: None: that of the environment variable ``I2RIS_DOMAIN``, or ``i2ris``.
        - ``deadline_s``: age at which a command of this client is stale; None: the controller's default.
        - ``strict``: commands of a stream raise after a refusal; otherwise look at
          ``OperatingState.own_refused``.
        """
        if domain is None:
            domain = os.environ.get("I2RIS_DOMAIN", "i2ris")
        self._client_id = secrets.randbits(63) | 1
        self._link = Link(domain, self._client_id)
        self._deadline_ns = 0 if deadline_s is None else int(deadline_s * 1e9)
        self._strict = strict
        self._sequence = 0
        self._latest: dict[str, tuple[str, Payload]] = {}
        self._kept: dict[str, list[Any]] = {}
        self._commanded = False
        self._refused = 0
        #: Motors one by one, without a model.
        self.actuators = ActuatorArm(self)
        #: The auxiliary axis: a gripper, or a roll.
        self.jaw = JawArm(self)
        #: Requests about models.
        self.model = ModelArm(self)
        #: Regions that the snake may not enter.
        self.fixtures = FixtureArm(self)
        self._connect()
        # A notebook has no end of a `with` block: the robot holds, and the lease is free, at the end of Python.
        atexit.register(_close, weakref.ref(self))
        of_this_process.add(self)

    def after_fork(self) -> None:
        """In a child of a fork: a new client that has commanded nothing."""
        self._client_id = secrets.randbits(63) | 1
        self._link.after_fork(self._client_id)
        self._sequence, self._commanded, self._latest, self._kept = 0, False, {}, {}

    def _connect(self) -> None:
        """Opens the streams, so that the getters see every message from now on."""
        for service, payload in (
            ("i2ris/operating_state", OperatingStateMsg),
            ("i2ris/actuators/measured_js", ActuatorState),
            ("i2ris/measured_js", JointState),
            ("i2ris/setpoint_js", JointState),
            ("i2ris/goal_js", JointState),
            ("i2ris/external/measured_jp", ExternalPosition),
            ("i2ris/error", ReasonMsg),
            ("i2ris/warning", ReasonMsg),
        ):
            subscriber(self._link, service, payload)

    def _first(self, service: str, payload: type[P], timeout_s: float = FIRST_TIMEOUT_S) -> P:
        """The newest message of a stream; waits for the first one. Raises NoReply if there is none in time."""
        end = time.monotonic() + timeout_s
        while (message := self._newest(service, payload)) is None and time.monotonic() < end:
            time.sleep(POLL_S)
        if message is None:
            raise NoReply(f"no message of {service} within {timeout_s} s")
        return message

    def __repr__(self) -> str:
        domain = f"domain {self._link.domain!r}"
        try:
            state, joints = self.operating_state(), self.measured_js()
        except (NoController, NoReply, OtherInterface) as error:
            return f"<Arm of {domain}: {error}>"
        words = [state.state, "homed" if state.homed else "not homed"]
        if state.fault_code:
            words.append(state.fault)
        if joints.valid:
            words.append(f"{np.degrees(joints.position).round(2).tolist()} deg")
        return f"<Arm of {domain}: {', '.join(words)}>"

    def __enter__(self) -> "Arm":
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    def close(self) -> None:
        """Releases the lease, if this client commanded: the robot holds. Disconnects."""
        try:
            if self._commanded:
                # A command in flight would take the lease again. This is well below its deadline.
                time.sleep(0.02)
                # Ends the motion of this client. A hold would also stop all other clients.
                self.state_command("release")
        except (NoController, NoReply, Refused):
            # No controller, or another client holds the lease.
            pass
        finally:
            self._commanded = False
            self._link.close()

    def servo_jp(self, position_rad: Sequence[float] | np.ndarray, clutch: bool = False) -> int:
        """Go to these angles now, rad. Returns the sequence number. Call it repeatedly, from ``setpoint_js`` on.

        ``clutch``: the master moves and the snake holds; when the clutch closes, the pose of the master is that of the
        snake. Raises ``Refused`` after a refusal of a previous command, and ``Fault``.
        """
        return self._servo(position_rad, clutch)

    def servo_jv(self, velocity_rad_s: Sequence[float] | np.ndarray, clutch: bool = False) -> int:
        """Move with these rates until the next command or the deadline, rad/s. Zero is a command like any other."""
        return self._servo(velocity_rad_s, clutch, ServoJp.RATE)

    def interpolate_jp(self, position_rad: Sequence[float] | np.ndarray, clutch: bool = False) -> int:
        """Be at these angles when the next command is due, rad: for slow streams, as of a learned policy with 10 to
        30 Hz. The default deadline is 0.25 s.
        """
        return self._servo(position_rad, clutch, ServoJp.INTERPOLATE)

    def servo_cp(self, place_m: Sequence[float] | np.ndarray, clutch: bool = False) -> int:
        """Bring the tip as near as possible to a place now: x, y and z at the base, m. A place farther than 0.1 mm from
        all that the tip can reach is a clip, with the distance in ``warnings``.
        """
        return self._servo(place_m, clutch, ServoJp.TIP)

    def servo_cv(self, velocity_m_s: Sequence[float] | np.ndarray, clutch: bool = False) -> int:
        """Move the tip with this velocity, as far as it can, until the next command or the deadline, m/s."""
        return self._servo(velocity_m_s, clutch, ServoJp.TIP | ServoJp.RATE)

    def _servo(self, values: Sequence[float] | np.ndarray, clutch: bool, kind: int = 0) -> int:
        if not 1 <= len(values) <= 3:
            raise ValueError("1 to 3 values")
        self._raise_refusals()
        command = self._stamped(ServoJp, len(values))
        command.flags = kind | (ServoJp.CLUTCH if clutch else 0)
        command.position[: len(values)] = [float(value) for value in values]
        return self._send("i2ris/servo_jp", command)

    def move_jp(self, position_rad: Sequence[float] | np.ndarray) -> Operation:
        """Move to these angles, rad, from rest to rest with limited jerk. ``move_jp(...).wait()`` waits for the end.

        Raises ``OutOfReach`` without moving for a pose that cannot be reached. The next move of the same client
        replaces a move in progress.
        """
        if not 1 <= len(position_rad) <= 3:
            raise ValueError("1 to 3 values")
        goal = np.array([float(value) for value in position_rad])
        return self._move("move_jp", goal, f"{np.degrees(goal).round(2)} deg", goal)

    def move_cp(self, place_m: Sequence[float] | np.ndarray) -> Operation:
        """As ``move_jp``, to the pose whose tip is nearest to a position: x, y and z at the base, m.

        Raises ``OutOfReach`` without moving if that is farther than 0.1 mm.
        """
        if len(place_m) != 3:
            raise ValueError("3 values")
        values = np.array([float(value) for value in place_m])
        return self._move("move_cp", values, f"{(1e3 * values).round(3)} mm", None, MoveRequest.TIP)

    def _move(self, name: str, values: np.ndarray, text: str, goal: np.ndarray | None, flags: int = 0) -> Operation:
        request = MoveRequest(client_id=self._client_id, count=len(values), flags=flags)
        request.position[: len(values)] = list(values)
        boot_id = self.operating_state().boot_id
        try:
            self._accepted(name, self._request("i2ris/move_jp", request, StateCommandReply))
        except Refused as refused:
            if refused.code == OUT_OF_REACH:
                raise OutOfReach(f"{text}: {refused}") from refused
            raise
        self._commanded = True
        return Operation(self, name, "move", boot_id, goal)

    def enable(self) -> Operation:
        """Drives on; the robot holds. Raises ``Refused`` while it is not homed. Waits for starting drives.
        A robot that is ENABLED stays so, so that a script can be run again.
        """
        state = self.operating_state()
        if state.state == "ENABLED":
            return Operation(self, "enable", "enable", state.boot_id)
        return self._operation("enable")

    def disable(self) -> Operation:
        """Decelerate, then drives off."""
        return self._operation("disable")

    def pause(self) -> Operation:
        """Decelerate and hold; servo commands are refused."""
        return self._operation("pause")

    def resume(self) -> Operation:
        """Take servo commands again."""
        return self._operation("resume")

    def home(self, *, straightened: bool = False) -> Operation:
        """The present pose becomes the zero (where no hard stop is configured).

        `straightened=True` confirms that a person has straightened the snake.
        """
        if not straightened:
            raise ValueError("home() makes the present pose the zero: straighten the snake, then home(straightened=True)")
        return self._operation("home")

    def unhome(self) -> Operation:
        """Forget the zero."""
        return self._operation("unhome")

    def condition(self) -> Operation:
        """A decaying stroke of all motors, after which the hysteresis of the wires is known."""
        self._commanded = True
        return self._operation("condition")

    def acknowledge(self) -> Operation:
        """Acknowledge the fault, after the operator has seen it."""
        return self._operation("acknowledge")

    def hold(self) -> str:
        """Stop and hold until the next command. Returns the state when all motion has stopped."""
        return self._operation("hold").wait(DRIVES_TIMEOUT_S).state

    def release(self) -> str:
        """Release the lease. Returns the state."""
        return self.state_command("release")

    def measured_js(self) -> Joints:
        """The model's estimate from the encoders; None until the first one has arrived."""
        return self._joints("i2ris/measured_js")

    def setpoint_js(self) -> Joints:
        """The model's estimate for the setpoints."""
        return self._joints("i2ris/setpoint_js")

    def goal_js(self) -> Joints:
        """The requested goal, clipped to the calibrated hull."""
        return self._joints("i2ris/goal_js")

    def external_jp(self) -> ExternalPosition | None:
        """The last measurement of a camera, as it was sent."""
        return self._newest("i2ris/external/measured_jp", ExternalPosition)

    def period_statistics(self) -> PeriodStatistics | None:
        """Timing of the control loop in the last second."""
        return self._newest("i2ris/period_statistics", PeriodStatistics)

    def operating_state(self) -> OperatingState:
        """State of the controller."""
        message = self._first("i2ris/operating_state", OperatingStateMsg)
        flags = message.flags
        own_refused, own_refusal = self._own_refusals(message)

        def flag(bit: int) -> bool:
            return bool(flags & bit)

        return OperatingState(
            stamp_ns=message.stamp_ns,
            state=STATES.get(message.state, f"unknown state {message.state}"),
            fault=FAULTS.get(message.fault, f"unknown fault {message.fault}"),
            homed=flag(OperatingStateMsg.HOMED),
            busy=flag(OperatingStateMsg.BUSY),
            holding=flag(OperatingStateMsg.HOLDING),
            memory_known=flag(OperatingStateMsg.MEMORY_KNOWN),
            lease=message.lease_client_id == self._client_id,
            taken=message.lease_client_id != 0,
            accepted=message.accepted,
            refused=message.refused,
            last_refusal=refusal_text(own_refusal) if own_refused else "",
            last_refusal_code=own_refusal,
            own_refused=own_refused,
            fault_code=message.fault,
            model=flag(OperatingStateMsg.MODEL),
            at_rest=flag(OperatingStateMsg.AT_REST),
            off=flag(OperatingStateMsg.OFF),
            broken_off=flags >> OperatingStateMsg.BROKEN_OFF_SHIFT,
            boot_id=message.boot_id,
        )

    def errors(self) -> list[Reason]:
        """The last faults, oldest first, also those from before this client connected."""
        return self._reasons("i2ris/error")

    def warnings(self) -> list[Reason]:
        """The last refusals, stops and clips of all clients, oldest first."""
        return self._reasons("i2ris/warning")

    def why(self) -> str:
        """Reasons why the robot does not move, with advice: the state, then the last causes, newest first."""
        state = self.operating_state()
        lines = [repr(self)]
        if state.fault_code:
            lines.append(str(self._fault(state)))
        if not state.homed:
            lines.append("not homed: straighten the snake, then home(straightened=True)")
        elif state.state == "DISABLED":
            lines.append(f"{POWER[state.off]}: enable()")
        elif state.state == "PAUSED":
            lines.append("paused: resume()")
        camera = self.external_jp()
        if camera is not None and (silent_s := (time.monotonic_ns() - camera.stamp_ns) / 1e9) > 0.5:
            lines.append(f"the camera is silent: its last frame arrived {silent_s:.1f} s ago")
        if state.taken and not state.lease:
            lines.append("another client holds the lease: it has to release it, or stop sending")
        causes = sorted(self.errors() + self.warnings(), key=lambda cause: cause.stamp_ns, reverse=True)
        now = time.monotonic_ns()
        for cause in causes[:WHY]:
            own = " (own command)" if cause.own else ""
            lines.append(f"{(now - cause.stamp_ns) / 1e9:.1f} s ago{own}: {cause.text}; action: {cause.advice}")
        return "\n".join(lines)

    def record(self, path: str | os.PathLike[str], note: str = "") -> Recording:
        """Records all streams as MCAP until ``stop()`` or the end of a ``with`` block, by the program ``i2ris record``.

        Raises ``FileExistsError`` if the file exists.
        """
        return Recording(self._link.domain, path, note)

    def _reasons(self, service: str) -> list[Reason]:
        boot = self._link.refresh()
        port = subscriber(self._link, service, ReasonMsg)
        kept = self._kept.setdefault(service, [])
        while (sample := port.receive()) is not None:
            kept.append((boot, ReasonMsg.from_buffer_copy(sample.payload().contents)))
        kept[:] = [(of, message) for of, message in kept if of == boot][-REASONS:]
        return [
            Reason(
                stamp_ns=message.stamp_ns,
                kind=message.kind,
                code=message.number,
                text=text(message.text),
                advice=text(message.advice),
                own=message.client_id == self._client_id,
                measured=measurement(message),
            )
            for _, message in kept
        ]

    def _measured(self, kind: int, code: int) -> str:
        """Measured value and limit of the last fault, or of the last refusal of this client. The messages come a little
        after the state.
        """
        end = time.monotonic() + REASON_TIMEOUT_S
        while True:
            reasons = self.errors() if kind == FAULT_KIND else self.warnings()
            found = [it for it in reasons if (it.kind, it.code) == (kind, code) and (it.own or kind == FAULT_KIND)]
            if found or time.monotonic() > end:
                return found[-1].measured if found else ""
            time.sleep(POLL_S)

    def _fault(self, state: OperatingState, what: str = "") -> Fault:
        return Fault(what, state.fault_code, self._measured(FAULT_KIND, state.fault_code))

    def _own_refusals(self, message: OperatingStateMsg) -> tuple[int, int]:
        """Number of refused servo commands of this client alone, and the code of the last refusal."""
        for client, count, code in zip(message.refused_client_id, message.refused_commands, message.refused_reason):
            if count > 0 and client == self._client_id:
                return count, code
        return 0, 0

    def state_command(self, command: str) -> str:
        """Requests a change of state by its name and returns the state right after: see ``COMMANDS``. Raises Refused.
        Longer operations continue after the reply; ``enable``, ``home`` and the like can wait for them.
        """
        if command not in COMMANDS:
            raise ValueError(f"no such command: {command!r}; one of {', '.join(COMMANDS)}")
        request = StateCommandRequest(client_id=self._client_id, command=COMMANDS[command])
        return self._accepted(command, self._request("i2ris/state_command", request, StateCommandReply))

    def is_enabled(self) -> bool:
        """Whether the robot follows commands."""
        state = self.operating_state()
        return state.state == "ENABLED"

    def is_homed(self) -> bool:
        """Whether the zero of every axis is known."""
        state = self.operating_state()
        return state.homed

    def is_busy(self) -> bool:
        """Whether a motion or a change of state is in progress."""
        state = self.operating_state()
        return state.busy

    def _accepted(self, command: str, reply: StateCommandReply) -> str:
        """The state in a reply. Raises Refused."""
        state = STATES.get(reply.state, f"unknown state {reply.state}")
        if reply.refusal:
            raise Refused(f"`{command}` in state {state}", reply.refusal, measured=measurement(reply))
        return state

    def _operation(self, command: str) -> Operation:
        """Requests a state command; waits for drives that are starting."""
        end = time.monotonic() + DRIVES_TIMEOUT_S
        boot_id = self.operating_state().boot_id
        while True:
            try:
                self.state_command(command)
                return Operation(self, command, command, boot_id)
            except Refused as refused:
                if refused.code != DRIVES_NOT_READY or time.monotonic() > end:
                    raise
                time.sleep(0.05)

    def _raise_refusals(self) -> None:
        """Raises refusals of this client since its last command."""
        state = self.operating_state()
        if not self._strict:
            return
        if state.state == "FAULT":
            raise self._fault(state)
        # The count may have restarted in between.
        before, self._refused = self._refused, state.own_refused
        if self._commanded and state.own_refused not in (0, before):
            code = state.last_refusal_code
            raise Refused("a command of the stream", code, measured=self._measured(REFUSAL_KIND, code))

    def wait_for(self, wanted: Callable[[OperatingState], bool], timeout_s: float = 15.0) -> OperatingState:
        """Waits until the operating state fulfils a condition. Raises TimeoutError."""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            state = self.operating_state()
            if wanted(state):
                return state
            time.sleep(POLL_S)
        raise TimeoutError(f"the robot did not reach the expected state within {timeout_s} s")

    def version(self) -> Version:
        """Version of the domain's controller."""
        return self._request("i2ris/version", VersionRequest(), Version)

    def _next(self) -> int:
        self._sequence += 1
        return self._sequence

    def _stamped(self, kind: type[P], count: int) -> P:
        """A command with this number of values, from this client and of now."""
        return kind(
            sequence=self._next(),
            stamp_ns=time.monotonic_ns(),
            client_id=self._client_id,
            deadline_ns=self._deadline_ns,
            count=count,
        )

    def _send(self, service: str, command: Any) -> int:
        publisher(self._link, service, type(command)).send_copy(command)
        self._commanded = True
        return int(command.sequence)

    def _request(self, service: str, request: Payload, reply: type[P], timeout_s: float = REPLY_TIMEOUT_S) -> P:
        return self._begin(service, request, reply, timeout_s).wait()

    def _begin(self, service: str, request: Payload, reply: type[P], timeout_s: float) -> Pending[P]:
        port = client(self._link, service, type(request), reply)
        if hasattr(request, "valid_ns"):
            # A request that is read later is not carried out: its client has timed out.
            request.stamp_ns, request.valid_ns = time.monotonic_ns(), int((timeout_s - MARGIN_S) * 1e9)
        return Pending(port.send_copy(request), self._link.refresh, service, reply, timeout_s)

    def _newest(self, service: str, payload: type[P]) -> P | None:
        boot = self._link.refresh()
        port = subscriber(self._link, service, payload)
        while (sample := port.receive()) is not None:
            self._latest[service] = (boot, payload.from_buffer_copy(sample.payload().contents))
        latest: Any = self._latest.get(service)
        # The message of a controller that has ended is dropped.
        return latest[1] if latest is not None and latest[0] == boot else None

    def _joints(self, service: str) -> Joints:
        message = self._first(service, JointState)
        count = message.count
        return Joints(
            stamp_ns=message.stamp_ns,
            position=np.array(message.position[:count]),
            velocity=np.array(message.velocity[:count]),
            deviation=np.array(message.deviation[:count]),
            valid=bool(message.flags & JointState.VALID),
            memory_known=bool(message.flags & JointState.MEMORY_KNOWN),
            clipped=bool(message.flags & JointState.CLIPPED),
            sequence=message.sequence,
        )


def _close(arm: weakref.ref[Arm]) -> None:
    it = arm()
    if it is not None:
        it.close()

"""A complete client without the i2ris package: iceoryx2, ctypes and the shared-memory chapter of the manual.

    python examples/foreign_client.py i2ris

Prints the operating state and the measured angles, then holds the lease for one second by repeating
the present setpoint. Nothing moves. The robot must be ENABLED and have a model.
"""

import ctypes
import fcntl
import os
import secrets
import struct
import sys
import time
from pathlib import Path
from typing import Any

import iceoryx2 as iox2


class ServoJp(ctypes.Structure):
    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("client_id", ctypes.c_uint64),
        ("deadline_ns", ctypes.c_uint64),
        ("position", ctypes.c_double * 3),
        ("count", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "I2risServoJpV1"


class JointState(ctypes.Structure):
    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("boot_id", ctypes.c_uint64),
        ("position", ctypes.c_double * 3),
        ("velocity", ctypes.c_double * 3),
        ("deviation", ctypes.c_double * 3),
        ("model_id", ctypes.c_uint8 * 32),
        ("count", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "I2risJointStateV1"


def is_served(folder: Path) -> bool:
    """Whether a controller locks the second byte of the file: only then is `ready` valid."""
    layout = "hhqqi4x"
    probe = struct.pack(layout, fcntl.F_WRLCK, os.SEEK_SET, 1, 1, 0)
    try:
        with open(folder / "lock", "rb") as lock:
            answer = fcntl.fcntl(lock, fcntl.F_OFD_GETLK, probe)
    except FileNotFoundError:
        return False
    return bool(struct.unpack(layout, answer)[0] != fcntl.F_UNLCK)


def connect(domain: str) -> Any:
    """A node in the shared memory of the controller that serves the domain now."""
    folder = Path(f"/dev/shm/i2ris-{os.geteuid()}-{domain}")
    if not is_served(folder):
        sys.exit(f"no controller serves domain {domain}")
    boot, interface, _process = (folder / "ready").read_text().split()
    if interface != "7":
        sys.exit(f"the controller has interface version {interface}, this client 7: use the same release for both")
    config = iox2.config.default()
    config.global_cfg.root_path = iox2.Path.new(str(folder / boot))
    config.global_cfg.prefix = iox2.FileName.new(f"{folder.name}_{boot}_")
    config.global_cfg.node.cleanup_dead_nodes_on_creation = False
    config.global_cfg.node.cleanup_dead_nodes_on_destruction = False
    config.global_cfg.service.cleanup_dead_nodes_on_open = False
    return iox2.NodeBuilder.new().config(config).create(iox2.ServiceType.Ipc)


def stream(node: Any, name: str, payload: type[ctypes.Structure]) -> Any:
    return node.service_builder(iox2.ServiceName.new(name)).publish_subscribe(payload).open()


def newest(subscriber: Any, payload: type[ctypes.Structure], timeout_s: float = 1.0) -> Any:
    """The newest message; waits for the first one."""
    message, end = None, time.monotonic() + timeout_s
    while message is None and time.monotonic() < end:
        while (sample := subscriber.receive()) is not None:
            message = payload.from_buffer_copy(sample.payload().contents)
        time.sleep(0.001)
    if message is None:
        sys.exit("no message within one second")
    return message


def main() -> None:
    node = connect(sys.argv[1] if len(sys.argv) > 1 else "i2ris")
    measured = stream(node, "i2ris/measured_js", JointState).subscriber_builder().create()
    setpoint = stream(node, "i2ris/setpoint_js", JointState).subscriber_builder().create()
    commands = stream(node, "i2ris/servo_jp", ServoJp).publisher_builder().create()
    joints = newest(measured, JointState)
    print("measured", [round(value, 6) for value in joints.position[: joints.count]], "rad")
    hold = newest(setpoint, JointState)
    if not hold.flags & 1:
        sys.exit("the controller has no model: angles are not valid")
    client_id = secrets.randbits(63) | 1
    for sequence in range(1, 101):
        command = ServoJp(
            sequence=sequence,
            stamp_ns=time.monotonic_ns(),
            client_id=client_id,
            deadline_ns=0,
            position=hold.position,
            count=hold.count,
        )
        commands.send_copy(command)
        time.sleep(0.01)
    print("100 commands sent")


if __name__ == "__main__":
    main()

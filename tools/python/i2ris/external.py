"""Telling the controller what a camera saw: the stream ``external/measured_jp``.

The layout is that of ``ExternalPosition`` in ``src/ipc/payload.rs``; where the shared memory of a domain lies is told in
``src/ipc/domain.rs``.
"""

import ctypes
import fcntl
import os
import re
import struct
from pathlib import Path

import iceoryx2 as iox2

INTERFACE_VERSION = 1
SERVICE = "i2ris/external/measured_jp"
VALID = 1


class ExternalPosition(ctypes.Structure):
    """Angles seen by a sensor; all zero but the stamp where it saw nothing."""

    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("stamp_ns", ctypes.c_uint64),
        ("position", ctypes.c_double * 3),
        ("deviation", ctypes.c_double * 3),
        ("quality", ctypes.c_double),
        ("count", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
    ]

    @staticmethod
    def type_name() -> str:
        return "I2risExternalPositionV2"


class NoController(Exception):
    """Nobody serves the domain now; it may come."""


class ExternalPublisher:
    """Publishes observations; finds a controller that starts later or anew."""

    def __init__(self, domain: str = "i2ris"):
        if not re.fullmatch(r"[A-Za-z0-9-]{1,32}", domain):
            raise ValueError(f"domain name {domain!r} is not valid: use 1 to 32 letters, digits or -")
        self.domain = domain
        self.directory = Path(f"/dev/shm/i2ris-{os.geteuid()}-{domain}")
        self._boot = None
        self._node = self._service = self._publisher = None
        self._sequence = 0

    def publish(self, stamp_ns: int, position, deviation=(), quality: float = 0.0) -> None:
        """Publishes angles, rad, that were true at ``stamp_ns`` (``time.monotonic_ns()``).

        Raises NoController while nobody serves the domain; the message is lost then.
        """
        if not 1 <= len(position) <= 3 or len(deviation) > 3:
            raise ValueError("1 to 3 values")
        message = ExternalPosition(stamp_ns=stamp_ns, quality=quality, count=len(position), flags=VALID)
        message.position[: len(position)] = list(position)
        message.deviation[: len(deviation)] = list(deviation)
        self._send(message)

    def publish_nothing(self, stamp_ns: int) -> None:
        """Publishes that the sensor looked but saw nothing."""
        self._send(ExternalPosition(stamp_ns=stamp_ns))

    def _send(self, message: ExternalPosition) -> None:
        self._sequence += 1
        message.sequence = self._sequence
        self._connect()
        self._publisher.send_copy(message)

    def _connect(self) -> None:
        boot = self._ready()
        if boot == self._boot:
            return
        # In this order: a port must not outlive its node.
        self._publisher = self._service = self._node = None
        self._boot = None
        config = iox2.config.default()
        config.global_cfg.root_path = iox2.Path.new(str(self.directory / boot))
        config.global_cfg.prefix = iox2.FileName.new(f"{self.directory.name}_{boot}_")
        # Only the controller cleans up after dead processes.
        config.global_cfg.node.cleanup_dead_nodes_on_creation = False
        config.global_cfg.node.cleanup_dead_nodes_on_destruction = False
        config.global_cfg.service.cleanup_dead_nodes_on_open = False
        mode = iox2.SignalHandlingMode.Disabled
        self._node = iox2.NodeBuilder.new().config(config).signal_handling_mode(mode).create(iox2.ServiceType.Ipc)
        name = iox2.ServiceName.new(SERVICE)
        self._service = self._node.service_builder(name).publish_subscribe(ExternalPosition).open()
        self._publisher = self._service.publisher_builder().create()
        self._boot = boot

    def _ready(self) -> str:
        """The boot id of the controller that serves now."""
        absent = NoController(f"no controller serves domain {self.domain}; start i2ris-control, or name its domain")
        try:
            boot, interface, _pid = (self.directory / "ready").read_text().split()
            with open(self.directory / "lock", "rb") as lock:
                held = _is_held(lock)
        except (OSError, ValueError):
            raise absent from None
        if not held:
            raise absent
        if int(interface) != INTERFACE_VERSION:
            raise RuntimeError(f"the controller has interface version {interface}, not {INTERFACE_VERSION}")
        return boot


def _is_held(lock) -> bool:
    """Whether a controller holds its lock: the file alone may have been left behind. Asks without taking it."""
    layout = "hhqqi4x"
    probe = struct.pack(layout, fcntl.F_WRLCK, os.SEEK_SET, 0, 0, 0)
    answer = fcntl.fcntl(lock, fcntl.F_OFD_GETLK, probe)
    return struct.unpack(layout, answer)[0] != fcntl.F_UNLCK

"""The connection to whatever controller serves a domain, across its restarts.

``src/ipc/domain.rs`` documents the location of the shared memory of a domain. Every start of the controller has its own
shared memory; ports of an old one are opened again.
"""

import ctypes
import fcntl
import importlib.metadata
import os
import re
import struct
import time
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import iceoryx2 as iox2

from .payload import INTERFACE_VERSION, Payload

#: Versions of iceoryx2 refuse each other: exactly the controller's.
ICEORYX2_VERSION = "0.10.0"
#: Period of reading the announcement of the controller, s.
PROBE_S = 0.02


#: Objects that a child of a fork must not use: they belong to its parent.
of_this_process: weakref.WeakSet[Any] = weakref.WeakSet()


def _after_fork() -> None:
    for it in of_this_process:
        it.after_fork()


os.register_at_fork(after_in_child=_after_fork)


class NoController(Exception):
    """No controller serves the domain now; it may start later."""


class TooManyClients(Exception):
    """A stream has its maximum number of clients."""


class OtherInterface(Exception):
    """The controller has another version; install the package of its release."""


class Link:
    """The connection to the controller of a domain. Opens nothing before its first use."""

    def __init__(self, domain: str = "i2ris", client_id: int | None = None):
        """``client_id``: identity in the commands of this process, for logs that name it."""
        self.check_iceoryx2(importlib.metadata.version("iceoryx2"))
        if not re.fullmatch(r"[A-Za-z0-9-]{1,32}", domain):
            raise ValueError(f"domain name {domain!r} is not valid: use 1 to 32 letters, digits or -")
        self.domain = domain
        self.directory = Path(f"/dev/shm/i2ris-{os.geteuid()}-{domain}")
        self._client_id = client_id
        self._pid_file: Path | None = None
        self._boot: str | None = None
        self._node: Any = None
        self._ports: dict[tuple[str, str], list[Any]] = {}
        self._next_probe = 0.0
        of_this_process.add(self)

    def port(self, key: tuple[str, str], opened: Callable[[Any], list[Any]]) -> Any:
        """The port of this key; ``opened(node)`` creates it, again after a restart of the controller."""
        self.refresh()
        if key not in self._ports:
            try:
                self._ports[key] = opened(self._node)
            except Exception as error:
                if "ExceedsMax" not in str(error):
                    raise
                raise TooManyClients(
                    f"all places of {key[1]} in domain {self.domain} are taken: end other clients, or share one Arm"
                ) from error
        return self._ports[key][-1]

    @staticmethod
    def check_iceoryx2(installed: str) -> None:
        """Raises OtherInterface for a wheel that the controller does not understand."""
        if installed != ICEORYX2_VERSION:
            raise OtherInterface(
                f"iceoryx2 {installed} is installed, but interface version {INTERFACE_VERSION} needs iceoryx2 "
                f"{ICEORYX2_VERSION}: pip install iceoryx2=={ICEORYX2_VERSION}"
            )

    def refresh(self) -> str:
        """The boot id of the controller that serves. Raises NoController or OtherInterface."""
        now = time.monotonic()
        if self._boot is not None and now < self._next_probe:
            return self._boot
        boot = self._ready()
        self._next_probe = now + PROBE_S
        if boot != self._boot:
            self.close()
            self._node = self._create_node(boot)
            self._write_pid_file(boot)
            self._boot = boot
        return boot

    def close(self) -> None:
        """Closes everything. The next use connects again."""
        # In this order: a port must not outlive its node.
        for port in self._ports.values():
            port.clear()
        self._ports.clear()
        self._node = None
        self._boot = None
        if self._pid_file is not None:
            self._pid_file.unlink(missing_ok=True)
            self._pid_file = None

    def after_fork(self, client_id: int | None = None) -> None:
        """In a child of a fork: the next use connects again, with a new identity. Open ports stay the parent's; they
        are never freed here, because that would remove the parent's shared memory.
        """
        for inherited in (self._ports, self._node):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(inherited))
        self._ports, self._node, self._boot, self._pid_file = {}, None, None, None
        self._client_id, self._next_probe = client_id, 0.0

    def _write_pid_file(self, boot: str) -> None:
        """Writes the process id of this client, as ``src/ipc/client_process.rs`` documents."""
        if self._client_id is None:
            return
        path = self.directory / f"client-{self._client_id:016x}-{boot}"
        try:
            with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w") as file:
                file.write(f"{os.getpid()}\n")
            self._pid_file = path
        except OSError:
            # Without this file the client only has no name.
            pass

    def _create_node(self, boot: str) -> Any:
        config = iox2.config.default()
        config.global_cfg.root_path = iox2.Path.new(str(self.directory / boot))
        config.global_cfg.prefix = iox2.FileName.new(f"{self.directory.name}_{boot}_")
        # Only the controller cleans up after dead processes.
        config.global_cfg.node.cleanup_dead_nodes_on_creation = False
        config.global_cfg.node.cleanup_dead_nodes_on_destruction = False
        config.global_cfg.service.cleanup_dead_nodes_on_open = False
        mode = iox2.SignalHandlingMode.Disabled
        return iox2.NodeBuilder.new().config(config).signal_handling_mode(mode).create(iox2.ServiceType.Ipc)

    def _ready(self) -> str:
        absent = NoController(f"no controller serves domain {self.domain}; start i2ris-control, or name its domain")
        try:
            boot, interface, _pid = (self.directory / "ready").read_text().split()
            with open(self.directory / "lock", "rb") as lock:
                held = _is_served(lock)
        except (OSError, ValueError):
            held = False
        if not held:
            self.close()
            raise absent
        if int(interface) != INTERFACE_VERSION:
            self.close()
            raise OtherInterface(
                f"the controller of domain {self.domain} has interface version {interface}, this package "
                f"{INTERFACE_VERSION}: use the same release for both (install the package of the controller's)"
            )
        return boot


def publisher(link: Link, service: str, payload: type[Payload]) -> Any:
    """A publisher of a stream that the controller reads."""

    def opened(node: Any) -> list[Any]:
        factory = _streams(node, service, payload)
        return [factory, factory.publisher_builder().create()]

    return link.port(("publish", service), opened)


def subscriber(link: Link, service: str, payload: type[Payload]) -> Any:
    """A subscriber of a stream."""

    def opened(node: Any) -> list[Any]:
        factory = _streams(node, service, payload)
        return [factory, factory.subscriber_builder().create()]

    return link.port(("subscribe", service), opened)


def client(link: Link, service: str, request: type[Payload], reply: type[Payload]) -> Any:
    """A client of a request service."""

    def opened(node: Any) -> list[Any]:
        builder = node.service_builder(iox2.ServiceName.new(service)).request_response(request, reply)
        factory = builder.open()
        return [factory, factory.client_builder().create()]

    return link.port(("ask", service), opened)


def _streams(node: Any, service: str, payload: type[Payload]) -> Any:
    return node.service_builder(iox2.ServiceName.new(service)).publish_subscribe(payload).open()


def _is_served(lock: BinaryIO) -> bool:
    """Whether a controller serves, by its lock on the second byte, without taking it. The file alone may be a leftover,
    and a controller that holds only the first byte is starting: ``ready`` may be that of a killed one.
    """
    layout = "hhqqi4x"
    probe = struct.pack(layout, fcntl.F_WRLCK, os.SEEK_SET, 1, 1, 0)
    answer = fcntl.fcntl(lock, fcntl.F_OFD_GETLK, probe)
    return bool(struct.unpack(layout, answer)[0] != fcntl.F_UNLCK)

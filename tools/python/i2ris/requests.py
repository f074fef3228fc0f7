"""What the parts of an arm need of it."""

from __future__ import annotations

from typing import Any, Callable, Protocol, TypeVar

from .payload import Payload, StateCommandReply
from .values import Fault, Joints, OperatingState

P = TypeVar("P", bound=Payload)
#: Timeout for a reply, s.
REPLY_TIMEOUT_S = 1.0

#: Time for the reply to a request that was carried out at the last moment.
MARGIN_S = 0.05
#: Polling period, s.
POLL_S = 0.001


class Requests(Protocol):
    """Streams, requests and state of an arm."""

    _client_id: int

    def _first(self, service: str, payload: type[P]) -> P: ...

    def _request(self, service: str, request: Payload, reply: type[P], timeout_s: float = REPLY_TIMEOUT_S) -> P: ...

    def _accepted(self, command: str, reply: StateCommandReply) -> str: ...

    def _raise_refusals(self) -> None: ...

    def _stamped(self, kind: type[P], count: int) -> P: ...

    def _send(self, service: str, command: Any) -> int: ...

    def _joints(self, service: str) -> Joints: ...

    def _fault(self, state: OperatingState, what: str = "") -> Fault: ...

    def setpoint_js(self) -> Joints: ...

    def operating_state(self) -> OperatingState: ...

    def wait_for(self, wanted: Callable[[OperatingState], bool], timeout_s: float = 15.0) -> OperatingState: ...

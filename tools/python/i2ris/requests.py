"""Interface of an arm for its parts."""

from __future__ import annotations

import time
from typing import Any, Callable, Generic, Protocol, TypeVar

from .payload import Payload, StateCommandReply
from .values import Fault, Joints, NoReply, OperatingState

P = TypeVar("P", bound=Payload)
#: Timeout for a reply, s.
REPLY_TIMEOUT_S = 1.0

#: Time for the reply to a request that was carried out at the last moment.
MARGIN_S = 0.05
#: Polling period, s.
POLL_S = 0.001


class Pending(Generic[P]):
    """A pending request."""

    def __init__(self, sent: Any, refresh: Callable[[], Any], service: str, reply: type[P], timeout_s: float):
        self._sent, self._refresh, self._service, self._reply = sent, refresh, service, reply
        self._timeout_s, self._end = timeout_s, time.monotonic() + timeout_s

    def poll(self) -> P | None:
        """Its reply; None: not yet. Does not wait. Raises ``NoReply``, and ``NoController`` if the controller has ended."""
        response = self._sent.receive()
        if response is not None:
            return self._reply.from_buffer_copy(response.payload().contents)
        self._refresh()
        if time.monotonic() > self._end:
            raise NoReply(f"{self._service} does not answer within {self._timeout_s} s")
        return None

    def wait(self) -> P:
        """Waits for its reply."""
        while (reply := self.poll()) is None:
            time.sleep(POLL_S)
        return reply


class Requests(Protocol):
    """Streams, requests and state of an arm."""

    _client_id: int

    def _first(self, service: str, payload: type[P]) -> P: ...

    def _request(self, service: str, request: Payload, reply: type[P], timeout_s: float = REPLY_TIMEOUT_S) -> P: ...

    def _begin(self, service: str, request: Payload, reply: type[P], timeout_s: float) -> Pending[P]: ...

    def _accepted(self, command: str, reply: StateCommandReply) -> str: ...

    def _raise_refusals(self) -> None: ...

    def _stamped(self, kind: type[P], count: int) -> P: ...

    def _send(self, service: str, command: Any) -> int: ...

    def _joints(self, service: str) -> Joints: ...

    def _fault(self, state: OperatingState, what: str = "") -> Fault: ...

    def setpoint_js(self) -> Joints: ...

    def operating_state(self) -> OperatingState: ...

    def wait_for(self, wanted: Callable[[OperatingState], bool], timeout_s: float = 15.0) -> OperatingState: ...

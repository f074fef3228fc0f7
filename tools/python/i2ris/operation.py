"""A command that the controller has accepted."""

from __future__ import annotations

import time

import numpy as np

from .reasons import (
    ADVICE,
    ARRIVAL_DEG,
    DRIVES_S,
    PROGRESS,
    PROGRESS_FLAGS,
    PROGRESS_STATES,
    SETTLE_S,
    SILENCE_S,
    STOPS,
)
from .requests import POLL_S, Requests
from .values import STOP_KIND, NoReply, OperatingState, Stopped

BUSY, ENDED, DONE, BROKEN_OFF = "busy", "ended", "done", "broken off"
LETTERS = {"b": BUSY, "e": ENDED, "d": DONE, "x": BROKEN_OFF}


def progress(command: str, state: OperatingState) -> str:
    """Progress of an accepted command according to a state. ``ENDED``: nothing is in progress, but the effect is not
    confirmed.
    """
    if state.state not in PROGRESS_STATES:
        return BROKEN_OFF
    number = PROGRESS_STATES.index(state.state)
    for flag in PROGRESS_FLAGS:
        number = 2 * number + bool(getattr(state, flag))
    return LETTERS[PROGRESS[command][number]]


class Operation:
    """A command that the controller has accepted just now, and carries out."""

    def __init__(self, arm: Requests, name: str, command: str, boot_id: int, goal: np.ndarray | None = None):
        self._arm, self._name, self._command, self._goal = arm, name, command, goal
        self._accepted_ns, self._boot_id = time.monotonic_ns(), boot_id
        self._ended_ns = 0

    def is_done(self) -> bool:
        """Whether its effect is confirmed. Does not wait. Raises like ``wait`` if it was interrupted."""
        state = self._arm.operating_state()
        if time.monotonic_ns() - max(state.stamp_ns, self._accepted_ns) > SILENCE_S * 1e9:
            raise NoReply(f"the controller has not reported its state for {SILENCE_S} s; see its log")
        if state.stamp_ns <= self._accepted_ns:
            return False
        if state.boot_id != self._boot_id:
            raise Stopped(f"{self._name}: the controller was restarted; check the robot before you continue")
        now = progress(self._command, state)
        if now == BROKEN_OFF:
            if state.state == "FAULT":
                raise self._arm._fault(state, f"{self._name}: ")
            stop = state.broken_off
            why = f"stop {stop}: {STOPS[stop]}; action: {ADVICE[STOP_KIND, stop]}; " if stop in STOPS else ""
            raise Stopped(f"{self._name}: not carried out: {why}the robot is {state.state}")
        if now == DONE and self._is_at_goal():
            return True
        if now != BUSY:
            self._ended_ns = self._ended_ns or time.monotonic_ns()
            limit_s = DRIVES_S if self._command == "disable" else SETTLE_S
            if time.monotonic_ns() - self._ended_ns > limit_s * 1e9:
                raise Stopped(f"{self._name}: it ended, but its effect is not confirmed")
        return False

    def wait(self, timeout_s: float = 300.0) -> OperatingState:
        """Waits for its effect. Raises ``Fault``, ``Stopped`` or ``TimeoutError``."""
        end = time.monotonic() + timeout_s
        while not self.is_done():
            if time.monotonic() > end:
                raise TimeoutError(f"{self._name}: its effect was not confirmed within {timeout_s} s")
            time.sleep(POLL_S)
        return self._arm.operating_state()

    def _is_at_goal(self) -> bool:
        """Whether it is at its goal: a replaced motion ends elsewhere."""
        if self._goal is None:
            return True
        setpoint = self._arm.setpoint_js()
        return not setpoint.valid or np.degrees(np.linalg.norm(setpoint.position - self._goal)) <= ARRIVAL_DEG

"""A command that the controller has accepted."""

from __future__ import annotations

import time

import numpy as np

from .reasons import ADVICE, STOPS
from .requests import POLL_S, Requests
from .values import STOP_KIND, NoReply, OperatingState, Stopped

#: Distance of the setpoint from the goal at which a motion has arrived, deg: rounding to counts, and the dead-band.
ARRIVAL_DEG = 0.5
#: The effect is there so long after the robot is no longer busy, or not at all, s. Drives go off by some exchanges.
SETTLE_S, DRIVES_S = 1.0, 5.0
#: A controller that has not reported its state for so long hangs, s.
SILENCE_S = 3.0
BUSY, ENDED, DONE, BROKEN_OFF = "busy", "ended", "done", "broken off"


def progress(command: str, state: OperatingState) -> str:
    """What a state says about a command that was accepted before: the table of ``src/ipc/client/effect.rs``. ``ENDED``:
    nothing goes on any more, and the effect is not there.
    """
    is_fault, is_off = state.state == "FAULT", state.state == "DISABLED"

    def otherwise(goes_on: bool) -> str:
        return BUSY if goes_on else BROKEN_OFF

    if command in ("enable", "resume"):
        return DONE if state.state == "ENABLED" else otherwise(state.busy and not is_fault)
    if command == "disable":
        if state.busy and not is_fault:
            return otherwise(is_off)
        return (DONE if state.off else ENDED) if is_fault or is_off else BROKEN_OFF
    if command == "acknowledge":
        return otherwise(state.busy) if is_fault else BUSY if is_off and state.busy else DONE
    if is_fault:
        return BROKEN_OFF
    if command == "home":
        return BROKEN_OFF if state.broken_off else BUSY if state.busy else DONE if state.homed else ENDED
    if command == "unhome":
        return ENDED if state.homed else DONE
    if command == "pause":
        return DONE if state.state == "PAUSED" and state.at_rest else otherwise(state.state == "PAUSED")
    if command == "hold":
        is_on = state.state in ("ENABLED", "PAUSED")
        return DONE if is_on and state.holding and state.at_rest else otherwise(is_on and state.holding)
    if state.broken_off or state.state != "ENABLED":
        return BROKEN_OFF
    is_there = command != "condition" or state.memory_known or not state.model
    return BUSY if state.busy else DONE if is_there else ENDED


class Operation:
    """A command that the controller has accepted just now, and carries out."""

    def __init__(self, arm: Requests, name: str, command: str, boot_id: int, goal: np.ndarray | None = None):
        self._arm, self._name, self._command, self._goal = arm, name, command, goal
        self._accepted_ns, self._boot_id = time.monotonic_ns(), boot_id
        self._ended_ns = 0

    def is_done(self) -> bool:
        """Whether its effect is there. Does not wait. Raises as ``wait`` when something else came instead."""
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
            why = f"stop {stop}: {STOPS[stop]}; do: {ADVICE[STOP_KIND, stop]}; " if stop in STOPS else ""
            raise Stopped(f"{self._name}: not carried out: {why}the robot is {state.state}")
        if now == DONE and self._is_at_goal():
            return True
        if now != BUSY:
            self._ended_ns = self._ended_ns or time.monotonic_ns()
            limit_s = DRIVES_S if self._command == "disable" else SETTLE_S
            if time.monotonic_ns() - self._ended_ns > limit_s * 1e9:
                raise Stopped(f"{self._name}: it has ended, and its effect is not known to be there")
        return False

    def wait(self, timeout_s: float = 300.0) -> OperatingState:
        """Waits for its effect. Raises ``Fault``, ``Stopped`` or ``TimeoutError``."""
        end = time.monotonic() + timeout_s
        while not self.is_done():
            if time.monotonic() > end:
                raise TimeoutError(f"{self._name}: its effect was not there within {timeout_s} s")
            time.sleep(POLL_S)
        return self._arm.operating_state()

    def _is_at_goal(self) -> bool:
        """A motion that another one has replaced ends away from its goal."""
        if self._goal is None:
            return True
        setpoint = self._arm.setpoint_js()
        return not setpoint.valid or np.degrees(np.linalg.norm(setpoint.position - self._goal)) <= ARRIVAL_DEG

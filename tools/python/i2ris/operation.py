"""A command that the controller has accepted."""

from __future__ import annotations

import time
from typing import Callable

import numpy as np

from .requests import Requests
from .values import OperatingState, Stopped

#: Distance of the setpoint from the goal at which a motion has arrived, deg: rounding to counts, and the dead-band.
ARRIVAL_DEG = 0.5


class Operation:
    """A command that the controller has accepted and carries out."""

    def __init__(
        self,
        arm: Requests,
        name: str,
        done: Callable[[OperatingState], bool],
        goal: np.ndarray | None = None,
    ):
        self._arm, self._name, self._done, self._goal = arm, name, done, goal
        self._accepted_ns = time.monotonic_ns()

    def is_done(self) -> bool:
        """Whether the robot is no longer busy with it. Does not wait."""
        state = self._arm.operating_state()
        return state.stamp_ns > self._accepted_ns and not state.busy

    def wait(self, timeout_s: float = 300.0) -> OperatingState:
        """Waits until it is carried out. Raises ``Fault``, ``Stopped`` or ``TimeoutError``."""

        def ended(state: OperatingState) -> bool:
            return state.stamp_ns > self._accepted_ns and not state.busy

        state = self._arm.wait_for(ended, timeout_s)
        if state.state == "FAULT":
            raise self._arm._fault(state, f"{self._name}: ")
        if not self._done(state):
            raise Stopped(f"{self._name}: ended before it was carried out; the robot is {state.state}")
        if self._goal is not None:
            self._check_arrival()
        return state

    def _check_arrival(self) -> None:
        """A motion that somebody has stopped ends away from its goal."""
        setpoint = self._arm.setpoint_js()
        if self._goal is None or not setpoint.valid:
            return
        away = np.degrees(np.linalg.norm(setpoint.position - self._goal))
        if away > ARRIVAL_DEG:
            raise Stopped(f"{self._name}: the setpoint is {away:.2f} deg away from the goal: stopped")

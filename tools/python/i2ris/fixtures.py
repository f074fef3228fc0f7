"""Virtual fixtures: regions that the snake may not enter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Sequence

import numpy as np

from .payload import StateCommandReply, VirtualFixtureRequest, VirtualFixturesMsg
from .requests import Requests
from .values import text

#: Name and number of values for each kind of region; a polygon uses as many as it needs.
KINDS = {1: ("circle", 3), 2: ("half-plane", 3), 3: ("ball", 4), 4: ("half-space", 4), 5: ("polygon", 17)}
ON, OFF, ADD, REMOVE = 1, 2, 3, 4


@dataclass(frozen=True)
class Fixture:
    """A region that the snake may not enter."""

    name: str
    #: circle, half-plane, ball, half-space or polygon.
    kind: str
    #: rad or m, see ``VirtualFixtureRequest``; a polygon: the number of its corners, then pitch and yaw of each.
    values: np.ndarray
    #: Whether it is active.
    active: bool
    #: Whether it limited the last goal.
    limits: bool


class FixtureArm:
    """The virtual fixtures of an arm. Removing them or switching them off needs the lease and a robot that is not following."""

    def __init__(self, arm: Requests):
        self._arm = arm

    def list(self) -> list[Fixture]:
        """All regions, in the order of their numbers; they are published once a second and after every change."""
        message = self._arm._first("i2ris/virtual_fixtures", VirtualFixturesMsg)
        found = []
        for index, number in enumerate(message.kind):
            if number in KINDS:
                kind, values = KINDS[number]
                found.append(
                    Fixture(
                        name=text(message.name[index]),
                        kind=kind,
                        values=np.array(message.values[index][:values]),
                        active=bool(message.active & 1 << index),
                        limits=message.limited_by == index + 1,
                    )
                )
        return found

    def on(self) -> str:
        """Switches all regions on. Returns the state of the robot; raises ``Refused``."""
        return self._request("fixtures on", ON)

    def off(self) -> str:
        """Switches all regions off."""
        return self._request("fixtures off", OFF)

    def remove_added(self) -> str:
        """Removes the regions that were added while the controller runs; those of the configuration stay."""
        return self._request("remove fixtures", REMOVE)

    def add_circle(self, pitch_rad: float, yaw_rad: float, radius_rad: float) -> str:
        """Adds a forbidden circle, rad."""
        return self._request("add a circle", ADD, 1, [pitch_rad, yaw_rad, radius_rad])

    def add_half_plane(self, normal: Sequence[float], offset_rad: float) -> str:
        """Adds the forbidden half-plane ``normal . angles > offset_rad``, rad."""
        return self._request("add a half-plane", ADD, 2, [*normal, offset_rad])

    def add_ball(self, centre_m: Sequence[float], radius_m: float) -> str:
        """Adds a forbidden ball, m, for a model of the tip."""
        return self._request("add a ball", ADD, 3, [*centre_m, radius_m])

    def add_half_space(self, normal: Sequence[float], offset_m: float) -> str:
        """Adds the forbidden half-space ``normal . tip > offset_m``, m, for a model of the tip."""
        return self._request("add a half-space", ADD, 4, [*normal, offset_m])

    def _request(self, what: str, action: int, kind: int = 0, values: Sequence[float] = ()) -> str:
        expected = KINDS[kind][1] if kind else 0
        if len(values) != expected:
            raise ValueError(f"{what}: {len(values)} values, {expected} are needed")
        request = VirtualFixtureRequest(client_id=self._arm._client_id, action=action, kind=kind)
        request.values[: len(values)] = [float(value) for value in values]
        return self._arm._accepted(what, self._arm._request("i2ris/virtual_fixture", request, StateCommandReply))

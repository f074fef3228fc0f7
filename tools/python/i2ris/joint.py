"""Pitch and yaw from the angles of both views; the same formulas as ``tools/vision/src/joint_angles.rs``.

View i shows the bend in the direction phi_i, turned from pitch towards yaw:
``tan view_i = cos phi_i tan pitch + sin phi_i tan yaw``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class View:
    """Orientation of one view."""

    axis: str
    reversed: bool = False
    turn_deg: float = 0.0

    @property
    def plane(self) -> float:
        base = {"pitch": 0.0, "yaw": 90.0}[self.axis]
        return math.radians(base + self.turn_deg + (180.0 if self.reversed else 0.0))


def parse_view(text: str, turn_deg: float = 0.0) -> View:
    """``pitch``, ``yaw``, or with a minus in front where positive bends clockwise in the image."""
    axis = text.removeprefix("-")
    if axis not in ("pitch", "yaw"):
        raise ValueError(f"{text} is not an axis; write pitch, yaw, -pitch or -yaw")
    return View(axis, text.startswith("-"), turn_deg)


def solve(
    views: Sequence[View], angles: npt.ArrayLike, deviations: npt.ArrayLike
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Angles of the views, rad, to (angles, standard deviations), each [pitch, yaw]; NaN for an axis that no view shows."""
    angles, deviations = np.asarray(angles, float), np.asarray(deviations, float)
    if len(views) == 1:
        axis, sign = int(views[0].axis == "yaw"), -1.0 if views[0].reversed else 1.0
        out = np.full((2, 2), np.nan)
        out[:, axis] = sign * angles[0], deviations[0]
        return out[0], out[1]
    planes = np.array([view.plane for view in views])
    inverse = np.linalg.inv(np.stack([np.cos(planes), np.sin(planes)], axis=1))
    seen = np.tan(angles)
    tangents = inverse @ seen
    spread = np.sqrt(inverse**2 @ (deviations * (1 + seen**2)) ** 2)
    return np.arctan(tangents), spread / (1 + tangents**2)

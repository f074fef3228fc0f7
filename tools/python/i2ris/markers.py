"""Bending angles from square markers: ``python -m i2ris.markers``.

One ArUco marker (DICT_4X4_250) per view sits on the tip, its upper and lower side along the snake. The direction of
these two sides in the image, relative to the straight pose, is the bending angle of that view, also while the snake
bends towards the camera; the other two sides would then be degrees off. No camera matrix is needed. (Angles out of the
plane, from a narrow lens, are too inaccurate.) The id is checked. A row without a detected marker has no angle: an old value is
never repeated.

Writes the columns of ``i2ris vision`` and publishes the same stream.
"""

import argparse
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from . import frames
from .joint import View, parse_view, solve

SMALLEST_PX = 28.0
"""Markers with shorter sides are rarely found in blurred images, and then rotated by degrees."""
GOOD = 0.5
MIN_AT_REST = 5
MAX_SPREAD_DEG = 0.5
SQUARE = np.array([-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j])
"""Corners of a marker that is not turned, in the order of OpenCV; the imaginary part runs down, as in images."""


@dataclass(frozen=True)
class Marker:
    """A marker in an image."""

    angle: float
    """Direction of its upper and lower side, rad, counter-clockwise as seen."""
    side_px: float
    """Its side."""
    quality: float
    """0 to 1, by its size and its distortion. 0.5 or more can be used."""
    corners: np.ndarray


def detector() -> cv2.aruco.ArucoDetector:
    """A detector that refines corners to a fraction of a pixel."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.cornerRefinementWinSize = 7
    parameters.relativeCornerRefinmentWinSize = 0.4
    parameters.cornerRefinementMaxIterations = 60
    parameters.cornerRefinementMinAccuracy = 0.005
    return cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250), parameters)


def find(image: np.ndarray, marker_id: int, using: cv2.aruco.ArucoDetector):
    """The marker of this id in a grey image, or the cause in words."""
    corners, ids, _ = using.detectMarkers(image)
    found = [] if ids is None else [int(i) for i in np.ravel(ids)]
    count = found.count(marker_id)
    if count == 0:
        return f"marker {marker_id} not seen" + (f" but {sorted(set(found))}" if found else "")
    if count > 1:
        return f"marker {marker_id} seen {count} times"
    marker = measure(image, corners[found.index(marker_id)].reshape(4, 2).astype(float))
    return marker if marker.quality >= GOOD else f"marker {marker_id} too small or distorted"


def measure(image: np.ndarray, corners: np.ndarray) -> Marker:
    """Turn and size of a marker whose corners are roughly known.

    The corners give size and shape; the angle comes from lines through the two sides along the snake, whose many edge
    points scatter far less than corners.
    """
    points = corners[:, 0] + 1j * corners[:, 1]
    points = points - points.mean()
    fit = np.vdot(SQUARE, points) / np.vdot(SQUARE, SQUARE)
    side = 2.0 * abs(fit)
    # A marker that is bent towards the camera is narrower: allowed up to 50 deg.
    off = np.sqrt(np.mean(np.abs(points - fit * SQUARE) ** 2)) / side
    quality = min(1.0, 0.5 * side / SMALLEST_PX) / (1.0 + (off / 0.3) ** 2)
    # Right-hand sides of the walk from corner to corner lie inside: the lower side is walked backwards.
    upper, lower = edge(image, corners[0], corners[1]), edge(image, corners[2], corners[3])
    if upper is None or lower is None:
        return Marker(0.0, float(side), 0.0, corners)
    back = np.exp(1j * lower) * -1.0
    return Marker(-float(np.angle(np.exp(1j * upper) + back)), float(side), float(quality), corners)


def edge(image: np.ndarray, start: np.ndarray, end: np.ndarray) -> float | None:
    """Direction from ``start`` to ``end``, rad, clockwise as seen, by a line through the edge between them.

    Each edge point is where a sharp step would leave the same area under the brightness across; blur does not move it.
    None without a dark side on the right and a bright one on the left.
    """
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    out = np.array([along[1], -along[0]])
    # The black frame and the white rim are a sixth of the side wide.
    reach = min(max(0.11 * length, 2.5), 8.0)
    positions = np.linspace(0.1, 0.9, max(8, int(0.8 * length))) * length
    slope = offset = 0.0
    for _ in range(3):
        middle = offset + slope * (positions - 0.5 * length)
        steps = np.linspace(-reach, reach, 8 * int(np.ceil(reach)) + 1)
        at = start + positions[:, None, None] * along + (middle[:, None, None] + steps[None, :, None]) * out
        values = cv2.remap(image, at.astype(np.float32), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        values = values.astype(float)
        tenth = max(2, len(steps) // 10)
        # The light may change along the edge: straight lines through the levels on both sides.
        inside, outside = (
            np.polyval(np.polyfit(positions, np.median(part, axis=1), 1), positions)[:, None]
            for part in (values[:, :tenth], values[:, -tenth:])
        )
        if np.min(outside - inside) < 25.0:
            return None
        # By trapezoids. The function of numpy has a different name before 2.0.
        height = (values - inside) / (outside - inside)
        area = (0.5 * (height[:, 1:] + height[:, :-1]) * np.diff(steps)).sum(axis=1)
        found = middle + reach - area
        keep = np.abs(found - np.median(found)) < 0.5 * reach
        for _ in range(2):
            if keep.sum() < 6:
                return None
            slope, offset = np.polyfit(positions[keep] - 0.5 * length, found[keep], 1)
            left = np.abs(found - offset - slope * (positions - 0.5 * length))
            keep = left < max(0.05, 3.0 * 1.4826 * np.median(left))
    # `out` is to the left of the walk as seen, which is counter-clockwise.
    return float(np.arctan2(along[1], along[0]) - np.arctan(slope))


def turn(angle: float, reference: float) -> float:
    """The difference of two angles, the short way round."""
    return float(np.angle(np.exp(1j * (angle - reference))))


@dataclass(frozen=True)
class Reference:
    """The straight pose of one view."""

    angle: float
    spread: float


def reference(name: str, angles) -> Reference:
    """The straight pose from some images; ValueError if they are too few or moved."""
    if len(angles) < MIN_AT_REST:
        raise ValueError(f"view {name}: the marker is seen in {len(angles)} images at rest, {MIN_AT_REST} are needed")
    mean = np.angle(np.mean(np.exp(1j * np.asarray(angles))))
    turns = np.array([turn(angle, mean) for angle in angles])
    middle = np.median(turns)
    half = len(turns) // 2
    drift = abs(np.median(turns[:half]) - np.median(turns[half:]))
    spread = max(1.4826 * np.median(np.abs(turns - middle)), drift)
    if np.degrees(spread) > MAX_SPREAD_DEG:
        raise ValueError(f"view {name}: the angle spreads by {np.degrees(spread):.2f} deg at rest; hold the snake still")
    return Reference(float(mean + middle), float(spread))


class Session:
    """Frames of one or two views in, rows out. The first frames give the reference; their rows are held until it is known."""

    def __init__(self, views: list[View], ids, names, rest_ns: int):
        self.views, self.ids, self.names, self.rest_ns = views, ids, names, rest_ns
        self.references: list[Reference] = []
        self.causes = Counter()
        self.good = self.rows = 0
        self.using = detector()
        self._checks = [frames.FrameCheck() for _ in views]
        self._same_camera = frames.SameCameraCheck()
        self._held = []

    def measure(self, view: int, frame):
        """(stamp, marker or cause) of a frame."""
        frame = self._checks[view].check(frame)
        same = len(self.views) == 2 and self._same_camera.is_same_camera(view, frame)
        cause = frames.SAME_CAMERA if same else frame.cause
        return frame.stamp_ns, cause or find(frame.image, self.ids[view], self.using)

    def take(self, group):
        """Takes one frame per view (None: no partner) and returns the finished rows."""
        seen = [None if frame is None else self.measure(view, frame) for view, frame in enumerate(group)]
        if self.references:
            return [self._row(seen)]
        stamp = _stamp(seen)
        if not self._held or stamp - _stamp(self._held[0]) < self.rest_ns:
            self._held.append(seen)
            return []
        return self.finish() + [self._row(seen)]

    def finish(self):
        """The rows that were held; at the end, or when the reference is complete."""
        if self.references:
            return []
        if not self._held:
            raise ValueError("no image arrived")
        for view, name in enumerate(self.names):
            looks = [seen[view][1] for seen in self._held if seen[view] is not None]
            self.references.append(reference(name, [look.angle for look in looks if isinstance(look, Marker)]))
        held, self._held = self._held, []
        return [self._row(seen) for seen in held]

    def _row(self, seen):
        self.rows += 1
        causes = []
        for view, look in enumerate(seen):
            if look is None and any(isinstance(s[1], Marker) for s in seen if s is not None):
                causes.append((self.names[view], frames.NO_PARTNER))
            elif look is not None and not isinstance(look[1], Marker):
                causes.append((self.names[view], look[1]))
        stamp = _stamp(seen)
        if causes:
            self.causes.update(causes)
            return {"stamp_ns": stamp, "cause": "; ".join(f"{name}: {cause}" for name, cause in causes)}
        self.good += 1
        turns = [turn(look[1].angle, self.references[view].angle) for view, look in enumerate(seen)]
        # Scatter of a single image, measured at rest; never better than the corners allow.
        spreads = [max(r.spread, 0.05 / look[1].side_px) for r, look in zip(self.references, seen)]
        angles, deviations = solve(self.views, turns, spreads)
        return {
            "stamp_ns": stamp,
            "angles": angles,
            "deviations": deviations,
            "quality": min(look[1].quality for look in seen),
        }


def _stamp(seen) -> int:
    stamps = [look[0] for look in seen if look is not None]
    return sum(stamps) // len(stamps)


class Table:
    """Writes rows in the columns of ``i2ris vision``; the tip position is empty, because markers do not show it."""

    def __init__(self, to, views):
        self._to = to
        self._axes = [axis for axis in (0, 1) if len(views) == 2 or ("pitch", "yaw")[axis] == views[0].axis]
        names = [("pitch", "yaw")[axis] for axis in self._axes]
        columns = ["t_s", *(f"{n}_deg" for n in names), *(f"{n}_std_deg" for n in names)]
        columns += ["quality", "tip_along_mm", *(f"tip_{n}_mm" for n in names), "cause"]
        print(",".join(columns), file=to)

    def row(self, row) -> None:
        cells = [f"{row['stamp_ns'] // 10**9}.{row['stamp_ns'] % 10**9:09}"]
        count = len(self._axes)
        if "angles" in row:
            cells += [f"{np.degrees(row['angles'][axis]):.5f}" for axis in self._axes]
            cells += [f"{np.degrees(row['deviations'][axis]):.5f}" for axis in self._axes]
            cells.append(f"{row['quality']:.3f}")
        else:
            cells += [""] * (2 * count + 1)
        cells += [""] * (1 + count)
        cells.append(row.get("cause", "").replace(",", " "))
        print(",".join(cells), file=self._to, flush=True)


def overlay(image: np.ndarray, look) -> np.ndarray:
    """The image with the detection drawn in it."""
    canvas = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    text, colour = (look, (80, 80, 255)) if isinstance(look, str) else (
        f"{np.degrees(look.angle):+.2f} deg  {look.side_px:.0f} px  Q {look.quality:.2f}", (80, 255, 80))
    if isinstance(look, Marker):
        cv2.polylines(canvas, [np.round(look.corners).astype(np.int32)], True, (0, 255, 255), 1, cv2.LINE_AA)
        cv2.circle(canvas, np.round(look.corners[0]).astype(int).tolist(), 5, (0, 0, 255), 2, cv2.LINE_AA)
    cv2.putText(canvas, text, (8, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.7, colour, 2, cv2.LINE_AA)
    return canvas


class LivePicture:
    """The newest frames side by side with their detection, as a file that any viewer shows."""

    PERIOD_S = 0.5

    def __init__(self, path, session: Session):
        self._path = path and Path(path)
        self._session = session
        self._next = 0.0

    def __call__(self, group) -> None:
        if self._path is None or time.monotonic() < self._next:
            return
        self._next = time.monotonic() + self.PERIOD_S
        ids = self._session.ids
        shown = [overlay(frame.image, find(frame.image, marker, self._session.using))
                 for frame, marker in zip(group, ids) if frame is not None and frame.image is not None]
        if shown:
            rows, columns = shown[0].shape[:2]
            _, data = cv2.imencode(self._path.suffix or ".jpg", np.hstack([cv2.resize(it, (columns, rows)) for it in shown]))
            # Replaced when complete: a viewer never sees a partial file.
            draft = self._path.with_name(self._path.name + ".draft")
            draft.write_bytes(data.tobytes())
            draft.replace(self._path)


def parser() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(prog="python -m i2ris.markers", description=__doc__.split("\n")[0])
    options.add_argument("sources", nargs="+", help="one or two: folders of images, or numbers of cameras")
    options.add_argument("--ids", type=int, nargs="+", default=[9, 14], help="marker of each view (default: 9 top, 14 side)")
    options.add_argument("--axes", nargs="+", default=["pitch", "yaw"],
                         help="axis that each view shows, with - in front where positive bends clockwise; "
                              "write --axes=-pitch for the first")
    options.add_argument("--turn-deg", type=float, nargs="+", default=[0.0, 0.0],
                         help="angle from the axis to what each view shows, from pitch towards yaw")
    options.add_argument("--fps", type=float, default=30.0, help="rate of numbered folders")
    options.add_argument("--rest-s", type=float, default=2.0, help="the images begin at rest for this long")
    options.add_argument("--pair-ms", type=float, default=12.0, help="stamps of a pair differ by no more")
    options.add_argument("--output", "-o", help="CSV file (default: standard output)")
    options.add_argument("--picture", help="write the newest frames with their detections to this image twice a second")
    options.add_argument("--publish", action="store_true", help="publish the angles as external/measured_jp; cameras only")
    options.add_argument("--domain", default="i2ris", help="domain of the controller")
    return options


def run(arguments) -> None:
    count = len(arguments.sources)
    if count > 2 or len(arguments.ids) < count or len(arguments.axes) < count or len(arguments.turn_deg) < count:
        raise ValueError("one or two sources of images; for each an id, an axis and a turn")
    views = [parse_view(axis, deg) for axis, deg in zip(arguments.axes[:count], arguments.turn_deg)]
    if count == 2 and abs(np.sin(views[0].plane - views[1].plane)) < 0.25:
        raise ValueError("both views show nearly the same axis")
    live = all(source.isdigit() for source in arguments.sources)
    if arguments.publish and not live:
        raise ValueError("--publish needs live images: numbers of cameras")
    if arguments.publish and count == 1 and views[0].axis == "yaw":
        raise ValueError("--publish needs pitch: external/measured_jp cannot carry yaw alone")
    publish = _publisher(arguments.domain) if arguments.publish else lambda row: None
    session = Session(views, arguments.ids, ["top", "side"][:count], int(arguments.rest_s * 1e9))
    to = open(arguments.output, "w") if arguments.output else sys.stdout
    table = Table(to, views)

    def put(rows):
        for row in rows:
            table.row(row)
            publish(row)

    clocks, picture = [], LivePicture(arguments.picture, session)
    try:
        for number, group in enumerate(_frames(arguments, live, clocks)):
            if number == 0:
                _print_clocks(session.names, clocks)
            put(session.take(group))
            picture(group)
        put(session.finish())
    finally:
        _report(session, clocks)
    if session.good == 0:
        raise ValueError("no angle could be measured")


def _frames(arguments, live: bool, clocks):
    if live:
        return frames.cameras(arguments.sources, clocks)
    folders = [frames.folder(source, arguments.fps) for source in arguments.sources]
    if len(folders) == 1:
        return ([frame] for frame in folders[0])
    return frames.pairs(*folders, int(arguments.pair_ms * 1e6))


def _publisher(domain: str):
    from .external import ExternalPublisher, NoController

    publisher = ExternalPublisher(domain)

    def publish(row):
        try:
            if "angles" in row:
                known = ~np.isnan(row["angles"])
                publisher.publish(row["stamp_ns"], row["angles"][known], row["deviations"][known], row["quality"])
            else:
                publisher.publish_nothing(row["stamp_ns"])
        except NoController:
            pass  # It may start later.

    return publish


def _print_clocks(names, clocks) -> None:
    for name, clock in zip(names, clocks):
        of_driver = "stamps are from the driver"
        words = of_driver if clock.cause is None else f"{clock.cause}: {frames.BY_ARRIVAL}"
        print(f"view {name}: {words}", file=sys.stderr)


def _report(session: Session, clocks=()) -> None:
    for name, clock in zip(session.names, clocks):
        lost = f"{clock.lost} frames lost" if clock.cause is None else "lost frames are unknown"
        print(f"view {name}: {lost}", file=sys.stderr)
    for name, rest in zip(session.names, session.references):
        print(f"view {name}: rest at {np.degrees(rest.angle):+.3f} deg, spread {np.degrees(rest.spread):.3f} deg",
              file=sys.stderr)
    print(f"{session.good} of {session.rows} rows have angles", file=sys.stderr)
    for (name, cause), count in sorted(session.causes.items()):
        print(f"{count:7}  {name}: {cause}", file=sys.stderr)


def main() -> int:
    try:
        run(parser().parse_args())
    except KeyboardInterrupt:
        return 130
    except (ValueError, OSError, RuntimeError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Data sets for training policies, by LeRobot's own writer: v2.1 with LeRobot 0.3, v3.0 with 0.4 and newer.

    i2ris record export STUDY --output tables --pictures
    python -m i2ris.lerobot tables --output set --repo-id lab/reach

An episode is a trial, or the part of one between two gaps. A row is at the exposure of its picture, the state
interpolated to it; without pictures rows come ``--rate-hz`` times a second. LeRobot takes index / fps for the time of a
row: ``observation.meta.jitter_s`` is the error of that. Splits are outcomes.

Only writing needs LeRobot (``pip install lerobot``).
"""

from __future__ import annotations

import argparse
import csv
import inspect
import json
import math
import shutil
import sys
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean, median
from typing import Any

from .payload import ExternalPosition, JointState, TeleopMsg

#: File in every export with its sources.
MADE_OF = "i2ris-export.json"
#: Samples further apart are a gap, s.
GAP_S = 0.11
#: Stamps that decrease by more are from a different clock, s.
JUMP_S = 1.0
#: Maximum number of missing pictures in a row that are replaced by the next ones.
MISSING_PICTURES = 4.0
#: Relative tolerance of equal picture rates.
SAME_RATE = 0.02
#: Outcomes in the order of their splits.
SPLITS = {None: "train", "success": "train", "recovery": "recovery", "failure": "failure"}

#: Columns of numbers, with the names of their entries.
NUMBERS = {
    "observation.state": [
        "pitch_rad", "yaw_rad", "pitch_deviation_rad", "yaw_deviation_rad", "memory_known", "motor_0_counts", "motor_1_counts",
    ],
    "action": ["pitch_rad", "yaw_rad"],
    "action.tip_motion": ["right_m", "up_m"],
    "ground_truth.camera": ["pitch_rad", "yaw_rad", "valid"],
    "observation.meta.fixture_limits": ["fixture_limits"],
    "observation.meta.jitter_s": ["jitter_s"],
}  # fmt: skip
TEXTS = ["observation.meta.model_id", "observation.meta.fixtures", "observation.meta.clutch"]
STAMP = "observation.meta.stamp_ns"


class DatasetError(Exception):
    """Reason why no data set can be written."""


@dataclass
class Series:
    """Samples over time, with increasing times."""

    times: list[float] = field(default_factory=list)
    values: list[Any] = field(default_factory=list)

    def add(self, time: float, value: Any) -> None:
        self.times.append(time)
        self.values.append(value)

    def between(self, time: float) -> list[float] | None:
        """Numbers, interpolated linearly; ``None`` outside and in a gap."""
        after = bisect_left(self.times, time)
        if after < len(self.times) and self.times[after] == time:
            return list(self.values[after])
        if after in (0, len(self.times)) or self.times[after] - self.times[after - 1] > GAP_S:
            return None
        begin, end = self.times[after - 1], self.times[after]
        share = (time - begin) / (end - begin)
        return [a + share * (b - a) for a, b in zip(self.values[after - 1], self.values[after])]

    def last(self, time: float, default: Any) -> Any:
        """Last value before a time."""
        after = bisect_right(self.times, time)
        return self.values[after - 1] if after else default


def table(folder: Path, name: str) -> Iterator[dict[str, Any]]:
    """The rows of a table in an export; none if the recording has none."""
    if (text := folder / f"{name}.csv").exists():
        with text.open(newline="", encoding="utf-8") as file:
            yield from csv.DictReader(file)


def stamped(folder: Path, name: str) -> Iterator[tuple[float, dict[str, Any]]]:
    """The rows of a table with their times, without late ones."""
    newest = -math.inf
    for row in table(folder, name):
        time = float(row["t_s"])
        if time < newest - JUMP_S:
            raise DatasetError(
                f"{folder.name}: stamps of {name} go back by {newest - time:.1f} s: the clock jumped; omit this recording"
            )
        if time > newest:
            newest = time
            yield time, row


def rad(row: dict[str, Any], *names: str) -> list[float]:
    return [math.radians(float(row[f"{name}_deg"])) for name in names]


def tip_m(pitch: float, yaw: float) -> tuple[float, float]:
    """Distance of the tip along yaw and along pitch of the base: twelve rolling joints are two hinges each, 2 R apart."""
    radius, link, share = 0.75e-3, 0.1495e-3, 0.5 / 6
    # The chain from its end: a point that every hinge turns and every link moves along z.
    x, y, z = 0.0, 0.0, link - radius
    for joint in range(12):
        angle, along = share * (yaw if joint % 2 == 0 else pitch), link - 2.0 * radius
        for hinge in range(2):
            sin, cos = math.sin(angle), math.cos(angle)
            if joint % 2 == 0:
                x, z = cos * x + sin * z, cos * z - sin * x
            else:
                y, z = cos * y + sin * z, cos * z - sin * y
            z += 2.0 * radius if hinge == 0 else (along if joint < 11 else -radius)
    return x, y


@dataclass
class Trial:
    """The tables of a recording as functions of time, s."""

    name: str
    folder: Path
    about: dict[str, Any]
    estimate: Series = field(default_factory=Series)
    memory: Series = field(default_factory=Series)
    model: Series = field(default_factory=Series)
    goal: Series = field(default_factory=Series)
    limited: Series = field(default_factory=Series)
    counts: Series = field(default_factory=Series)
    camera: Series = field(default_factory=Series)
    fixtures: Series = field(default_factory=Series)
    clutch: Series = field(default_factory=Series)
    #: Directions of +pitch and +yaw in the picture, right and up, if a hand reported them.
    view: list[list[float]] = field(default_factory=lambda: [[0.0, 1.0], [1.0, 0.0]])
    #: Monotonic stamp of t = 0, ns.
    begin_ns: int = 0
    #: Times and files of each view.
    pictures: dict[str, tuple[list[float], list[Path]]] = field(default_factory=dict)

    @classmethod
    def read(cls, name: str, folder: Path, about: dict[str, Any]) -> Trial:
        trial, late_s = cls(name, folder, about), float(about.get("camera_late_s") or 0.0)
        for time, row in stamped(folder, "measured_js"):
            if "pitch_deg" not in row or "yaw_deg" not in row:
                raise DatasetError(f"{name}: has no pitch and yaw")
            if int(row["flags"]) & JointState.VALID:
                trial.begin_ns = trial.begin_ns or int(row["stamp_ns"]) - round(1e9 * time)
                trial.estimate.add(time, rad(row, "pitch", "yaw", "pitch_deviation", "yaw_deviation"))
                trial.memory.add(time, float(bool(int(row["flags"]) & JointState.MEMORY_KNOWN)))
                trial.model.add(time, row["model_id"])
        for time, row in stamped(folder, "goal_js"):
            if int(row["flags"]) & JointState.VALID:
                trial.goal.add(time, rad(row, "pitch", "yaw"))
                trial.limited.add(time, float(bool(int(row["flags"]) & JointState.FIXTURE)))
        for time, row in stamped(folder, "actuators_measured_js"):
            trial.counts.add(time, [float(row["measured_counts_0"]), float(row["measured_counts_1"])])
        for time, row in stamped(folder, "external_measured_jp"):
            if int(row["flags"]) & ExternalPosition.VALID and int(row["count"]) == 2:
                trial.camera.add(time - late_s, rad(row, "pitch", "yaw"))
        for time, row in stamped(folder, "virtual_fixtures"):
            active = int(row["active"])
            trial.fixtures.add(time, ",".join(row[f"name_{at}"] for at in range(8) if active >> at & 1))
        for time, row in stamped(folder, "teleop"):
            trial.clutch.add(time, "open" if int(row["flags"]) & TeleopMsg.OPEN else "closed")
            trial.view = [[float(row["view_0"]), float(row["view_1"])], [float(row["view_2"]), float(row["view_3"])]]
        for view in sorted((folder / "pictures").glob("*")):
            files = sorted(view.glob("*.jpg"), key=lambda file: float(file.stem))
            trial.pictures[view.name] = ([float(file.stem) - late_s for file in files], files)
        return trial

    def state(self, time: float) -> dict[str, Any] | None:
        """All columns but those of pictures and the motion to the next row; ``None`` in a gap."""
        estimate, goal, counts = (it.between(time) for it in (self.estimate, self.goal, self.counts))
        if estimate is None or goal is None or counts is None:
            return None
        seen = self.camera.between(time)
        right, up = tip_m(*goal)
        return {
            "observation.state": [*estimate, self.memory.last(time, 0.0), *counts],
            "action": goal,
            "action.tip_motion": [a * up + b * right for a, b in zip(*self.view)],
            "ground_truth.camera": [*seen, 1.0] if seen else [0.0, 0.0, 0.0],
            "observation.meta.fixture_limits": [self.limited.last(time, 0.0)],
            "observation.meta.model_id": self.model.last(time, ""),
            "observation.meta.fixtures": self.fixtures.last(time, ""),
            "observation.meta.clutch": self.clutch.last(time, "none"),
            STAMP: self.begin_ns + round(1e9 * time),
        }

    def picture_rate_hz(self) -> float | None:
        """Picture rate of the first view, without gaps."""
        times = next(iter(self.pictures.values()), ([], []))[0]
        steps = [after - before for before, after in zip(times, times[1:])]
        if not steps:
            return None
        usual = median(steps)
        return 1.0 / fmean(step for step in steps if 0.5 < step / usual < 1.5)

    def episodes(self, fps: float, views: Sequence[str]) -> list[list[dict[str, Any]]]:
        """Rows at equal intervals while there is a state; a gap begins a new episode."""
        if not self.estimate.times:
            return []
        period = 1.0 / fps
        if views:
            times, widest = self.pictures[views[0]][0], MISSING_PICTURES * period
        else:
            begin, end = self.estimate.times[0], self.estimate.times[-1]
            times, widest = [begin + row * period for row in range(int((end - begin) * fps + 1e-6) + 1)], 1.5 * period
        runs: list[list[float]] = []
        for time in times:
            if self.state(time) is None:
                continue
            if runs and time - runs[-1][-1] < widest:
                runs[-1].append(time)
            else:
                runs.append([time])
        # One row shows no motion.
        return [self._rows(run, period, views) for run in runs if len(run) > 1]

    def _rows(self, run: list[float], period: float, views: Sequence[str]) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] = []
        for number in range(round((run[-1] - run[0]) / period) + 1):
            due = run[0] + number * period
            time = run[nearest(run, due)]
            row = self.state(time)
            assert row is not None, "a run has states only"
            row["observation.meta.jitter_s"] = [time - due]
            for view in views:
                stamps, files = self.pictures[view]
                row[f"observation.images.{view}"] = files[nearest(stamps, time)]
            rows.append(row)
        places = [row["action.tip_motion"] for row in rows]
        for row, here, there in zip(rows, places, [*places[1:], places[-1]]):
            row["action.tip_motion"] = [after - before for before, after in zip(here, there)]
        return rows


def nearest(times: Sequence[float], time: float) -> int:
    after = min(bisect_left(times, time), len(times) - 1)
    before = max(after - 1, 0)
    return before if abs(times[before] - time) <= abs(times[after] - time) else after


@dataclass
class Plan:
    """Content of a data set."""

    fps: int
    views: list[str]
    #: Trial, number of its part, rows; in the order of the splits.
    episodes: list[tuple[Trial, int, list[dict[str, Any]]]]
    left_out: list[dict[str, str]]

    def splits(self) -> dict[str, str]:
        names = [SPLITS[trial.about.get("outcome")] for trial, _, _ in self.episodes]
        return {name: f"{names.index(name)}:{names.index(name) + names.count(name)}" for name in dict.fromkeys(names)}


def plan(export: Path, rate_hz: int = 30, without_pictures: bool = False) -> Plan:
    """Reads an export of ``i2ris record export``. Raises ``DatasetError``."""
    if not (export / MADE_OF).exists():
        raise DatasetError(f"{export} is not a folder of `i2ris record export` (it has no {MADE_OF})")
    made_of = json.loads((export / MADE_OF).read_text(encoding="utf-8"))
    found = Plan(0, [], [], made_of.get("left_out", []))
    order = list(dict.fromkeys(SPLITS.values()))
    for about in sorted(made_of["recordings"], key=lambda it: order.index(SPLITS[it.get("outcome")])):
        trial = Trial.read(about["name"], export / about["folder"], about)
        rate = None if without_pictures else trial.picture_rate_hz()
        views = [] if rate is None else list(trial.pictures)
        fps = round(rate) if rate else rate_hz
        if found.fps == 0:
            found.fps, found.views = fps, views
        elif views != found.views or (fps != found.fps and abs((rate or fps) / found.fps - 1.0) > SAME_RATE):
            raise DatasetError(
                f"{trial.name} has {words(views, fps)}, others have {words(found.views, found.fps)}: make separate data sets, "
                "or add --without-pictures"
            )
        episodes = trial.episodes(found.fps, views)
        if not episodes:
            found.left_out.append({"name": trial.name, "why": "no two rows with estimate, goal and counts"})
        found.episodes += [(trial, part, rows) for part, rows in enumerate(episodes, 1)]
    if not found.episodes:
        raise DatasetError("no recording has estimate, goal and counts at the same time; did the controller have a model?")
    return found


def words(views: Sequence[str], fps: int) -> str:
    return f"pictures of {', '.join(views)} at {fps} Hz" if views else "no pictures"


def features(found: Plan, size: Callable[[Path], tuple[int, int]], images: bool) -> dict[str, dict[str, Any]]:
    """The columns as LeRobot describes them; ``size`` returns width and height of a picture."""
    numbers = {name: {"dtype": "float32", "shape": (len(names),), "names": names} for name, names in NUMBERS.items()}
    texts = {name: {"dtype": "string", "shape": (1,), "names": None} for name in TEXTS}
    pictures = {}
    for view in (f"observation.images.{view}" for view in found.views):
        width, height = size(found.episodes[0][2][0][view])
        shape, names = (height, width, 3), ["height", "width", "channels"]
        pictures[view] = {"dtype": "image" if images else "video", "shape": shape, "names": names}
    return {**numbers, **texts, STAMP: {"dtype": "int64", "shape": (1,), "names": ["stamp_ns"]}, **pictures}


def write(found: Plan, output: Path, repo_id: str, images: bool = False) -> str:
    """Writes a data set into a new folder; returns its version. Raises ``DatasetError``."""
    try:
        import numpy as np
        from lerobot.datasets.lerobot_dataset import LeRobotDataset
        from PIL import Image
    except ImportError as error:
        raise DatasetError(
            f"needs LeRobot ({error}): pip install lerobot; 0.3 writes data sets of v2.1, 0.4 and newer those of v3.0"
        ) from error

    def picture(file: Path) -> Any:
        with Image.open(file) as image:
            return np.array(image.convert("RGB"))

    def size(file: Path) -> tuple[int, int]:
        with Image.open(file) as image:
            return image.size

    if output.exists():
        raise DatasetError(f"--output {output}: exists; name another folder")
    columns = features(found, size, images)
    dataset = LeRobotDataset.create(repo_id, found.fps, root=output, robot_type="i2ris", features=columns, use_videos=not images)
    # Until 0.3 the task is an argument, from 0.4 on a part of the frame.
    takes_task = "task" in inspect.signature(dataset.add_frame).parameters
    for trial, _, rows in found.episodes:
        task = f"{trial.about.get('task') or 'unknown'} ({trial.about['condition']})" if trial.about.get("condition") else "unknown"
        for row in rows:
            frame = {name: np.array(row[name], dtype=np.float32) for name in NUMBERS}
            frame |= {name: row[name] for name in TEXTS} | {STAMP: np.array([row[STAMP]], dtype=np.int64)}
            frame |= {view: picture(row[view]) for view in columns if view.startswith("observation.images.")}
            dataset.add_frame(frame, task) if takes_task else dataset.add_frame({**frame, "task": task})
        dataset.save_episode()
    if hasattr(dataset, "finalize"):
        dataset.finalize()
    info = output / "meta" / "info.json"
    described = json.loads(info.read_text(encoding="utf-8"))
    described["splits"] = found.splits()
    info.write_text(json.dumps(described, indent=4), encoding="utf-8")
    made_of = {
        "software": "i2ris.lerobot",
        "episodes": [
            {"trial": trial.name, "part": part, "rows": len(rows), "outcome": trial.about.get("outcome"),
             "participant": trial.about.get("participant"),
             "jitter_s": max(abs(row["observation.meta.jitter_s"][0]) for row in rows)}
            for trial, part, rows in found.episodes
        ],
        "left_out": found.left_out,
    }  # fmt: skip
    (output / MADE_OF).write_text(json.dumps(made_of, indent=2), encoding="utf-8")
    return str(described["codebase_version"])


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m i2ris.lerobot", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("export", type=Path, help="folder of `i2ris record export`")
    parser.add_argument("--output", type=Path, required=True, help="folder of the data set; must not exist yet")
    parser.add_argument("--repo-id", default="i2ris/trials", help="its name on the hub (default: %(default)s)")
    parser.add_argument("--rate-hz", type=int, default=30, help="rows per second without pictures (default: %(default)s)")
    parser.add_argument("--without-pictures", action="store_true", help="omit pictures")
    parser.add_argument("--images", action="store_true", help="store single pictures instead of video")
    given = parser.parse_args(arguments)
    is_new = not given.output.exists()
    try:
        found = plan(given.export, given.rate_hz, given.without_pictures)
        version = write(found, given.output, given.repo_id, given.images)
    except BaseException as error:
        # Complete or absent.
        if is_new:
            shutil.rmtree(given.output, ignore_errors=True)
        if not isinstance(error, DatasetError):
            raise
        print(f"error: {error}", file=sys.stderr)
        return 1
    for left in found.left_out:
        print(f"left out: {left['name']}: {left['why']}", file=sys.stderr)
    rows = sum(len(rows) for _, _, rows in found.episodes)
    print(f"{version}: {len(found.episodes)} episodes, {rows} rows at {found.fps} Hz: {given.output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

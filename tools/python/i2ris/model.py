"""Calibrate, predict, invert: the hysteresis models of i2ris in Python, with the code of the command line.

    from i2ris.model import Calibration, Model

    model = Calibration(family="best").fit(t_s, counts, angles_deg).model_
    model.save("snake.json")              # byte for byte the file of `i2ris calibrate fit`
    angles = Model.load("snake.json").predict(counts)
    counts = model.invert(angles_deg, history=counts)

Times are seconds, angles are degrees, counts are encoder counts. A row of angles that is missing (NaN, None) was not
measured; it still belongs to the path of the motors. The columns of a frame are found by their names. Invalid input
raises :class:`ModelError` (or ``ValueError``) with a sentence; suspicious input gives a warning.
Networks: :func:`from_torch`, :func:`from_onnx`.
"""

from __future__ import annotations

import json
import re
import tempfile
import tomllib
import warnings
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

import i2ris_native as _native
from i2ris_native import ModelError
from i2ris.convert import from_onnx, from_torch

__all__ = ["Calibration", "Model", "ModelError", "Tracker", "from_onnx", "from_torch", "steps_by_travel", "write_recording"]

Floats = NDArray[np.float64]
Progress = Callable[[str, float], None]


def _in_order(name: str, values: Any) -> ArrayLike:
    """The columns of a frame in the order of motors or of pitch and yaw, by their names."""
    is_frame, is_angle = hasattr(values, "columns"), name == "angles_deg"
    names = [str(each) for each in (values.columns if is_frame else [getattr(values, "name", "")])]
    for each in names:
        unit = re.search(r"(?:^|[^a-z])(rad|ms|us|ns)[^a-z]*$", each.lower())
        if unit and (unit[1] == "rad") == is_angle:
            wanted = "degrees" if is_angle else "seconds"
            raise ValueError(f"{name}: `{each}` says that it is in {unit[1]}; pass {wanted}")
    if not is_frame or len(names) != 2:
        return np.asarray(values) if is_frame else values

    def place(column: str) -> float:
        if is_angle:
            return next((at for at, axis in enumerate(("pitch", "yaw")) if axis in column.lower()), np.nan)
        number = re.search(r"\d+", column)
        return float(number[0]) if number else np.nan

    places = [place(column) for column in names]
    if places[0] == places[1] or not np.isfinite(places).all():
        wanted = "pitch_deg, yaw_deg" if is_angle else "q0_counts, q1_counts"
        shown = "`, `".join(names)
        raise ValueError(f"{name}: the meaning of `{shown}` is unclear; call the columns {wanted}, or pass numbers alone")
    return np.asarray(values)[:, np.argsort(places)]


def _in_python_terms(sentence: str, arrays: Path | None = None) -> str:
    """A sentence of the command line, with the options of Python, and rows instead of lines of a file."""
    if arrays is not None:
        sentence = sentence.replace(str(arrays), "of arrays")
        sentence = re.sub(r"\bline (\d+)", lambda line: f"row {int(line[1]) - 2}", sentence)
        sentence = re.sub(r"; call it `t_.*", "; pass seconds", sentence)
    return re.sub(r"--([a-z][a-z-]*)", lambda option: option[1].replace("-", "_"), sentence)


def _table(name: str, values: ArrayLike, columns: tuple[int, ...], missing: bool = False) -> Floats:
    """A table of numbers, or an exception that names it."""
    values = _in_order(name, values)
    try:
        table = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}: must be numbers in rows of one length ({error})") from None
    if table.ndim == 1 and 1 in columns:
        table = table[:, np.newaxis]
    if table.ndim != 2 or table.shape[1] not in columns:
        wanted = " or ".join(map(str, columns))
        raise ValueError(f"{name}: must be rows of {wanted} numbers, and have the shape {table.shape}")
    wrong = np.isinf(table) if missing else ~np.isfinite(table)
    if wrong.any():
        row = int(np.argwhere(wrong)[0, 0])
        raise ValueError(f"{name}: row {row} has a number that is missing or not finite")
    return np.ascontiguousarray(table)


def _recording(t_s: ArrayLike | None, counts: ArrayLike, angles: ArrayLike) -> tuple[Floats | None, Floats, Floats]:
    # Zero has one sign.
    counts_table = _table("counts", counts, (1, 2)) + 0.0
    angles_table = _table("angles_deg", angles, (1, 2), missing=True)
    time = None
    if t_s is not None:
        time = np.ascontiguousarray(_table("t_s", t_s, (1,))[:, 0])
    for name, length in (("angles_deg", len(angles_table)), ("t_s", len(counts_table if time is None else time))):
        if length != len(counts_table):
            raise ValueError(f"{name}: has {length} rows, and counts has {len(counts_table)}")
    return time, counts_table, angles_table


def write_recording(
    path: str | Path, t_s: ArrayLike | None, counts: ArrayLike, angles_deg: ArrayLike, names: Sequence[str] = ("pitch", "yaw")
) -> None:
    """Writes a recording like ``i2ris calibrate collect``: numbers are restored bit for bit."""
    time, counts_table, angles_table = _recording(t_s, counts, angles_deg)
    _native.write_recording(Path(path), time, counts_table, angles_table, list(names[: angles_table.shape[1]]))


def steps_by_travel(counts: ArrayLike, step_counts: float) -> tuple[Floats, NDArray[np.int64]]:
    """Counts at which a network steps along a path of the motors, and number of steps taken at each row.

    Train like the controller: a row ``k`` is one more step, to ``counts[k]``, on the hidden state after the first
    ``taken[k]`` steps; that step is then forgotten.
    """
    if not step_counts > 0:
        raise ValueError(f"step_counts: must be above 0, and is {step_counts}")
    return _native.steps_by_travel(_table("counts", counts, (1, 2)), float(step_counts))


def _print_progress(name: str, share: float) -> None:
    print(f"\r{100 * share:3.0f} %  {name:<40}", end="" if share < 1 else "\n", flush=True)


class Model:
    """A checked model, as the controller loads it."""

    def __init__(self, native: _native.Model) -> None:
        self._native = native

    @classmethod
    def load(cls, path: str | Path) -> Model:
        """Reads and examines a model file."""
        return cls(_native.Model.load(Path(path)))

    @classmethod
    def from_network(
        cls, network: str | Path | dict[str, Any], recording: str | Path, robot_id: str = "i2ris", hold_out: str = "blocks"
    ) -> Model:
        """A model from a network (:func:`from_torch`, :func:`from_onnx`) and a recording of the robot: the recording gives
        hull, deviation and examination. Hold out data that the network has not seen."""
        with tempfile.TemporaryDirectory() as folder:
            if isinstance(network, dict):
                path = Path(folder, "network.json")
                path.write_text(json.dumps(network))
                network = path
            try:
                return cls(_native.import_network(Path(network), Path(recording), robot_id, hold_out))
            except ModelError as error:
                raise ModelError(_in_python_terms(str(error).replace(folder + "/", ""))) from None

    def save(self, path: str | Path) -> None:
        """Writes the model file, all at once."""
        self._native.save(Path(path))

    @property
    def id(self) -> str:
        """The identity: SHA-256 of the file in canonical form."""
        return self._native.id

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs."""
        return self._native.outputs

    def to_dict(self) -> dict[str, Any]:
        """The contents of the file."""
        return json.loads(self._native.json())

    @overload
    def predict(self, counts: ArrayLike, return_std: Literal[False] = False, t_s: ArrayLike | None = None) -> Floats: ...
    @overload
    def predict(
        self, counts: ArrayLike, return_std: Literal[True], t_s: ArrayLike | None = None
    ) -> tuple[Floats, Floats]: ...
    def predict(
        self, counts: ArrayLike, return_std: bool = False, t_s: ArrayLike | None = None
    ) -> Floats | tuple[Floats, Floats]:
        """Angles along a path of the motors, deg; with ``return_std`` also their standard deviations, as for regressors
        of scikit-learn. The memory begins with the first row. A snake that creeps needs the times of all rows."""
        table = _table("counts", counts, (self._native.motors,))
        spans = []
        if t_s is not None:
            times = _table("t_s", t_s, (1,))[:, 0]
            if len(times) != len(table):
                raise ValueError(f"t_s: has {len(times)} rows, and counts has {len(table)}")
            spans = [np.diff(times, prepend=times[:1]).tolist()]
        elif self._creeps:
            warnings.warn("t_s: this snake creeps; without times its angles are those of a snake that moves at once", stacklevel=2)
        angles, deviations = self._native.predict(table, *spans)
        return (angles, deviations) if return_std else angles

    @cached_property
    def _creeps(self) -> bool:
        return any(self.to_dict()["family"].get("balance", {}).get("creep", []))

    def invert(self, angles_deg: ArrayLike, history: ArrayLike | None = None) -> Floats:
        """Whole counts that bring the angles along a trajectory, after a path of the motors. For the limits and filters of
        the controller use ``i2ris model invert``."""
        past = np.empty((0, self._native.motors)) if history is None else history
        goal = _table("angles_deg", angles_deg, (len(self.outputs),))
        return self._native.invert(goal, _table("history", past, (self._native.motors,)))

    def tracker(self, history: ArrayLike | None = None) -> _native.Tracker:
        """The model with a memory that advances tick by tick."""
        past = np.empty((0, self._native.motors)) if history is None else history
        return self._native.tracker(_table("history", past, (self._native.motors,)))

    def score(self, counts: ArrayLike, angles_deg: ArrayLike, t_s: ArrayLike | None = None) -> float:
        """R2 of the angles, as in scikit-learn: the mean over the outputs. Rows without angles are ignored."""
        truth = _table("angles_deg", angles_deg, (len(self.outputs),), missing=True)
        found = self.predict(counts, t_s=t_s)
        if len(found) != len(truth):
            raise ValueError(f"angles_deg: has {len(truth)} rows, and counts has {len(found)}")
        seen = np.isfinite(truth).all(axis=1)
        errors = ((truth - found)[seen] ** 2).sum(axis=0)
        spread = ((truth[seen] - truth[seen].mean(axis=0)) ** 2).sum(axis=0)
        return float(np.mean(1 - errors / spread))

    def examine(self) -> dict[str, float]:
        """Examination by the controller: the share of the motion that the inverse misses, and its travel divided by that
        of the path."""
        error, travel = self._native.examine()
        return {"error": error, "travel": travel}

    def __getstate__(self) -> dict[str, Any]:
        return {"_native": self._native}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._native = state["_native"]

    def __repr__(self) -> str:
        return f"<i2ris model {self.to_dict()['family']['kind']} {self.id[:12]}>"


Tracker = _native.Tracker


class Calibration:
    """Fits a model to a recording: the options of ``i2ris calibrate fit``, in the style of scikit-learn.

    After :meth:`fit`: ``model_`` (:class:`Model`) and ``report_`` (what was found, as a dictionary).
    """

    def __init__(
        self,
        family: str = "best",
        *,
        components: int | None = None,
        max_components: int = 12,
        restarts: int = 60,
        seed: int = 1,
        hold_out: str = "blocks",
        keep_spikes: bool = False,
        force: bool = False,
        robot_id: str | None = None,
        remove_latency: bool = True,
        progress: bool | Progress = False,
    ) -> None:
        self.family = family
        self.components = components
        self.max_components = max_components
        self.restarts = restarts
        self.seed = seed
        self.hold_out = hold_out
        self.keep_spikes = keep_spikes
        self.force = force
        self.robot_id = robot_id
        self.remove_latency = remove_latency
        self.progress = progress

    _NAMES = (
        "family components max_components restarts seed hold_out keep_spikes force robot_id remove_latency progress"
    ).split()

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """All options by name."""
        return {name: getattr(self, name) for name in self._NAMES}

    def set_params(self, **params: Any) -> Calibration:
        """Sets options by name."""
        for name, value in params.items():
            if name not in self._NAMES:
                raise ValueError(f"`{name}` is not an option of a calibration; options: {', '.join(self._NAMES)}")
            setattr(self, name, value)
        return self

    def fit(self, t_s: ArrayLike | str | Path | None, counts: ArrayLike | None = None, angles_deg: ArrayLike | None = None) -> Calibration:
        """Fits to arrays, or to a recording by its path alone. Ctrl-C stops it.

        ``t_s`` may be None without times; ``counts`` are n rows of 1 or 2 motors, ``angles_deg`` n rows of 1 or 2 angles.
        """
        if counts is None or angles_deg is None:
            if not isinstance(t_s, str | Path):
                raise TypeError("fit: give time, counts and angles, or the path of a recording alone")
            return self._fit(Path(t_s))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "recording.csv")
            write_recording(path, t_s, counts, angles_deg)  # type: ignore[arg-type]
            return self._fit(path, path)

    def _fit(self, path: Path, arrays: Path | None = None) -> Calibration:
        metadata: dict[str, Any] = {}
        if path.with_suffix(".toml").exists():
            metadata = tomllib.loads(path.with_suffix(".toml").read_text())
        started = metadata.get("started_unix_s")
        at = None if started is None else datetime.fromtimestamp(started, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        progress = _print_progress if self.progress is True else self.progress or None
        try:
            native, report, text, html = _native.fit(
                path,
                family=self.family,
                components=self.components,
                max_components=self.max_components,
                restarts=self.restarts,
                seed=self.seed,
                hold_out=self.hold_out,
                keep_spikes=self.keep_spikes,
                force=self.force,
                robot_id=self.robot_id or metadata.get("robot_id", "i2ris"),
                recorded_at=at,
                latency=self.remove_latency,
                progress=progress,
            )
        except ModelError as error:
            raise ModelError(_in_python_terms(str(error), arrays)) from None
        self.model_, self.report_ = Model(native), json.loads(report)
        self._text, self._html = _in_python_terms(text, arrays), html
        for warning in self.report_["warnings"]:
            warnings.warn(_in_python_terms(warning, arrays), stacklevel=3)
        return self

    def _fitted(self) -> Model:
        if not hasattr(self, "model_"):
            raise ModelError("not fitted yet: call fit first")
        return self.model_

    @overload
    def predict(self, counts: ArrayLike, return_std: Literal[False] = False, t_s: ArrayLike | None = None) -> Floats: ...
    @overload
    def predict(
        self, counts: ArrayLike, return_std: Literal[True], t_s: ArrayLike | None = None
    ) -> tuple[Floats, Floats]: ...
    def predict(
        self, counts: ArrayLike, return_std: bool = False, t_s: ArrayLike | None = None
    ) -> Floats | tuple[Floats, Floats]:
        """See :meth:`Model.predict`."""
        model = self._fitted()
        return model.predict(counts, return_std=True, t_s=t_s) if return_std else model.predict(counts, t_s=t_s)

    def invert(self, angles_deg: ArrayLike, history: ArrayLike | None = None) -> Floats:
        """See :meth:`Model.invert`."""
        return self._fitted().invert(angles_deg, history)

    def score(self, counts: ArrayLike, angles_deg: ArrayLike, t_s: ArrayLike | None = None) -> float:
        """See :meth:`Model.score`."""
        return self._fitted().score(counts, angles_deg, t_s)

    def save(self, path: str | Path) -> None:
        """See :meth:`Model.save`."""
        self._fitted().save(path)

    def report(self, path: str | Path | None = None) -> str:
        """The report as text; also as one HTML file if a path is given."""
        self._fitted()
        if path is not None:
            Path(path).write_text(self._html)
        return self._text


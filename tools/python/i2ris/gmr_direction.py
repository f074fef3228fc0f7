"""A baseline of the benchmark: Gaussian mixture regression by direction of travel, the published method for robots of this
kind (fit the two branches of the hysteresis, and select one by the sign of the velocity).

The direction of every motor, 1 upwards and -1 downwards, is a further variable of the mixture. There are few combinations of
directions, so the mixture is conditioned on each of them in advance: every branch is a ``gmr`` model that the controller
could run. The memory is the last reversal of every motor, without inner loops.

1. The dead-band of a motor, the motion after which a reversal counts, is the one whose directions explain most of the
   angles: by the held-out block error of a ridge regression on cubic monomials of the counts and on every direction times
   the linear ones.
2. The number of components is chosen by cross-validation over blocks, and lowered while a branch has no inverse.
3. If one motor moves at a time, every motor has a mixture for each of its directions, and the angles are their sum.
"""

from __future__ import annotations

import json
import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import i2ris_native as _native
from i2ris.benchmark import Case, Floats, Recording, Snake
from i2ris.benchmark import inverse as benchmark_inverse
from i2ris.model import Calibration, Model, ModelError

#: Dead-bands to try, counts, and the widest one, relative to the range of the motor.
DEAD_BANDS = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0, 50.0, 80.0, 120.0)
_WIDEST = 0.25
#: Number of rows for the choice of dead-bands and components.
_ROWS = 3000
#: Penalties of the ridge regression, relative to the variance of a feature.
_PENALTIES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0)
#: Numbers of components to try; more have to lower the square of the error by this part.
_COMPONENTS = (1, 2, 3, 4, 6, 8, 10)
_LEAST_GAIN = 0.01

Directions = tuple[int, int]
Rows = np.ndarray[Any, np.dtype[np.intp]]
Flags = np.ndarray[Any, np.dtype[np.bool_]]
#: Directions of both motors: 0 is unknown.
_DIRECTIONS: list[Directions] = [(one, other) for one in (0, 1, -1) for other in (0, 1, -1)]


class Travel:
    """A motor's direction of travel: 0 until it has moved by the dead-band, and then 1 or -1."""

    def __init__(self, at: float, dead_band: float) -> None:
        self._dead_band, self._low, self._high, self.direction = dead_band, at, at, 0

    def advanced(self, at: float) -> int:
        """The direction after a straight motion; the motor stays where it is."""
        if self.direction <= 0 and at - self._low >= self._dead_band:
            return 1
        if self.direction >= 0 and self._high - at >= self._dead_band:
            return -1
        return self.direction

    def advance(self, at: float) -> int:
        """Moves there."""
        direction = self.advanced(at)
        has_turned = direction != self.direction
        self._low, self._high = (at, at) if has_turned else (min(self._low, at), max(self._high, at))
        self.direction = direction
        return direction


def directions(counts: Floats, dead_bands: Floats) -> Floats:
    """The directions along a path, row by row."""
    columns = []
    for column, dead_band in zip(counts.T.tolist(), dead_bands.tolist(), strict=True):
        travel = Travel(column[0], dead_band)
        columns.append([travel.advance(at) for at in column])
    return np.array(columns, dtype=float).T


def _blocks(rows: int, count: int) -> list[slice]:
    return [slice(part * rows // count, (part + 1) * rows // count) for part in range(count)]


def _ridge_error(features: Floats, angles: Floats) -> float:
    """Mean square error of a ridge regression on held-out blocks; the first feature is 1."""
    deviations = features.std(axis=0)
    deviations[deviations < 1e-9] = np.inf
    standard = (features - features.mean(axis=0)) / deviations
    standard[:, 0] = 1.0
    parts = [(standard[block], angles[block]) for block in _blocks(len(standard), 10)]
    squares, crosses = sum(x.T @ x for x, _ in parts), sum(x.T @ y for x, y in parts)
    penalised = np.diag([0.0] + [1.0] * (standard.shape[1] - 1))
    errors = []
    for penalty in _PENALTIES:
        error = 0.0
        for x, y in parts:
            found = np.linalg.solve(squares - x.T @ x + penalty * (len(standard) - len(x)) * penalised, crosses - x.T @ y)
            error += float(((y - x @ found) ** 2).sum())
        errors.append(error / len(standard))
    return min(errors)


def _left_out_error(counts: Floats, seen: Rows, angles: Floats, dead_bands: Floats) -> float:
    found = directions(counts, dead_bands)[seen]
    known = (found != 0).all(axis=1)
    x, s, y = counts[seen][known], found[known], angles[known]
    step = max(-(-len(x) // _ROWS), 1)
    x, s, y = x[::step] / max(np.abs(x).max(initial=0.0), 1.0), s[::step], y[::step]
    shape = [x[:, 0] ** (total - second) * x[:, 1] ** second for total in range(4) for second in range(total + 1)]
    lags = [s[:, motor] * part for motor in (0, 1) for part in shape[:3]]
    features = np.column_stack(shape + lags)
    return _ridge_error(features, y) if len(x) > features.shape[1] else np.inf


def choose_dead_bands(counts: Floats, seen: Rows, angles: Floats) -> Floats:
    """The best dead-band for both motors together, and then for each separately."""
    widest = np.maximum(_WIDEST * np.ptp(counts, axis=0), DEAD_BANDS[0])

    def best(tried: list[Floats]) -> Floats:
        return min(tried, key=lambda bands: _left_out_error(counts, seen, angles, bands))

    bands = best([np.array([band, band]) for band in DEAD_BANDS if (band <= widest).all()])
    for motor in (0, 1):
        fitting = [band for band in DEAD_BANDS if band <= widest[motor]]
        bands = best([np.where(np.arange(2) == motor, band, bands) for band in fitting])
    return bands


def condition(mixture: Any, known: Directions) -> dict[str, Any]:
    """The mixture of counts and angles, given the directions that are known."""
    weights, means, covariances = mixture
    rest, given = [0, 1, 4, 5], [2 + motor for motor in (0, 1) if known[motor]]
    heights, parts = [], []
    for weight, mean, covariance in zip(weights, np.array(means), np.array(covariances), strict=True):
        gain = np.linalg.solve(covariance[np.ix_(given, given)], covariance[np.ix_(given, rest)]).T
        away = np.array([known[index - 2] for index in given]) - mean[given]
        inner = covariance[np.ix_(given, given)]
        narrowed = covariance[np.ix_(rest, rest)] - gain @ covariance[np.ix_(given, rest)]
        heights.append(np.log(weight) - 0.5 * (away @ np.linalg.solve(inner, away) + np.log(np.linalg.det(inner))))
        parts.append((mean[rest] + gain @ away, (narrowed + narrowed.T) / 2))
    kept = [index for index, height in enumerate(heights) if height - max(heights) > -600]
    shares = np.exp(np.array(heights)[kept] - max(heights))
    return {
        "weights": (shares / shares.sum()).tolist(),
        "means": [parts[index][0].tolist() for index in kept],
        "covariances": [parts[index][1].tolist() for index in kept],
    }


def regress(mixture: Any, inputs: Floats) -> Floats:
    """The angles at rows of counts and directions."""
    densities, means = [], []
    for weight, mean, covariance in zip(*mixture, strict=True):
        mean, covariance = np.array(mean), np.array(covariance)
        away = inputs - mean[:4]
        solved = np.linalg.solve(covariance[:4, :4], away.T).T
        density = np.log(weight) - 0.5 * ((away * solved).sum(axis=1) + np.log(np.linalg.det(covariance[:4, :4])))
        densities.append(density)
        means.append(mean[4:] + solved @ covariance[:4, 4:])
    shares = np.exp(np.array(densities) - np.max(densities, axis=0))
    angles: Floats = np.einsum("kr,kro->ro", shares / shares.sum(axis=0), np.array(means))
    return angles


def _choose_components(joint: Floats, restarts: int) -> int:
    """The smallest number of components whose error on held-out blocks is near the minimum."""
    thinned = joint[:: max(-(-len(joint) // _ROWS), 1)]
    errors = []
    for components in _COMPONENTS:
        error = 0.0
        for block in _blocks(len(thinned), 5):
            try:
                mixture = _native.fit_mixture(np.delete(thinned, block, axis=0), components, min(restarts, 4))
                error += float(((thinned[block, 4:] - regress(mixture, thinned[block, :4])) ** 2).sum())
            except ModelError:
                error = np.inf
        errors.append(error)
    near = min(errors) * (1 + _LEAST_GAIN)
    return next(k for k, error in zip(_COMPONENTS, errors, strict=True) if error <= near)


class DirectionModel:
    """A ``gmr`` model for every combination of directions."""

    def __init__(self, dead_bands: Floats, branches: dict[Directions, Model]) -> None:
        self.dead_bands, self.branches = dead_bands, branches

    def predict(self, counts: Floats) -> Floats:
        """Angles along a path of the motors, deg."""
        along = directions(counts, self.dead_bands)
        found = np.empty((len(counts), 2))
        for known, branch in self.branches.items():
            rows = (along == known).all(axis=1)
            found[rows] = branch.predict(counts[rows]) if rows.any() else 0.0
        return found

    def to_dict(self) -> dict[str, Any]:
        """The family, as named in a model file."""
        return {"family": {"kind": "gmr-direction"}}


class Pilot:
    """The inverse along a motion: with the present directions, or with others if the motion turns a motor."""

    def __init__(self, model: DirectionModel) -> None:
        self._travels = [Travel(0.0, band) for band in model.dead_bands.tolist()]
        self._trackers = {known: branch.tracker() for known, branch in model.branches.items()}

    def advance(self, at: list[float]) -> None:
        """Moves the motors to these counts."""
        for travel, counts in zip(self._travels, at, strict=True):
            travel.advance(counts)

    def counts(self, goal: list[float], near: list[float]) -> list[float]:
        """Counts for a goal, deg; the search begins near some counts."""
        one, other = self._travels
        present = (one.direction, other.direction)
        first: list[float] | None = None
        for known in (present, *(known for known in self._trackers if known != present)):
            if any(before and not after for before, after in zip(present, known, strict=True)):
                continue
            tracker = self._trackers[known]
            tracker.advance(near)
            found: tuple[list[float], bool] = tracker.invert(goal)
            counts, clipped = found
            if not clipped and (one.advanced(counts[0]), other.advanced(counts[1])) == known:
                return counts
            first = counts if first is None else first
        return near if first is None else first


#: From the emulator's configuration: limits of the motors per tick of a millisecond, the turning band, deg, and the lead, ticks.
_FASTEST, _ACCELERATION, _BAND, _LEAD = 2.0, 0.16, 0.05, 10


class _Follower:
    """A snake whose motors follow a pilot."""

    def __init__(self, case: Case, model: DirectionModel) -> None:
        self.snake = Snake(case.physics, case.seed, case.aged)
        self.pilot = Pilot(model)
        self.at, self.speed, self.held, self.goal = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
        # Four decaying turns, which erase the past.
        for share in np.arange(12_000) / 12_000:
            size, turn = 500 * (1 - share) * min(8 * share, 1.0), 8 * np.pi * share
            self._move([float(size * np.sin(turn)), float(size * np.cos(turn))])

    def _move(self, to: list[float]) -> None:
        self.at = to
        whole = [float(round(counts)) for counts in to]
        self.angles = self.snake.step(whole)
        self.pilot.advance(whole)

    def follow(self, ahead: list[float], goal: list[float]) -> float:
        """One tick towards the future goal; returns the squared tip error, deg."""
        away = [held - at for held, at in zip(self.held, ahead, strict=True)]
        apart = math.hypot(*away)
        if apart >= _BAND:
            # A goal that turns back by less is held.
            self.held, self.goal = [at + _BAND / apart * part for at, part in zip(ahead, away, strict=True)], ahead
        wanted = self.pilot.counts(self.goal, self.at)
        for motor in (0, 1):
            left = wanted[motor] - self.at[motor]
            fastest = min(abs(self.speed[motor]) + _ACCELERATION, _FASTEST) if self.speed[motor] * left >= 0 else _ACCELERATION
            self.speed[motor] = max(-fastest, min(fastest, left))
        self._move([at + speed for at, speed in zip(self.at, self.speed, strict=True)])
        return float((self.angles[0] - goal[0]) ** 2 + (self.angles[1] - goal[1]) ** 2)


def inverse(case: Case, model: DirectionModel) -> dict[str, dict[str, float]]:
    """As :func:`i2ris.benchmark.inverse`, without the controller: the counts of the model, within the same limits of the
    motors and with the same turning band."""
    straight = Calibration("linear", robot_id="i2ris-emulated").fit(case.train_path()).model_
    peers, follower, at = benchmark_inverse(case, straight), _Follower(case, model), np.zeros(2)
    for name, path in _native.motions(case.train_path()):
        goals = np.array(path)
        ticks = max(int(np.ceil(np.hypot(*(goals[0] - at)) / 0.015)), 1)
        for tick in range(1, ticks + 1001):
            there = (at + (goals[0] - at) * min(tick / ticks, 1.0)).tolist()
            follower.follow(there, there)
        times = np.arange(int((len(goals) - 1) / 0.2)) * 0.2
        along, ahead = (
            np.column_stack([np.interp(times + later, np.arange(len(goals)), goals[:, axis]) for axis in (0, 1)]).tolist()
            for later in (0.0, 0.2 * _LEAD)
        )
        rms = math.sqrt(sum(map(follower.follow, ahead, along)) / len(along))
        peers[name] = {**peers[name], "rms_deg": rms, "share": rms / peers[name]["linear_deg"]}
        at = goals[-1]
    return peers


def fit(path: str | Path, robot_id: str = "i2ris", restarts: int = 20, components: int | None = None) -> DirectionModel:
    """Fits it to a recording of two motors and two angles in the common format, also your own, with a given or an
    automatic number of components. If one motor moves at a time, as published, every motor has a mixture for each
    direction, and the angles are their sum."""
    straight = Calibration("linear", robot_id=robot_id).fit(path)
    file, recording = straight.model_.to_dict(), Recording.read(path)
    usable: Flags = np.asarray(np.isfinite(recording.angles_deg).all(axis=1))
    rows = np.flatnonzero(usable)
    usable[rows[[spike["row"] for spike in straight.report_["spikes"]]]] = False

    def joint(rows: Rows) -> tuple[Floats, Floats]:
        path = recording.counts[: rows[-1] + 1]
        bands = choose_dead_bands(path, rows, recording.angles_deg[rows])
        found = directions(path, bands)[rows]
        known = (found != 0).all(axis=1)
        return bands, np.column_stack([recording.counts[rows], found, recording.angles_deg[rows]])[known]

    def model(bands: Floats, table: Floats, components: int) -> DirectionModel:
        mixture = _native.fit_mixture(table, components, restarts)
        return DirectionModel(bands, {known: _branch(file, condition(mixture, known)) for known in _DIRECTIONS})

    if _one_at_a_time(recording.counts):
        return _of_strokes(recording, np.flatnonzero(usable), file, restarts, components or _STROKES)

    def flying(bands: Floats, table: Floats, components: int) -> tuple[int, DirectionModel]:
        while True:
            try:
                return components, model(bands, table, components)
            except ModelError:
                fewer = [number for number in _COMPONENTS if number < components]
                if not fewer:
                    raise
                components = fewer[-1]

    if components is not None:
        return model(*joint(rows[usable[rows]]), components)

    # Like the families: components chosen on three quarters of the rows, the rest fitted to all of them.
    held_out = np.zeros(len(rows), dtype=bool)
    for part in _blocks(len(rows), 5):
        size = round(0.25 * (part.stop - part.start))
        first = part.start + (part.stop - part.start - size) // 2
        held_out[first : first + size] = True
    bands, table = joint(rows[~held_out & usable[rows]])
    components, _ = flying(bands, table, _choose_components(table, restarts))
    return flying(*joint(rows[usable[rows]]), components)[1]


#: Default number of components if one motor moves at a time.
_STROKES = 12


def _moving(counts: Floats) -> Flags:
    """Motors that move in a row: encoders of resting ones flicker."""
    window = np.ones(11)
    ways = [np.convolve(np.abs(np.gradient(column)), window, "same") for column in counts.T]
    return np.column_stack(ways) > 0.1 * np.maximum(*ways)[:, np.newaxis]


def _one_at_a_time(counts: Floats) -> bool:
    return bool(_moving(counts).all(axis=1).mean() < 0.5)


def _of_strokes(recording: Recording, rows: Rows, file: dict[str, Any], restarts: int, components: int) -> DirectionModel:
    counts, angles, moving = recording.counts, recording.angles_deg, _moving(recording.counts)
    bands = choose_dead_bands(counts[: rows[-1] + 1], rows, angles[rows])
    along = directions(counts, bands)
    #: Contribution of the other motor, by direction: at first at rest.
    given = {motor: np.zeros((len(counts), 2)) for motor in (0, 1)}
    parts: dict[tuple[int, int], dict[str, Any]] = {}
    for _ in range(3):
        for motor in (0, 1):
            own = rows[moving[rows, motor] & ~moving[rows, 1 - motor]]
            other = given[1 - motor] - given[1 - motor][own].mean(axis=0)
            for way in (1, -1):
                branch = own[along[own, motor] == way]
                table = np.column_stack([counts[branch, motor], (angles - other)[branch]])
                weights, means, covariances = _native.fit_mixture(table, components, restarts)
                parts[motor, way] = {"weights": weights, "means": means, "covariances": covariances}
            for way in (1, 0, -1):
                at = along[:, motor] == way
                found = [_stroke(parts[motor, known], counts[at, motor]) for known in ((way,) if way else (1, -1))]
                given[motor][at] = np.mean(found, axis=0)
    # The sum of both, level with the rows.
    left = (angles - given[0] - given[1])[rows].mean(axis=0)
    for way in (1, -1):
        parts[1, way]["means"] = [[at, *(np.array(outputs) + left)] for at, *outputs in parts[1, way]["means"]]

    def of(motor: int, way: int) -> dict[str, Any]:
        """The mixture of a branch, or of both together."""
        if way:
            return parts[motor, way]
        both = [parts[motor, known] for known in (1, -1)]
        joined = {name: [entry for part in both for entry in part[name]] for name in ("weights", "means", "covariances")}
        return {**joined, "weights": [weight / 2 for weight in joined["weights"]]}

    return DirectionModel(bands, {known: _branch(file, [of(0, known[0]), of(1, known[1])]) for known in _DIRECTIONS})


def _stroke(mixture: dict[str, Any], counts: Floats) -> Floats:
    """The regression of a motor: angles, deg."""
    means, covariances = np.array(mixture["means"]), np.array(mixture["covariances"])
    away = counts[:, np.newaxis] - means[:, 0]
    density = np.log(np.array(mixture["weights"])) - 0.5 * (away**2 / covariances[:, 0, 0] + np.log(covariances[:, 0, 0]))
    shares = np.exp(density - density.max(axis=1, keepdims=True))
    slopes = covariances[:, 0, 1:] / covariances[:, :1, 0]
    each = means[:, 1:] + slopes * away[..., np.newaxis]
    found: Floats = np.einsum("rk,rko->ro", shares / shares.sum(axis=1, keepdims=True), each)
    return found


def _branch(file: dict[str, Any], mixture: Any) -> Model:
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "model.json")
        target.write_text(json.dumps({**file, "family": {"kind": "gmr", "mixture": mixture}}))
        return Model.load(target)

"""The hysteresis benchmark, version 3, for models of tendon hysteresis on emulated snakes with eleven physics.

    from i2ris import benchmark

    case = benchmark.Case("preisach", seed=3)          # one of eleven physics x five seeds x four protocols
    train = case.train()                         # t_s, counts, angles_deg (NaN where there is no frame)
    test = case.test()                           # true angles; the first 10 s are the window

    benchmark.forward(case, my_predict)                # share of a straight line's error, after the window
    benchmark.inverse(case, "model.json")              # the same while the controller tracks five motions
    benchmark.geometric_mean(shares)

Frozen: version, seeds, and the digests of all recordings (``benchmark-3.json``, checked at every use). The data are
made on this computer, in seconds; nothing is downloaded. Version 1 had the first eight physics, and no ``joint``. Version 3
has the default limits of a robot in the inverse task, and slower motions within them: its figures differ from those of
version 2. The recordings, and so the forward task, are the same in all versions.
"""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

import i2ris_native as _native
from i2ris.model import Model

VERSION = 3
#: Version since which the inverse task is unchanged.
INVERSE_SINCE = 3
PHYSICS = (
    "preisach",
    "bouc-wen",
    "dahl",
    "lugre",
    "prandtl-ishlinskii",
    "gear",
    "wire",
    "springs",
    "transmission-error",
    "creep",
    "vector-friction",
)
#: Snakes of ``config/snakes`` by name: not part of the benchmark, and the same with every seed.
NAMED = ("steel", "brass", "multi", "loose")
SEEDS = (1, 2, 3, 4, 5)
#: Name: motion of the calibration, and its duration, s.
PROTOCOLS = {
    "reversals": ("reversals", 300.0),
    "axes": ("axes", 300.0),
    "joint": ("cycles", 300.0),
    "short": ("reversals", 100.0),
}
#: Name: deviation of the camera's angles, deg, and delay of its stamps, ms.
CAMERAS = {"usual": (0.07, 0), "noisy": (0.3, 0), "late": (0.07, 60)}
#: Length of the known window before the forward task, s.
WINDOW_S = 10.0
_TEST_S = 60.0
_TEST_SEED = 500

Floats = NDArray[np.float64]


class Snake:
    """An emulated snake with motors: ``Snake("preisach", seed=3)``."""

    def __init__(self, physics: str, seed: int = 1, aged: bool = False) -> None:
        self._native = _native.Snake(physics, seed, aged)

    def step(self, counts: ArrayLike, ticks: int = 1) -> Floats:
        """Runs this many ticks of a millisecond with these set-points; returns the true pitch and yaw, deg."""
        first, second = np.asarray(counts, dtype=np.float64)
        return np.array(self._native.step([first, second], ticks))

    @property
    def counts(self) -> Floats:
        """Encoder counts."""
        return np.array(self._native.counts)

    @property
    def angles(self) -> Floats:
        """True pitch and yaw, deg."""
        return np.array(self._native.angles)


@dataclass(frozen=True)
class Recording:
    """Time, counts and angles, row by row. Where there is no frame, the angles are NaN."""

    t_s: Floats
    counts: Floats
    angles_deg: Floats
    sha256: str

    @classmethod
    def read(cls, path: str | Path) -> Recording:
        """A recording in the common format."""
        table = np.genfromtxt(path, delimiter=",", skip_header=1)
        digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
        return cls(table[:, 0], table[:, 1:3], table[:, 3:5], digest)


@dataclass(frozen=True)
class Case:
    """A snake and its recording conditions."""

    physics: str
    seed: int = 1
    protocol: str = "reversals"
    camera: str = "usual"
    #: Judged on the snake after use: gaps grown by 40 %, friction by 25 %, preload less by 30 %. Trained on the new one.
    aged: bool = False
    #: Folder for recordings; without, they are made when needed.
    folder: str | Path | None = None

    def __post_init__(self) -> None:
        for what, value, known in (
            ("physics", self.physics, (*PHYSICS, *NAMED)),
            ("seed", self.seed, SEEDS),
            ("protocol", self.protocol, PROTOCOLS),
            ("camera", self.camera, CAMERAS),
        ):
            if value not in known:
                raise ValueError(f"{what}: `{value}` is not in version {VERSION}; it has {', '.join(map(str, known))}")

    @property
    def name(self) -> str:
        """The key of its digest."""
        return f"{self.physics}-{self.seed}-{self.protocol}-{self.camera}"

    @cached_property
    def _folder(self) -> Path:
        if self.folder is None:
            object.__setattr__(self, "_kept", tempfile.TemporaryDirectory())
            return Path(self._kept.name)  # type: ignore[attr-defined]
        Path(self.folder).mkdir(parents=True, exist_ok=True)
        return Path(self.folder)

    def _made(self, name: str, protocol: str, duration_s: float, noise: float, late: int, seed: int, aged: bool) -> Path:
        path = self._folder / f"{name}.csv"
        if not path.exists():
            _native.record(
                path, self.physics, self.seed, protocol=protocol, duration_s=duration_s, noise_deg=noise,
                latency_ms=late, first_seed=seed, aged=aged,
            )  # fmt: skip
        # Also of an earlier run, which may have ended while it wrote.
        expected = digests().get(name)
        found = hashlib.sha256(path.read_bytes()).hexdigest()
        if expected is not None and expected != found:
            why = f"is not the recording of version {VERSION} ({found[:12]}, not {expected[:12]})"
            raise RuntimeError(f"{path} {why}; delete it to have it made again")
        return path

    def train_path(self) -> Path:
        """The recording to train on, as a file."""
        protocol, duration_s = PROTOCOLS[self.protocol]
        noise, late = CAMERAS[self.camera]
        return self._made(self.name, protocol, duration_s, noise, late, 1, False)

    def train(self) -> Recording:
        """The recording to train on."""
        return Recording.read(self.train_path())

    def test(self) -> Recording:
        """The recording for the evaluation: other motion, true angles, and the same for all protocols and cameras."""
        name = f"{self.physics}-{self.seed}-{'aged' if self.aged else 'test'}"
        return Recording.read(self._made(name, "reversals", _TEST_S, 0.0, 0, _TEST_SEED, self.aged))


def cases(
    physics: Iterable[str] = PHYSICS, seeds: Iterable[int] = SEEDS, protocols: Iterable[str] = tuple(PROTOCOLS),
    cameras: Iterable[str] = ("usual",), folder: str | Path | None = None, aged: bool = False,
) -> Iterator[Case]:  # fmt: skip
    """All cases."""
    for name in physics:
        for seed in seeds:
            for protocol in protocols:
                for camera in cameras:
                    yield Case(name, seed, protocol, camera, aged, folder)


def digests() -> dict[str, str]:
    """SHA-256 of this version's recordings."""
    path = Path(__file__).with_name(f"benchmark-{VERSION}.json")
    return json.loads(path.read_text()) if path.exists() else {}


def linear(recording: Recording) -> tuple[Floats, Floats]:
    """Gain, deg per count, and offset, deg, of the straight line through a recording."""
    seen = np.isfinite(recording.angles_deg).all(axis=1)
    inputs = np.column_stack([recording.counts[seen], np.ones(seen.sum())])
    found = np.linalg.lstsq(inputs, recording.angles_deg[seen], rcond=None)[0]
    return found[:2].T, found[2]


def _rms(errors: Floats) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def forward(case: Case, predict: Callable[[Floats], ArrayLike]) -> float:
    """The forward task: angles from all counts of the test; the share of a straight line's error after the window."""
    test = case.test()
    judged = np.isfinite(test.angles_deg).all(axis=1) & (test.t_s >= WINDOW_S)
    found = np.asarray(predict(test.counts), dtype=np.float64)
    if found.shape != test.angles_deg.shape:
        raise ValueError(f"predict: returned the shape {found.shape}, must be {test.angles_deg.shape}")
    gain, offset = linear(case.train())
    straight = test.counts @ gain.T + offset
    return _rms((found - test.angles_deg)[judged]) / _rms((straight - test.angles_deg)[judged])


def inverse(case: Case, model: Model | str | Path) -> dict[str, dict[str, float]]:
    """The inverse task: the controller tracks five motions on the true snake with a model. For each motion the RMS of the
    tip, deg, that of the straight line and of the exact inverse, and the share."""
    model = model if isinstance(model, Model) else Model.load(model)
    rows = _native.track(model._native, case.physics, case.seed, case.aged, case.train_path())
    return {
        motion: {"rms_deg": rms, "linear_deg": straight, "exact_deg": exact, "share": rms / straight}
        for motion, rms, straight, exact in rows
    }


def geometric_mean(shares: Iterable[float]) -> float:
    """The figure of a method: the geometric mean of its shares."""
    values = [math.log(share) for share in shares]
    return math.exp(sum(values) / len(values))

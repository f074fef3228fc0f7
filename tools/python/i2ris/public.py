"""Recordings published by others, by repository, commit and hash. None is shipped with this package.

    from i2ris import public

    recording = public.load("i2ris-circle")       # downloads it once, and prints its source
    recording = public.load("i2ris-circle", file="output_w_angles.csv")     # or a copy of yours

Its use is bound by the terms of its owner: ``licence`` has the statement of the repository.
"""

from __future__ import annotations

import hashlib
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from i2ris.benchmark import Recording

#: Maximum size of a fetched file, bytes.
MAX_FILE_BYTES = 64 << 20


@dataclass(frozen=True)
class Source:
    """Location and description of a recording."""

    repository: str
    commit: str
    path: str
    sha256: str
    licence: str
    what: str
    read: Callable[[Path, str], Recording]

    @property
    def url(self) -> str:
        """The file at its commit."""
        return f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/{self.path}"


def _laboratory(path: Path, digest: str) -> Recording:
    """Image time, encoder time, counts of motor 1 and 0, yaw and pitch."""
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    time = table[:, 1] - table[0, 1]
    return Recording(time, table[:, [3, 2]], table[:, [5, 4]], digest)


SOURCES = {
    "i2ris-circle": Source(
        "garyduu901/i2ris_data_driven_control",
        "28ab280d9fcc48058c04a02edc6e370b9f896b04",
        "snake_data_sync/output_w_angles.csv",
        "3e5c1ae0e562c2da7910c896b9d1f81940142c92d2d6679e53423ca53342d5f3",
        "none stated",
        "the robot itself: four turns of a circle of 10 deg at 5 Hz, with two microscopes; no reversals, so no hysteresis is visible",
        _laboratory,
    ),
}


def load(name: str, file: str | Path | None = None, folder: str | Path = "public-recordings") -> Recording:
    """A recording: from a copy, from the folder where it was kept before, or from its repository. A different hash is refused."""
    if name not in SOURCES:
        raise ValueError(f"`{name}` is not known: there are {', '.join(SOURCES)}")
    source = SOURCES[name]
    path = Path(file) if file is not None else Path(folder, f"{name}{Path(source.path).suffix}")
    if file is None and not path.exists():
        print(f"{source.url}\nlicence: {source.licence}", flush=True)
        with urllib.request.urlopen(source.url, timeout=30) as answer:
            content = answer.read(MAX_FILE_BYTES)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    if digest != source.sha256:
        raise ValueError(f"{path} is not the file of {source.repository} at {source.commit[:7]} ({digest[:12]}, not {source.sha256[:12]})")
    return source.read(path, digest)

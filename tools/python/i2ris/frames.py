"""Frames with their stamps, from folders and cameras. A frame that is not valid becomes a gap with its cause.

The rules are those of ``i2ris vision``: stamps from ``frames.csv`` (file, t_s), from the names (``frame_t12.345.png``) or
from numbers and a rate; a missing number, another size, an identical image and a stamp that does not rise are gaps.
"""

import csv
import hashlib
import re
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

MISSING = "file missing"
UNDECODABLE = "not a whole picture"
WRONG_SIZE = "wrong size"
FROZEN = "frozen: identical to the previous one"
SAME_CAMERA = "identical to a picture of the other view"
OUT_OF_ORDER = "stamp out of order"
NO_PARTNER = "no picture of the other view at that time"
NO_IMAGE = "the camera delivers nothing"

#: Number of recent images of each view that are compared.
RECENT = 16
#: Number of frames that are gaps after an identical image.
GAP_FRAMES = 128


@dataclass
class Frame:
    """An image with its stamp, or the cause of a gap."""

    stamp_ns: int
    name: str
    image: np.ndarray | None
    cause: str | None = None
    digest: bytes = b""


def folder(path, fps: float = 30.0):
    """Yields the frames of a folder in the order of their stamps."""
    path = Path(path)
    names = sorted(p.name for p in path.iterdir() if p.suffix.lower() in (".png", ".jpg", ".jpeg"))
    if not names:
        raise ValueError(f"{path}: no PNG or JPEG file in this folder")
    for stamp_ns, name in _plan(path, names, fps):
        yield _load(path, stamp_ns, name)


def _plan(path: Path, names, fps: float):
    if (path / "frames.csv").exists():
        with open(path / "frames.csv", newline="") as table:
            return [(_nanoseconds(row["t_s"]), row["file"]) for row in csv.DictReader(table)]
    timed = [re.search(r"(?:^|[^A-Za-z0-9])t(\d+\.\d+)$", Path(name).stem) for name in names]
    if all(timed):
        return sorted((_nanoseconds(match[1]), name) for match, name in zip(timed, names))
    numbered = {}
    for name in names:
        numbers = re.findall(r"\d+", Path(name).stem)
        if not numbers:
            raise ValueError(f"{path}: {name} has no number in its name; number the files, or add frames.csv")
        if int(numbers[-1]) in numbered:
            raise ValueError(f"{path}: {numbered[int(numbers[-1])]} and {name} have the same number")
        numbered[int(numbers[-1])] = name
    first, last = min(numbered), max(numbered)
    if last - first > 20 * len(numbered) + 10_000:
        raise ValueError(f"{path}: the numbers of the files jump from {first} to {last}")
    return [(round((n - first) / fps * 1e9), numbered.get(n, f"number {n}")) for n in range(first, last + 1)]


def _nanoseconds(seconds: str) -> int:
    whole, _, part = seconds.strip().partition(".")
    return int(whole) * 1_000_000_000 + int((part + "0" * 9)[:9])


def _load(path: Path, stamp_ns: int, name: str) -> Frame:
    try:
        data = (path / name).read_bytes()
    except FileNotFoundError:
        return Frame(stamp_ns, name, None, MISSING)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE) if _is_whole(data) else None
    return Frame(stamp_ns, name, image, None if image is not None else UNDECODABLE)


def _is_whole(data: bytes) -> bool:
    """Decoders fill missing parts with grey, so a truncated file has to be detected here."""
    if data.startswith(b"\x89PNG"):
        return b"IEND" in data[-16:]
    return data.startswith(b"\xff\xd8") and data.rstrip(b"\0\r\n").endswith(b"\xff\xd9")


#: A driver's first stamp that differs more from the arrival of its frame is from a different clock.
OLDEST_NS = 2_000_000_000
#: Time until the next attempt after no camera had a frame, s: the call of an unplugged one returns at once.
NO_IMAGE_S = 0.03
#: Stamps of arrivals are later than the exposures by the delay of camera, cable and driver.
BY_ARRIVAL = "stamps are those of arrival, later than the exposures: a recording measures the delay (camera_late_s)"


class CameraClock:
    """Exposures of a camera's frames, and number of frames lost by the camera or the computer.

    The V4L2 driver stamps every buffer with the monotonic clock, at the start of its exposure or of its transfer, and
    OpenCV returns the stamp as CAP_PROP_POS_MSEC. If it does not, or the clock differs, frames are stamped on arrival,
    and ``cause`` has the reason.
    """

    def __init__(self, capture):
        self._capture = capture
        self.cause = None if capture.getBackendName() == "V4L2" else f"the backend {capture.getBackendName()} has no stamps"
        #: Number of lost frames, by the driver's stamps; arrivals do not show it.
        self.lost = 0
        self._last = self._period = None

    def stamp_ns(self, arrived_ns: int) -> int:
        """The stamp of the frame that was grabbed last."""
        stamp_ns = arrived_ns
        if self.cause is None:
            of_driver = round(self._capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6)
            # A frame that waited for this process is old, but later than the previous one.
            has_advanced = self._last is not None and self._last < of_driver
            if of_driver <= arrived_ns and (has_advanced or arrived_ns - of_driver <= OLDEST_NS):
                stamp_ns = of_driver
            else:
                self.cause = "the stamps of the driver are from a different clock"
        if self.cause is None:
            self._count_lost(stamp_ns)
        return stamp_ns

    def _count_lost(self, stamp_ns: int) -> None:
        """A gap of two periods is one lost frame. The period is the shortest recent one."""
        if self._last is not None and stamp_ns > self._last:
            gap = stamp_ns - self._last
            self._period = gap if self._period is None else min(gap, round(1.002 * self._period) + 1)
            self.lost += max(0, round(gap / self._period) - 1)
        self._last = stamp_ns


def cameras(devices, clocks=None):
    """Yields one frame per camera, grabbed right after each other, stamped with the exposure if the driver reports it.
    ``clocks`` receives the :class:`CameraClock` of each."""
    # The V4L2 backend by name: a different one that is also installed may come first, and has no stamps.
    captures = [cv2.VideoCapture(int(device), cv2.CAP_V4L2) for device in devices]
    captures = [it if it.isOpened() else cv2.VideoCapture(int(device)) for it, device in zip(captures, devices)]
    for device, capture in zip(devices, captures):
        if not capture.isOpened():
            raise ValueError(f"camera {device} cannot be opened")
    clocks = [] if clocks is None else clocks
    clocks += [CameraClock(capture) for capture in captures]
    number = 0
    while True:
        number += 1
        grabbed = [(capture.grab(), time.monotonic_ns()) for capture in captures]
        if not any(has for has, _ in grabbed):
            time.sleep(NO_IMAGE_S)
        group = []
        for capture, clock, (has, arrived_ns) in zip(captures, clocks, grabbed):
            stamp_ns = clock.stamp_ns(arrived_ns) if has else arrived_ns
            good, image = capture.retrieve() if has else (False, None)
            name = f"image {number}"
            if good:
                group.append(Frame(stamp_ns, name, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)))
            else:
                group.append(Frame(stamp_ns, name, None, NO_IMAGE))
        yield group


class FrameCheck:
    """Checks the frames of one view."""

    def __init__(self):
        self._size = self._stamp = self._digest = None

    def check(self, frame: Frame) -> Frame:
        """Turns a frame that is not valid into a gap."""
        if frame.image is None:
            return frame
        self._size = self._size or frame.image.shape
        frame.digest = hashlib.blake2b(frame.image.tobytes(), digest_size=16).digest()
        frozen, self._digest = frame.digest == self._digest, frame.digest
        if frame.image.shape != self._size:
            frame.cause = WRONG_SIZE
        elif self._stamp is not None and frame.stamp_ns <= self._stamp:
            frame.cause = OUT_OF_ORDER
        else:
            self._stamp = frame.stamp_ns
            frame.cause = FROZEN if frozen else None
        return frame


class SameCameraCheck:
    """Detects that both views show the same camera: after one identical image, all frames are gaps for a while."""

    def __init__(self):
        self._recent = [deque(maxlen=RECENT), deque(maxlen=RECENT)]
        self._gap_frames = 0

    def is_same_camera(self, view: int, frame: Frame) -> bool:
        if frame.image is None or frame.image.min() == frame.image.max():
            return False
        same = frame.digest in self._recent[1 - view]
        self._gap_frames = GAP_FRAMES if same else max(0, self._gap_frames - 1)
        self._recent[view].append(frame.digest)
        return self._gap_frames > 0


def pairs(first, second, within_ns: int):
    """Pairs the frames of two views by their stamps; yields [a, b], with None for a partner that is missing."""
    waiting = [next(first, None), next(second, None)]
    sources = [first, second]
    while waiting[0] is not None or waiting[1] is not None:
        a, b = waiting
        if a is not None and b is not None and abs(a.stamp_ns - b.stamp_ns) <= within_ns:
            yield [a, b]
            waiting = [next(first, None), next(second, None)]
        else:
            view = 0 if b is None or (a is not None and a.stamp_ns < b.stamp_ns) else 1
            yield [a, None] if view == 0 else [None, b]
            waiting[view] = next(sources[view], None)

"""Marker angles against images at known angles, and everything that must be a gap."""

import io
import itertools

import pytest

np = pytest.importorskip("numpy", reason="the markers are not installed: pip install 'tools/python[markers]'")
cv2 = pytest.importorskip("cv2", reason="the markers are not installed: pip install 'tools/python[markers]'")

import scene  # noqa: E402
from i2ris import frames, markers  # noqa: E402
from i2ris.joint import View, parse_view, solve  # noqa: E402

USING = markers.detector()


def errors(side_px, count=40, **conditions):
    """Errors in degrees over +-45 degrees, and number of markers not found."""
    rng = np.random.default_rng(3)
    found, missing = [], 0
    tilt = np.cos(np.radians(conditions.get("tilt_deg", 0.0)))
    for _ in range(count):
        angle = rng.uniform(-45, 45)
        truth = np.arctan(np.tan(np.radians(angle)) / tilt)
        look = markers.find(scene.image(9, angle, side_px, rng, **conditions), 9, USING)
        if isinstance(look, markers.Marker):
            found.append(np.degrees(markers.turn(look.angle, truth)))
        else:
            missing += 1
    return np.array(found), missing


@pytest.mark.parametrize("side_px, limit_deg", [(40, 0.15), (80, 0.06), (160, 0.03)])
def test_accuracy_at_light_blur_and_noise(side_px, limit_deg):
    found, missing = errors(side_px)
    assert missing == 0
    assert found.std() <= limit_deg and abs(found.mean()) <= limit_deg / 2, (found.mean(), found.std())


def test_accuracy_at_strong_blur_and_noise():
    found, missing = errors(80, blur_px=2.5, noise=12.0)
    assert missing <= 4
    assert found.std() <= 0.16 and np.abs(found).max() < 1.0, (found.mean(), found.std())


def test_marker_bent_towards_the_camera_shows_the_angle():
    found, missing = errors(80, tilt_deg=40.0)
    assert missing == 0 and found.std() <= 0.06 and abs(found.mean()) < 0.03, (found.mean(), found.std())


def test_wrong_or_missing_marker_gives_no_angle():
    rng = np.random.default_rng(1)
    other = scene.image(14, 10, 80, rng)
    assert markers.find(other, 9, USING) == "marker 9 not seen but [14]"
    assert isinstance(markers.find(other, 14, USING), markers.Marker)
    empty = np.clip(rng.normal(150, 5, (480, 640)), 0, 255).astype(np.uint8)
    assert markers.find(empty, 9, USING) == "marker 9 not seen"
    twice = np.hstack([scene.image(9, 10, 80, rng), scene.image(9, 20, 80, rng)])
    assert markers.find(twice, 9, USING) == "marker 9 seen 2 times"
    small = markers.find(scene.image(9, 10, 20, rng, blur_px=0.5), 9, USING)
    assert isinstance(small, str), "too small to be trusted"


def pose(number):
    step = max(0, number - 7)
    return 5.0 * step, -3.0 * step


def film(count=14):
    """Shots of both views: eight at rest, mounted 4 and -7 degrees askew, then moving."""
    rng = np.random.default_rng(2)
    views = ([], [])
    for number in range(count):
        for view, (marker_id, angle, askew) in enumerate(zip((9, 14), pose(number), (4.0, -7.0))):
            image = scene.image(marker_id, angle + askew, 80, rng)
            views[view].append(frames.Frame(number * 33_000_000, str(number), image))
    return views


def run(views):
    session = markers.Session([View("pitch"), View("yaw")], [9, 14], ["top", "side"], 8 * 33_000_000)
    rows = []
    for group in frames.pairs(iter(views[0]), iter(views[1]), 12_000_000):
        rows += session.take(group)
    return rows + session.finish(), session


def assert_right(row):
    number = round(row["stamp_ns"] / 33_000_000)
    assert np.allclose(np.degrees(row["angles"]), pose(number), atol=0.25), (number, np.degrees(row["angles"]))


def test_two_views_give_angles_from_the_straight_pose():
    rows, session = run(film())
    assert len(rows) == 14 and session.good == 14
    for row in rows:
        assert_right(row)
        assert row["quality"] >= 0.5 and 0 < row["deviations"][0] < 0.01
    assert abs(np.degrees(session.references[0].angle) - 4.0) < 0.1


def spoil_frozen(views):
    views[0][11].image = views[0][10].image


def spoil_size(views):
    views[0][11].image = views[0][11].image[:-2]


def spoil_order(views):
    views[0][11].stamp_ns = views[0][10].stamp_ns


def spoil_missing(views):
    del views[1][11]


def spoil_marker(views):
    views[1][11].image = np.random.default_rng(9).integers(100, 110, (480, 640)).astype(np.uint8)


def spoil_file(views):
    views[0][11] = frames.Frame(views[0][11].stamp_ns, "11", None, frames.MISSING)


@pytest.mark.parametrize("spoil, cause", [
    (spoil_frozen, frames.FROZEN),
    (spoil_size, frames.WRONG_SIZE),
    (spoil_order, frames.OUT_OF_ORDER),
    (spoil_missing, frames.NO_PARTNER),
    (spoil_marker, "marker 14 not seen"),
    (spoil_file, frames.MISSING),
])
def test_bad_pictures_are_named_and_counted_and_never_an_angle(spoil, cause):
    views = film()
    spoil(views)
    rows, session = run(views)
    gaps = [row for row in rows if "angles" not in row]
    assert 1 <= len(gaps) <= 2 and any(cause in row["cause"] for row in gaps), gaps
    assert sum(count for (_, words), count in session.causes.items() if words == cause) == 1
    for row in rows:
        if "angles" in row:
            assert_right(row)


def test_one_camera_in_both_views_is_noticed():
    first, second = film()
    for number in range(10, 14):
        second[number].image = first[number].image
    rows, session = run((first, second))
    assert [("angles" in row) for row in rows] == [True] * 10 + [False] * 4
    assert any(words == frames.SAME_CAMERA for _, words in session.causes)


def test_moving_snake_gives_no_reference():
    with pytest.raises(ValueError, match="hold the snake still"):
        run([view[6:] for view in film(24)])


def test_no_picture_is_an_error():
    with pytest.raises(ValueError, match="no image"):
        run([[], []])


@pytest.mark.parametrize("planes", [(0, 90), (7, 90), (180, 95), (90, 0), (-80, 170)])
def test_views_that_are_turned_give_the_same_joint_angles(planes):
    pitch, yaw = np.radians(25), np.radians(-31)
    views = []
    for deg in planes:
        quarter = round(deg / 90) % 4
        axis, turned = ("pitch", "yaw")[quarter % 2], deg - 90 * round(deg / 90)
        views.append(View(axis, quarter >= 2, turned))
    seen = [np.arctan(np.tan(pitch) * np.cos(v.plane) + np.tan(yaw) * np.sin(v.plane)) for v in views]
    angles, deviations = solve(views, seen, [0.001, 0.001])
    assert np.allclose(angles, [pitch, yaw]) and (deviations > 0).all()
    with pytest.raises(ValueError, match="not an axis"):
        parse_view("roll")


def folder(path, numbers, marker_id=9):
    path.mkdir()
    rng = np.random.default_rng(4)
    for number in numbers:
        cv2.imwrite(str(path / f"image_{number:04}.png"), scene.image(marker_id, max(0, number - 7), 80, rng))
    return path


def test_folder_reports_missing_and_damaged_files(tmp_path):
    path = folder(tmp_path / "top", [3, 4, 6, 7])
    whole = (path / "image_0007.png").read_bytes()
    (path / "image_0007.png").write_bytes(whole[: len(whole) // 2])
    group = list(frames.folder(path, 30.0))
    assert [frame.cause for frame in group] == [None, None, frames.MISSING, None, frames.UNDECODABLE]
    assert group[3].stamp_ns == 100_000_000
    with pytest.raises(ValueError, match="no PNG or JPEG"):
        list(frames.folder(tmp_path))


def test_the_command_writes_the_columns_of_the_other_tool(tmp_path, capsys):
    top, side = folder(tmp_path / "top", range(12)), folder(tmp_path / "side", range(12), 14)
    live = tmp_path / "live.png"
    markers.run(markers.parser().parse_args([str(top), str(side), "--rest-s", "0.2", "--picture", str(live)]))
    assert cv2.imread(str(live)).shape[1] == 2 * cv2.imread(str(top / "image_0000.png")).shape[1]
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "t_s,pitch_deg,yaw_deg,pitch_std_deg,yaw_std_deg,quality,tip_along_mm,tip_pitch_mm,tip_yaw_mm,cause"
    assert len(lines) == 13
    cells = lines[12].split(",")
    assert cells[0] == "0.366666667" and abs(float(cells[1]) - 4.0) < 0.2 and cells[6:] == ["", "", "", ""]
    markers.run(markers.parser().parse_args([str(side), "--ids", "14", "--axes=-yaw", "--rest-s", "0.2"]))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "t_s,yaw_deg,yaw_std_deg,quality,tip_along_mm,tip_yaw_mm,cause"
    assert abs(float(lines[12].split(",")[1]) + 4.0) < 0.2


@pytest.mark.parametrize("words, reason", [
    (["{top}", "--ids", "10"], "seen in 0 images at rest"),
    (["{top}", "--publish"], "numbers of cameras"),
    (["{top}", "{top}", "--axes", "pitch", "pitch"], "same axis"),
    (["{top}", "{top}", "{top}"], "one or two"),
])
def test_wrong_use_is_refused_with_a_reason(tmp_path, words, reason):
    top = folder(tmp_path / "top", range(8))
    arguments = markers.parser().parse_args([word.format(top=top) for word in words])
    with pytest.raises(ValueError, match=reason):
        markers.run(arguments)


class Driver:
    """A capture of OpenCV whose driver stamps buffers; each grab is a stamp, ms, or None: no such property."""

    def __init__(self, backend, stamps_ms):
        self.backend, self.stamps_ms = backend, list(stamps_ms)

    def getBackendName(self):
        return self.backend

    def get(self, name):
        assert name == cv2.CAP_PROP_POS_MSEC
        return self.stamps_ms.pop(0)

    def isOpened(self):
        return True

    def grab(self):
        """Unplugged, if no stamp is left."""
        return bool(self.stamps_ms)


def test_stamps_come_from_the_driver_and_lost_frames_are_counted():
    exposed = [1000.0, 1033.3, 1066.7, 1166.7, 1200.0]  # two lost between the third and the fourth
    clock = frames.CameraClock(Driver("V4L2", exposed))
    stamps = [clock.stamp_ns(round(1e6 * ms) + 41_000_000) for ms in exposed]
    assert stamps == [round(1e6 * ms) for ms in exposed] and clock.cause is None and clock.lost == 2


@pytest.mark.parametrize("backend, stamp_ms, words", [
    ("V4L2", 1.7e12, "different clock"),  # Unix time
    ("V4L2", 0.0, "different clock"),  # no stamps
    ("V4L2", -1.0, "different clock"),
    ("FFMPEG", 5000.0, "FFMPEG has no stamps"),
])
def test_missing_driver_stamps_are_replaced_and_reported(backend, stamp_ms, words):
    clock = frames.CameraClock(Driver(backend, [stamp_ms] * 3))
    arrived = [5_000_000_000, 5_033_000_000, 5_066_000_000]
    assert [clock.stamp_ns(at) for at in arrived] == arrived
    assert words in clock.cause and clock.lost == 0


def test_pause_of_this_program_does_not_change_the_clock():
    exposed, waited_ns = [1000.0, 1033.3, 4500.0], [41_000_000, 3_400_000_000, 41_000_000]
    clock = frames.CameraClock(Driver("V4L2", exposed))
    stamps = [clock.stamp_ns(round(1e6 * ms) + waited) for ms, waited in zip(exposed, waited_ns)]
    assert stamps == [round(1e6 * ms) for ms in exposed] and clock.cause is None


def test_unplugged_camera_is_asked_again_after_the_time_of_a_frame(monkeypatch):
    slept = []
    monkeypatch.setattr(frames.cv2, "VideoCapture", lambda *_: Driver("V4L2", []))
    monkeypatch.setattr(frames.time, "sleep", slept.append)
    groups = frames.cameras([0, 1])
    for count in (1, 2):
        assert [frame.cause for frame in next(groups)] == [frames.NO_IMAGE] * 2
        assert slept == [frames.NO_IMAGE_S] * count


def test_pairs_need_stamps_that_are_near():
    frame = lambda ms: frames.Frame(ms * 1_000_000, "", None)
    seen = list(frames.pairs(iter([frame(0), frame(33), frame(66)]), iter([frame(2), frame(65)]), 12_000_000))
    assert [[s and s.stamp_ns // 1_000_000 for s in pair] for pair in seen] == [[0, 2], [33, None], [66, 65]]


def test_rows_without_angles_leave_their_cells_empty():
    to = io.StringIO()
    table = markers.Table(to, [View("pitch"), View("yaw")])
    table.row({"stamp_ns": 12_000_000_001, "cause": "top: frozen, or so"})
    assert to.getvalue().splitlines()[1] == "12.000000001,,,,,,,,,top: frozen  or so"
    assert len(list(itertools.chain(*[line.split(",") for line in to.getvalue().splitlines()]))) == 20

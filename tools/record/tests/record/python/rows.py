import sys
from pathlib import Path
from i2ris.lerobot import plan
has_pictures = sys.argv[2] == "pictures"
found = plan(Path(sys.argv[1]), 25)
assert found.fps == 25 and found.views == (["top"] if has_pictures else []), found.views
assert found.splits() == {"train": "0:1", "recovery": "1:2", "failure": "2:3"}, found.splits()
assert [it["why"] for it in found.left_out] == ["aborted"], found.left_out
assert [trial.about["task"] for trial, _, _ in found.episodes] == ["reach"] * 3
late = 0
for trial, part, rows in found.episodes:
    # Without pictures, the last instant also has a row.
    assert part == 1 and len(rows) == (50 if has_pictures else 51), len(rows)
    for frame, row in enumerate(rows):
        # The state is that of the exposure, shown by the jitter.
        jitter, = row["observation.meta.jitter_s"]
        t = frame / 25 + jitter
        late += jitter > 0.003
        expected = [0.1 * t, -0.1 * t, 0.01, 0.02, 1, 1000 * t, 7]
        for value, known in zip(row["observation.state"], expected, strict=True):
            assert abs(value - known) < 1e-3, (frame, row, t)
        assert abs(row["action"][0] - 0.1 * t) < 1e-5
        # The hand's view: pitch is up, yaw is right.
        right, up = row["action.tip_motion"]
        is_last = frame == len(rows) - 1
        assert right == up == 0 if is_last else right > 0 and up > 0, (frame, right, up)
        seen = row["ground_truth.camera"]
        assert abs(seen[0] - 0.1 * t - 0.5) < 1e-5 and seen[2] == 1, (t, seen)
        assert row["observation.meta.model_id"] == "ab" * 32
        assert row["observation.meta.clutch"] == ("open" if t < 0.5 else "closed"), (t, row)
        assert row["observation.meta.stamp_ns"] == 1_000_000_000 + round(1e9 * t), (t, row)
        if has_pictures:
            file = row["observation.images.top"]
            assert abs(float(file.stem) - t) < 1e-6 and file.read_bytes()[:2] == b"\xff\xd8", file
assert late == (30 if has_pictures else 0), late

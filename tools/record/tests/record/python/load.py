import sys
from importlib.metadata import version
from lerobot.datasets.lerobot_dataset import LeRobotDataset
root, has_pictures = sys.argv[1], sys.argv[2] == "pictures"
rows = 50 if has_pictures else 51
dataset = LeRobotDataset("i2ris/test", root=root, video_backend="pyav")
assert dataset.num_episodes == 3 and dataset.fps == 25, (dataset.num_episodes, dataset.fps)
assert dataset.num_frames == len(dataset) == 3 * rows, len(dataset)
meta = dataset.meta
assert meta.info["splits"] == {"train": "0:1", "recovery": "1:2", "failure": "2:3"}
assert meta.stats["observation.state"]["max"].shape == (7,)
for index in range(len(dataset)):
    row = dataset[index]
    frame = index % rows
    assert int(row["episode_index"]) == index // rows and int(row["frame_index"]) == frame
    assert abs(float(row["timestamp"]) - frame / 25) < 1e-6
    t = frame / 25 + float(row["observation.meta.jitter_s"])
    assert abs(float(row["action"][0]) - 0.1 * t) < 1e-5
    assert int(row["observation.meta.stamp_ns"]) >= 1_000_000_000
    assert row["observation.meta.model_id"] == "ab" * 32
    assert row["task"] == "reach (with)"
    if has_pictures:
        picture = row["observation.images.top"]
        assert tuple(picture.shape) == (3, 48, 64), picture.shape
        assert abs(255 * float(picture.mean()) - frame) < 3, (frame, 255 * float(picture.mean()))
print("lerobot", version("lerobot"), "read", len(dataset), "rows")

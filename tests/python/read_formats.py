#!/usr/bin/env python3
"""Reads what tests/python_formats.rs converted, with pyarrow, pandas and mcap, as LeRobot and Foxglove do.

    read_formats.py FOLDER

Step t of channel c in episode e is 16 e + t / 4 + c / 32. Where the packages
datasets and lerobot are installed, they load the data set.
Exit code 0: all is as it should be. 1: it is not.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
from mcap.reader import make_reader

LENGTHS = [30, 20, 25]


def state(episode, steps):
    t, c = np.arange(steps)[:, None], np.arange(3)[None, :]
    return 16 * episode + t / 4 + c / 32


def lerobot(folder):
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"]) == ("v3.0", 50), info
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, sum(LENGTHS), 1), info
    assert info["features"]["observation.state"]["names"] == ["shoulder", "elbow", "gripper"], info
    table = pq.read_table(folder / info["data_path"].format(chunk_index=0, file_index=0))
    for name, feature in info["features"].items():
        kind = table.schema.field(name).type
        many = feature["shape"] != [1]
        found = str(kind.value_type if many else kind).replace("double", "float64").replace("float", "float32")
        assert found.replace("float3264", "float64") == feature["dtype"], (name, kind, feature)
    frame = table.to_pandas()
    assert frame["index"].tolist() == list(range(sum(LENGTHS)))
    for e, steps in enumerate(LENGTHS):
        rows = frame[frame["episode_index"] == e]
        assert rows["frame_index"].tolist() == list(range(steps))
        assert np.array_equal(np.stack(rows["observation.state"].to_list()), state(e, steps))
        assert np.array_equal(rows["action"].to_numpy(), -state(e, steps)[:, 0])
        assert np.abs(rows["timestamp"] - np.arange(steps) / 50).max() < 1e-6
    assert pq.ParquetFile(folder / "data/chunk-000/file-000.parquet").num_row_groups == len(LENGTHS)
    tasks = pd.read_parquet(folder / "meta/tasks.parquet")
    assert tasks.index.tolist() == ["wave the arm"] and tasks["task_index"].tolist() == [0], tasks
    episodes = pq.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [one["length"] for one in episodes] == LENGTHS
    assert [(one["dataset_from_index"], one["dataset_to_index"]) for one in episodes] == [(0, 30), (30, 50), (50, 75)]
    assert episodes[1]["tasks"] == ["wave the arm"] and episodes[1]["data/file_index"] == 0
    stats = json.loads((folder / "meta/stats.json").read_text())["observation.state"]
    whole = np.concatenate([state(e, steps) for e, steps in enumerate(LENGTHS)])
    for name, value in [("min", whole.min(0)), ("max", whole.max(0)), ("mean", whole.mean(0)), ("std", whole.std(0))]:
        assert np.allclose(stats[name], value, rtol=1e-12), (name, stats, value)
    assert stats["count"] == [sum(LENGTHS)]


def with_datasets(folder):
    """Loads the frames as LeRobot does: through Hugging Face's datasets, held to the features of info.json."""
    try:
        import datasets
    except ImportError:
        return "not installed"
    features = {}
    for name, feature in json.loads((folder / "meta/info.json").read_text())["features"].items():
        value = datasets.Value(dtype=feature["dtype"])
        many = feature["shape"] != [1]
        features[name] = datasets.Sequence(length=feature["shape"][0], feature=value) if many else value
    paths = [str(path) for path in sorted((folder / "data").glob("*/*.parquet"))]
    with tempfile.TemporaryDirectory() as cache:
        data = datasets.Dataset.from_parquet(paths, features=datasets.Features(features), cache_dir=cache)
        assert len(data) == sum(LENGTHS)
        assert data[31]["observation.state"] == state(1, 20)[1].tolist() and data[31]["action"] == -state(1, 20)[1, 0]
        paths = [str(path) for path in sorted((folder / "meta/episodes").glob("*/*.parquet"))]
        assert datasets.Dataset.from_parquet(paths, cache_dir=cache)[2]["length"] == LENGTHS[2]
    return "loads it"


def with_lerobot(folder):
    try:
        from lerobot.datasets.lerobot_dataset import LeRobotDataset
    except ImportError:
        return "not installed"
    data = LeRobotDataset("scrnn/test", root=folder)
    assert (len(data), data.num_episodes, data.fps) == (sum(LENGTHS), 3, 50), data
    item = data[31]
    assert item["task"] == "wave the arm" and item["episode_index"] == 1, item
    assert np.array_equal(item["observation.state"].numpy(), state(1, 20)[1]), item
    return "loads it"


def recording(path):
    with open(path, "rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary.statistics.message_count == sum(LENGTHS) + len(LENGTHS), summary
        found, last = [], None
        for schema, channel, message in reader.iter_messages():
            text = json.loads(message.data)
            if channel.topic == "/sequence":
                found.append([])
                continue
            assert (channel.topic, schema.name, schema.encoding) == ("/joint_states", "foxglove.JointStates", "jsonschema")
            stamp = text["timestamp"]["sec"] * 10**9 + text["timestamp"]["nsec"]
            assert stamp == message.log_time and (last is None or stamp > last)
            last = stamp
            found[-1].append({joint["name"]: joint["position"] for joint in text["joints"]})
    assert [len(one) for one in found] == LENGTHS
    assert found[1][4]["observation.state.gripper"] == state(1, 20)[4, 2]


def main():
    folder = Path(sys.argv[1])
    lerobot(folder / "lerobot")
    recording(folder / "arm.mcap")
    frame = pd.read_csv(folder / "arm.csv")
    assert np.array_equal(frame["observation.state.elbow"][30:50], state(1, 20)[:, 1])
    frames = pd.read_parquet(folder / "frames.parquet")
    assert len(frames) == sum(LENGTHS)
    print("datasets:", with_datasets(folder / "lerobot"))
    print("lerobot:", with_lerobot(folder / "lerobot"))


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""Writes movements that a network can learn, with software that is not ours, as people have them.

    write_movements.py FOLDER

bags/wave, bags/circle   ROS 2 bags by rosbags: JointState at 100 Hz, the joints in another order in each message, and a
                         Float64MultiArray at 30 Hz
set                      a LeRobot data set (v3.0) by pyarrow, three episodes
demos.hdf5               demonstrations as robomimic has them, by h5py
"""

import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rosbags.rosbag2 import StoragePlugin, Writer

from write_formats import info
from write_recordings import BEGIN, STORE, T, header

JOINTS = ["shoulder", "elbow"]


def angles(seconds, movement):
    """Shoulder and elbow of a movement at these times, with a little noise of their own."""
    seconds = np.asarray(seconds)
    speed, phase = [(5.0, 0.0), (5.0, 1.8), (9.0, 0.7)][movement]
    random = np.random.default_rng(movement)
    noise = random.normal(size=(len(seconds), 2)) * 0.02
    return np.stack([0.9 * np.sin(speed * seconds), 1.2 + 0.6 * np.cos(speed * seconds + phase)], axis=1) + noise


def bag(path, movement):
    random = np.random.default_rng(10 + movement)
    messages = []
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        joints = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=STORE)
        touch = writer.add_connection("/touch", "std_msgs/msg/Float64MultiArray", typestore=STORE)
        for k, values in enumerate(angles(np.arange(400) / 100, movement)):
            time, order = BEGIN + 10_000_000 * k, random.permutation(2)
            message = T["sensor_msgs/msg/JointState"](
                header=header(time),
                name=[JOINTS[i] for i in order],
                position=values[order].copy(),
                velocity=np.zeros(2),
                effort=np.full(2, np.nan),
            )
            messages.append((time, joints, STORE.serialize_cdr(message, "sensor_msgs/msg/JointState")))
        for k in range(121):
            time = BEGIN + 33_333_333 * k
            dimension = T["std_msgs/msg/MultiArrayDimension"](label="touch", size=2, stride=2)
            layout = T["std_msgs/msg/MultiArrayLayout"](dim=[dimension], data_offset=0)
            data = np.array([np.sin(0.17 * k), 0.5 * np.cos(0.17 * k)])
            message = T["std_msgs/msg/Float64MultiArray"](layout=layout, data=data)
            messages.append((time, touch, STORE.serialize_cdr(message, "std_msgs/msg/Float64MultiArray")))
        for time, connection, data in sorted(messages, key=lambda entry: entry[0]):
            writer.write(connection, time, data)


def lerobot(folder, lengths):
    rows = [angles(np.arange(n) / 50, e).astype(np.float32) for e, n in enumerate(lengths)]
    frame = np.concatenate([np.arange(n) for n in lengths])
    episode = np.concatenate([np.full(n, e) for e, n in enumerate(lengths)])
    values = np.concatenate(rows)
    lists = lambda part: pa.FixedSizeListArray.from_arrays(pa.array(part.reshape(-1)), 2)
    table = pa.table(
        {
            "observation.state": lists(values),
            "action": lists(np.roll(values, -1, axis=0)),
            "timestamp": pa.array((frame / 50).astype(np.float32)),
            "frame_index": pa.array(frame),
            "episode_index": pa.array(episode),
            "index": pa.array(np.arange(len(frame))),
            "task_index": pa.array(np.zeros(len(frame), np.int64)),
        }
    )
    (folder / "meta").mkdir(parents=True)
    about = info("v3.0", JOINTS)
    for name in ["observation.state", "action"]:
        about["features"][name] = {"dtype": "float32", "shape": [2], "names": JOINTS}
    del about["features"]["next.done"], about["features"]["observation.images.top"]
    (folder / "meta/info.json").write_text(json.dumps(about))
    (folder / "data/chunk-000").mkdir(parents=True)
    pq.write_table(table, folder / "data/chunk-000/file-000.parquet", compression="snappy")


def robomimic(path, lengths):
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        data.attrs["env_args"] = json.dumps({"env_name": "Lift", "env_kwargs": {"control_freq": 20}})
        for e, n in enumerate(lengths):
            values = angles(np.arange(n) / 40, e)
            demo = data.create_group(f"demo_{e}")
            demo.attrs["num_samples"] = n
            demo.create_dataset("actions", data=np.vstack([values[1:], values[-1:]]))
            demo.create_dataset("dones", data=np.zeros(n, np.int64))
            obs = demo.create_group("obs")
            obs.create_dataset("robot0_joint_pos", data=values)
            obs.create_dataset("agentview_image", data=np.zeros((n, 4, 4, 3), np.uint8))


def main():
    folder = Path(sys.argv[1])
    (folder / "bags").mkdir()
    bag(folder / "bags/circle", 0)
    bag(folder / "bags/wave", 2)
    lerobot(folder / "set", [120, 100, 140])
    robomimic(folder / "demos.hdf5", [110, 130, 90])


main()

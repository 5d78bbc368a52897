#!/usr/bin/env python3
"""Writes LeRobot data sets, HDF5 files, MATLAB files and parquet tables with the libraries that people use for them.

    write_formats.py FOLDER

The numbers follow one rule, so that whoever reads knows what to find: in demonstration or episode e, step t, channel c
of a state is 16 e + t / 4 + c / 32, which a float32 holds exactly; an action is its negative.
"""

import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import scipy.io

JOINTS = ["shoulder", "elbow", "gripper"]


def state(episode, steps, channels=3, kind=np.float32):
    t, c = np.arange(steps)[:, None], np.arange(channels)[None, :]
    return (16 * episode + t / 4 + c / 32).astype(kind)


def frames(lengths, first=0, kind=np.float32, fixed=False):
    """The rows of a LeRobot data file as an arrow table."""
    rows = [state(first + e, n, kind=kind) for e, n in enumerate(lengths)]
    values = np.concatenate(rows)
    flat = pa.array(values.reshape(-1))
    if fixed:
        lists = pa.FixedSizeListArray.from_arrays(flat, 3)
        actions = pa.FixedSizeListArray.from_arrays(pa.array(-values.reshape(-1)), 3)
    else:
        ends = pa.array(np.arange(0, 3 * len(values) + 1, 3), pa.int32())
        lists = pa.ListArray.from_arrays(ends, flat)
        actions = pa.ListArray.from_arrays(ends, pa.array(-values.reshape(-1)))
    frame = np.concatenate([np.arange(n) for n in lengths])
    episode = np.concatenate([np.full(n, first + e) for e, n in enumerate(lengths)])
    columns = {
        "observation.state": lists,
        "action": actions,
        "timestamp": pa.array((frame / 50).astype(np.float32)),
        "frame_index": pa.array(frame),
        "episode_index": pa.array(episode),
        "index": pa.array(np.arange(len(frame))),
        "task_index": pa.array(np.zeros(len(frame), np.int64)),
        "next.done": pa.array(frame == 0),
    }
    return pa.table(columns)


def info(version, names):
    one = {"dtype": "int64", "shape": [1], "names": None}
    vector = {"dtype": "float32", "shape": [3], "names": names}
    return {
        "codebase_version": version,
        "robot_type": "arm",
        "fps": 50,
        "features": {
            "action": vector,
            "observation.state": vector,
            "observation.images.top": {"dtype": "video", "shape": [48, 64, 3], "names": ["height", "width", "channels"]},
            "timestamp": {"dtype": "float32", "shape": [1], "names": None},
            "frame_index": one,
            "episode_index": one,
            "index": one,
            "task_index": one,
            "next.done": {"dtype": "bool", "shape": [1], "names": None},
        },
    }


def lerobot(folder):
    three = folder / "lerobot_v3"
    (three / "meta").mkdir(parents=True)
    (three / "meta/info.json").write_text(json.dumps(info("v3.0", JOINTS), indent=4))
    for chunk, file, lengths, first in [(0, 0, [5, 4], 0), (0, 1, [6], 2), (1, 0, [3, 7], 3)]:
        path = three / f"data/chunk-{chunk:03d}/file-{file:03d}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(frames(lengths, first), path, compression="snappy", use_dictionary=True)
    two = folder / "lerobot_v2"
    (two / "meta").mkdir(parents=True)
    (two / "meta/info.json").write_text(json.dumps(info("v2.1", {"motors": JOINTS})))
    (two / "data/chunk-000").mkdir(parents=True)
    for e in range(12):
        pq.write_table(frames([3 + e], e), two / f"data/chunk-000/episode_{e:06d}.parquet")


def parquet(folder):
    folder.mkdir()
    lengths = [10, 12, 8]
    ways = {
        "snappy": {},
        "plain": dict(compression="none", use_dictionary=False),
        "gzip": dict(compression="gzip"),
        "zstd": dict(compression="zstd"),
        "lz4": dict(compression="lz4"),
        "v2": dict(data_page_version="2.0"),
        "v2_plain": dict(data_page_version="2.0", compression="none", use_dictionary=False),
        "pages": dict(data_page_size=64, row_group_size=7, write_batch_size=4),
        "old": dict(version="1.0", use_compliant_nested_type=False),
        "split": dict(use_dictionary=False, use_byte_stream_split=True),
        "delta": dict(
            use_dictionary=False,
            column_encoding={c: "DELTA_BINARY_PACKED" for c in ["frame_index", "episode_index", "index", "task_index"]},
        ),
    }
    for name, how in ways.items():
        table = frames(lengths)
        if name == "split":
            keep = ["observation.state", "action", "timestamp", "frame_index", "episode_index"]
            table = table.select(keep)
        pq.write_table(table, folder / f"{name}.parquet", **how)
    for name, kind in [("double", np.float64), ("half", np.float16)]:
        pq.write_table(frames(lengths, kind=kind), folder / f"{name}.parquet")
    pq.write_table(frames(lengths, fixed=True), folder / "fixed.parquet")
    pq.write_table(frames(lengths), folder / "brotli.parquet", compression="brotli")
    # Missing: a value, a whole list, and an empty one.
    rows = [list(map(float, row)) for row in state(0, 6)]
    rows[1][2], rows[2], rows[3] = None, None, []
    table = pa.table(
        {
            "observation.state": pa.array(rows, pa.list_(pa.float32())),
            "episode_index": pa.array([0, 0, 0, 0, 1, 1], pa.uint8()),
            "reward": pa.array([1.0, None, 3.0, None, None, 6.0]),
            "stamp": pa.array([0, 1, 2, 3, 4, 5], pa.timestamp("us")),
            "task": pa.array(list("abcdef")),
        }
    )
    pq.write_table(table, folder / "missing.parquet")


def hdf5(folder):
    folder.mkdir()
    lengths = [4 + e for e in range(12)]
    for name, how, libver in [
        ("robomimic", {}, "earliest"),
        ("robomimic_new", {}, "latest"),
        ("robomimic_gzip", dict(compression="gzip", shuffle=True, chunks=(3, 2), fletcher32=True), "earliest"),
        ("robomimic_gzip_new", dict(compression="gzip", shuffle=True, chunks=(3, 2)), "latest"),
        ("robomimic_grown", dict(maxshape=(None, 3), chunks=(3, 2)), "latest"),
        ("robomimic_grown_both", dict(maxshape=(None, None), chunks=(3, 2)), "latest"),
        ("robomimic_one_chunk", dict(chunks=True, compression="gzip"), "latest"),
        ("robomimic_lzf", dict(compression="lzf"), "earliest"),
    ]:
        with h5py.File(folder / f"{name}.hdf5", "w", libver=libver) as file:
            data = file.create_group("data")
            data.attrs["env_args"] = json.dumps({"env_name": "Lift", "env_kwargs": {"control_freq": 20}})
            data.attrs["total"] = sum(lengths)
            for e, n in enumerate(lengths):
                demo = data.create_group(f"demo_{e}")
                demo.attrs["num_samples"] = n
                demo.create_dataset("actions", data=-state(e, n, kind=np.float64), **how)
                demo.create_dataset("rewards", data=np.zeros(n))
                demo.create_dataset("dones", data=np.zeros(n, np.int64))
                demo.create_dataset("states", data=np.zeros((n, 32)))
                obs = demo.create_group("obs")
                obs.create_dataset("robot0_joint_pos", data=state(e, n, kind=np.float64), **how)
                obs.create_dataset("robot0_gripper_qpos", data=state(e, n, channels=2), **({} if "chunks" not in how else {}))
                obs.create_dataset("agentview_image", data=np.zeros((n, 4, 4, 3), np.uint8))
            mask = file.create_group("mask")
            mask.create_dataset("train", data=np.array([f"demo_{e}" for e in range(12)], dtype="S"))
    for e in range(2):
        with h5py.File(folder / f"episode_{e}.hdf5", "w", rdcc_nbytes=1024**2 * 2) as file:
            file.attrs["sim"] = True
            obs = file.create_group("observations")
            images = obs.create_group("images")
            images.create_dataset("top", (9, 4, 4, 3), dtype="uint8", chunks=(1, 4, 4, 3))
            obs.create_dataset("qpos", (9, 3))[...] = state(e, 9)
            obs.create_dataset("qvel", (9, 3))[...] = state(e, 9) * 2
            file.create_dataset("action", (9, 3))[...] = -state(e, 9)
    with h5py.File(folder / "types.h5", "w", userblock_size=512) as file:
        for kind in "<f2 <f4 <f8 >f2 >f4 >f8 <i1 <i2 <i4 <i8 >i2 >i4 >i8 <u1 <u2 <u4 <u8 >u2".split():
            name = kind.replace("<", "little_").replace(">", "big_")
            file.create_dataset(f"kinds/{name}", data=np.arange(-3 if kind[1] != "u" else 0, 4).astype(kind))
        file.create_dataset("kinds/bool", data=np.array([True, False, True]))
        file.create_dataset("scalar", data=3.0)
        file.create_dataset("empty", data=np.zeros((0, 3)))
        file.create_dataset("text", data="words")
        file.create_dataset("compound", data=np.zeros(3, [("a", "f4"), ("b", "i2")]))
        file.create_dataset("filled", (5, 2), dtype="f4", fillvalue=2.5, chunks=(2, 2))
        file["filled"][0, 0] = 1.0
        compact = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        compact.set_layout(h5py.h5d.COMPACT)
        space = h5py.h5s.create_simple((3, 2))
        made = h5py.h5d.create(file.id, b"compact", h5py.h5t.IEEE_F64LE, space, compact)
        made.write(h5py.h5s.ALL, h5py.h5s.ALL, np.arange(6.0).reshape(3, 2))
        file["soft"] = h5py.SoftLink("/compact")
        file["outside"] = h5py.ExternalLink("other.h5", "/x")
    with h5py.File(folder / "many.h5", "w") as file:
        # Enough links for a tree of two levels, and enough chunks.
        for k in range(200):
            file.create_dataset(f"run_{k}/q", data=state(k, 3))
        file.create_dataset("long", data=state(0, 3000), chunks=(4, 3))
    with h5py.File(folder / "many_new.h5", "w", libver="latest", track_order=True) as file:
        for k in range(200):
            file.create_dataset(f"run_{k}/q", data=state(k, 3))
        file.create_dataset("long", data=state(0, 3000), chunks=(4, 3))
        file.create_dataset("grown", data=state(0, 3000), chunks=(4, 3), maxshape=(None, 3))
        file.create_dataset("grown_gzip", data=state(0, 3000), chunks=(4, 3), maxshape=(None, 3), compression="gzip")
        file.create_dataset("grown_both", data=state(0, 300), chunks=(4, 2), maxshape=(None, None))
        file.create_dataset("grown_both_gzip", data=state(0, 300), chunks=(4, 2), maxshape=(None, None), compression="gzip")
        file.create_dataset("packed", data=state(0, 3000), chunks=(4, 3), compression="gzip")


    # Small files, which are kept beside the reader.
    for name, libver in [("small", "earliest"), ("small_new", "latest")]:
        with h5py.File(folder / f"{name}.hdf5", "w", libver=libver) as file:
            file.create_group("data").attrs["env_args"] = json.dumps({"env_kwargs": {"control_freq": 20}})
            for e, n in enumerate(lengths[:3]):
                demo = file["data"].create_group(f"demo_{e}")
                how = [{}, dict(chunks=(3, 2), compression="gzip", shuffle=True), dict(chunks=(2, 3), maxshape=(None, 3))][e]
                demo.create_dataset("actions", data=-state(e, n), **how)
                demo.create_dataset("obs/robot0_joint_pos", data=state(e, n), **how)
                demo.create_dataset("obs/robot0_gripper_qpos", data=state(e, n, 2))
    with h5py.File(folder / "indexes.h5", "w", libver="latest") as file:
        q = state(0, 40)
        file.create_dataset("fixed", data=q, chunks=(4, 2))
        file.create_dataset("fixed_gzip", data=q, chunks=(4, 2), compression="gzip")
        file.create_dataset("grown", data=q, chunks=(1, 2), maxshape=(None, 3))
        file.create_dataset("grown_last", data=q, chunks=(2, 1), maxshape=(40, None))
        file.create_dataset("grown_gzip", data=q, chunks=(1, 2), maxshape=(None, 3), compression="gzip")
        file.create_dataset("grown_both", data=q, chunks=(4, 2), maxshape=(None, None))
        file.create_dataset("grown_both_gzip", data=q, chunks=(4, 2), maxshape=(None, None), compression="gzip")
        file.create_dataset("single", data=q, chunks=(40, 3))
        file.create_dataset("single_gzip", data=q, chunks=(40, 3), compression="gzip")
        file.create_dataset("shrunk", data=q, chunks=(4, 2), maxshape=(60, 3))
        how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        how.set_chunk((4, 2))
        how.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        space = h5py.h5s.create_simple((40, 3))
        h5py.h5d.create(file.id, b"implicit", h5py.h5t.IEEE_F32LE, space, how).write(h5py.h5s.ALL, h5py.h5s.ALL, q)
    with h5py.File(folder / "axes.h5", "w") as file:
        file["sideways"] = state(0, 20).T
        file["block"] = np.stack([state(0, 5), state(1, 5)])
    with h5py.File(folder / "flags.h5", "w") as file:
        file["observations"] = state(0, 12)
        file["actions"] = -state(0, 12)
        file["rewards"] = np.zeros(12)
        file["terminals"] = np.arange(12) == 3
        file["timeouts"] = np.arange(12) == 9
    # Three recordings of a day each, some way down.
    with h5py.File(folder / "dates.h5", "w") as file:
        for e, day in enumerate(["2024-01-30", "2024-01-31", "2024-02-01"]):
            file[f"recordings/{day}/arm/q"] = state(e, 8)
            file[f"recordings/{day}/arm/names"] = np.array(JOINTS, dtype="S8")
    # Joints side by side, each in a group of its own.
    with h5py.File(folder / "joints.h5", "w") as file:
        for c in range(3):
            file[f"arm/joint_{c}/position"] = state(0, 8)[:, c]
    # A state more than actions, as simulators write it.
    with h5py.File(folder / "one_more.h5", "w") as file:
        for e in range(3):
            file[f"traj_{e}/obs/agent/qpos"] = state(e, 7 + e)
            file[f"traj_{e}/actions"] = -state(e, 6 + e)
    # Points in space: steps x points x 3.
    with h5py.File(folder / "points.h5", "w") as file:
        t, c = np.arange(40)[:, None], np.arange(12)[None, :]
        file["pose"] = (100 * ((7 * c) % 12) + np.sin(t / 5 + c)).reshape(40, 4, 3).astype(np.float32)
    # How pandas' to_hdf lays out a table (its default format).
    with h5py.File(folder / "pandas.h5", "w") as file:
        table = file.create_group("df")
        table["axis0"] = np.array(JOINTS, dtype="S8")
        table["axis1"] = np.arange(9)
        table["block0_items"] = np.array(JOINTS, dtype="S8")
        table["block0_values"] = state(0, 9, kind=np.float64)
    with h5py.File(folder / "matlab.mat", "w", userblock_size=512) as file:
        file["q"] = state(0, 20, kind=np.float64).T
        file["q"].attrs["MATLAB_class"] = np.bytes_("double")
        file.create_group("#refs#")["a"] = np.zeros((3, 3))
    with open(folder / "matlab.mat", "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def matlab(folder):
    folder.mkdir()
    for name, how in [("packed", dict(do_compression=True)), ("plain", {})]:
        scipy.io.savemat(
            folder / f"{name}.mat",
            {
                "q": state(0, 20, kind=np.float64),
                "dq": state(1, 20),
                "t": np.arange(20.0)[:, None] / 50,
                "fs": 50.0,
                "names": np.array(JOINTS, dtype=object),
                "info": {"subject": "one", "trial": 3},
                "counts": np.arange(20, dtype=np.int16)[:, None],
            },
            **how,
        )
    scipy.io.savemat(folder / "sideways.mat", {"q": state(0, 20, kind=np.float64).T})
    scipy.io.savemat(folder / "cells.mat", {"trials": np.array([state(0, 5), state(1, 6)], dtype=object)})
    scipy.io.savemat(folder / "structure.mat", {"s": {"q": state(0, 20), "name": "arm"}})
    scipy.io.savemat(folder / "v4.mat", {"q": state(0, 20, kind=np.float64)}, format="4")


def main():
    folder = Path(sys.argv[1])
    lerobot(folder)
    parquet(folder / "parquet")
    hdf5(folder / "hdf5")
    matlab(folder / "mat")


if __name__ == "__main__":
    main()

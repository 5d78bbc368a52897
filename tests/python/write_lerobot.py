#!/usr/bin/env python3
"""Writes the data set in crates/data/tests/fixtures/lerobot_own with the package lerobot itself.

    write_lerobot.py FOLDER

Run by hand (pip install lerobot) when that changes: lerobot needs torch, which is too heavy for every run of the checks.
FOLDER must not be there. In episode e, step t, channel c of the state is 16 e + t / 4 + c / 32; an action is its negative.
"""

import sys
from pathlib import Path

import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset

JOINTS = ["shoulder", "elbow", "gripper"]
series = {"dtype": "float32", "shape": (3,), "names": JOINTS}
data = LeRobotDataset.create(
    repo_id="nobody/steps",
    fps=50,
    root=Path(sys.argv[1]),
    features={"observation.state": series, "action": series},
    use_videos=False,
)
for episode, steps in enumerate([5, 4, 7]):
    for step in range(steps):
        state = (16 * episode + step / 4 + np.arange(3) / 32).astype(np.float32)
        data.add_frame({"observation.state": state, "action": -state, "task": "count"})
    data.save_episode()
if hasattr(data, "finalize"):
    data.finalize()

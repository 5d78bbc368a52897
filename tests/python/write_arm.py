#!/usr/bin/env python3
"""Writes a recording of an arm as ROS 2 leaves it, sensor_msgs/JointState and nothing else, by software that is not ours.

    write_arm.py FOLDER     arm.urdf, arm.mcap, and hand.json: where the hand is at each message, by forward kinematics of its own
"""

import json
import sys
from pathlib import Path

import numpy as np
from mcap_ros2.writer import Writer

BEGIN = 1_766_147_454_000_000_000
STEP = 20_000_000
COUNT = 150

# A turn, a lift by an axis that is not along a frame's, a slide, and a hand that stands crooked on its link.
JOINTS = [
    ("turn", "revolute", (0.1, -0.2, 0.5), (0.0, 0.0, 0.3), (0.0, 0.0, 1.0)),
    ("lift", "continuous", (0.0, 0.05, 0.2), (0.2, -0.1, 0.0), (0.6, 0.8, 0.0)),
    ("slide", "prismatic", (0.4, 0.0, 0.0), (0.0, 0.4, -0.2), (1.0, 0.0, 0.0)),
]
LINKS = ["base", "shoulder", "upper", "hand"]
PALM = ((0.03, 0.02, -0.01), (0.3, 0.1, -0.5))
MESSAGE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def origin(place, turn):
    words = lambda three: " ".join(str(value) for value in three)
    return f'<origin xyz="{words(place)}" rpy="{words(turn)}"/>'


def urdf():
    out = ['<robot name="crooked">', '<link name="base"><visual><geometry><box size="0.3 0.3 0.1"/></geometry></visual></link>']
    for k, (name, kind, place, turn, axis) in enumerate(JOINTS):
        shape = '<visual><geometry><cylinder radius="0.03" length="0.2"/></geometry></visual>'
        if LINKS[k + 1] == "hand":
            shape = f'<visual>{origin(*PALM)}<geometry><box size="0.1 0.06 0.04"/></geometry></visual>'
        out.append(f'<link name="{LINKS[k + 1]}">{shape}</link>')
        along = " ".join(str(value) for value in axis)
        limit = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'
        ends = f'<parent link="{LINKS[k]}"/><child link="{LINKS[k + 1]}"/>'
        out.append(f'<joint name="{name}" type="{kind}">{ends}{origin(place, turn)}<axis xyz="{along}"/>{limit}</joint>')
    return "\n".join(out + ["</robot>"])


def about(axis, angle):
    """A rotation, by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def pose(place, turn):
    """Roll, pitch and yaw about fixed axes, as URDF has them."""
    out = np.eye(4)
    out[:3, :3] = about((0, 0, 1), turn[2]) @ about((0, 1, 0), turn[1]) @ about((1, 0, 0), turn[0])
    out[:3, 3] = place
    return out


def hand(angles):
    at = np.eye(4)
    for (name, kind, place, turn, axis), angle in zip(JOINTS, angles):
        moved = np.eye(4)
        if kind == "prismatic":
            moved[:3, 3] = np.array(axis) * angle
        else:
            moved[:3, :3] = about(axis, angle)
        at = at @ pose(place, turn) @ moved
    return at @ pose(*PALM)


def main():
    folder = Path(sys.argv[1])
    (folder / "arm.urdf").write_text(urdf(), encoding="utf-8")
    random, truth = np.random.default_rng(5), []
    with open(folder / "arm.mcap", "wb") as file:
        writer = Writer(file)
        schema = writer.register_msgdef("sensor_msgs/msg/JointState", MESSAGE)
        for k in range(COUNT):
            time, phase = BEGIN + STEP * k, 2 * np.pi * k / COUNT
            angles = np.array([1.5 * np.sin(phase), 0.9 * np.cos(2 * phase), 0.1 * np.sin(3 * phase)])
            # Names and values come in any order.
            order = random.permutation(len(JOINTS))
            message = {
                "header": {"stamp": {"sec": time // 10**9, "nanosec": time % 10**9}, "frame_id": "base"},
                "name": [JOINTS[j][0] for j in order], "position": [float(angles[j]) for j in order], "velocity": [], "effort": [],
            }
            writer.write_message(topic="/joint_states", schema=schema, message=message, log_time=time, publish_time=time, sequence=k)
            truth.append({"t": STEP * k / 1e9, "pose": hand(angles)[:3].tolist()})
        writer.finish()
    (folder / "hand.json").write_text(json.dumps(truth), encoding="utf-8")


main()

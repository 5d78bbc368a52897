#!/usr/bin/env python3
"""Writes recordings with software that is not ours, and beside them what should be read from them.

Into the folder that is named: bags by `rosbags` (MCAP and sqlite3, packed and plain, with and without definitions), MCAP
files by `mcap-ros2-support` and `mcap-protobuf-support`, and cases.json, a list of what to read and what must come of it.
"""

import json
import sqlite3
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf import JointState_pb2, JointStates_pb2, Pose_pb2, PoseInFrame_pb2, Quaternion_pb2, Vector3_pb2
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.writer import CompressionType, Writer as McapWriter
from mcap_protobuf.writer import Writer as ProtobufWriter
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

BEGIN = 1_766_147_454_233_218_075
JOINTS = ["shoulder", "elbow", "wrist", "gripper"]

STORE = get_typestore(Stores.ROS2_HUMBLE)
CUSTOM = """
uint8 KIND=3
bool active
uint8 mode
int16 ticks
string label
float32[3] force
float64 angle
uint64 big
Inner[] inner
string<=8[<=3] words
float32[] tail
int8 last
"""
INNER = "int8 a\nfloat64 b\nbool[2] flags\n"
STORE.register(get_types_from_msg(CUSTOM, "our_msgs/msg/Custom") | get_types_from_msg(INNER, "our_msgs/msg/Inner"))
T = STORE.types


def stamp(time):
    return T["builtin_interfaces/msg/Time"](sec=int(time // 1_000_000_000), nanosec=int(time % 1_000_000_000))


def header(time):
    return T["std_msgs/msg/Header"](stamp=stamp(time), frame_id="base")


class Truth:
    """Times and values of all topics, the same in each file."""

    def __init__(self):
        random = np.random.default_rng(3)
        self.times = [BEGIN + 10_000_000 * k for k in range(300)]
        self.joints = random.normal(size=(300, 4))
        self.orders = [random.permutation(4) for _ in range(300)]
        self.slow_times = [BEGIN + 33_333_333 * k for k in range(91)]
        self.array = random.normal(size=(91, 3))
        self.custom = random.integers(-100, 100, size=(50, 8))

    def joint_states(self):
        for time, values, order in zip(self.times, self.joints, self.orders):
            yield time, T["sensor_msgs/msg/JointState"](
                header=header(time),
                name=[JOINTS[k] for k in order],
                position=values[order].copy(),
                velocity=-values[order],
                effort=np.full(4, np.nan),
            )

    def arrays(self):
        dimension = T["std_msgs/msg/MultiArrayDimension"](label="touch", size=3, stride=3)
        layout = T["std_msgs/msg/MultiArrayLayout"](dim=[dimension], data_offset=0)
        for time, values in zip(self.slow_times, self.array):
            yield time, T["std_msgs/msg/Float64MultiArray"](layout=layout, data=values)

    def wide(self):
        layout = T["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
        for k in range(40):
            values = np.arange(k, k + 3000, dtype=float)
            yield BEGIN + 50_000_000 * k, T["std_msgs/msg/Float64MultiArray"](layout=layout, data=values)

    def odometry(self):
        pose, twist = T["geometry_msgs/msg/Pose"], T["geometry_msgs/msg/Twist"]
        point, vector, turn = (T[f"geometry_msgs/msg/{name}"] for name in ("Point", "Vector3", "Quaternion"))
        for k, (time, v) in enumerate(zip(self.times[:100], self.joints)):
            yield time + 7, T["nav_msgs/msg/Odometry"](
                header=header(time),
                child_frame_id="wheel" * (k % 3),
                pose=T["geometry_msgs/msg/PoseWithCovariance"](
                    pose=pose(point(v[0], v[1], 0.0), turn(0.0, 0.0, v[2], v[3])), covariance=np.arange(36.0)
                ),
                twist=T["geometry_msgs/msg/TwistWithCovariance"](
                    twist=twist(vector(v[1], 0.0, 0.0), vector(0.0, 0.0, v[0])), covariance=np.arange(36.0)
                ),
            )

    def customs(self):
        inner = T["our_msgs/msg/Inner"]
        for k, v in enumerate(self.custom):
            yield BEGIN + 20_000_000 * k, T["our_msgs/msg/Custom"](
                active=bool(v[0] > 0),
                mode=int(abs(v[1])),
                ticks=int(v[2]) * 300,
                label="x" * (k % 7),
                force=np.array(v[3:6], dtype=np.float32) / 4,
                angle=v[6] / 3,
                big=int(abs(v[7])) * 10**15,
                inner=[inner(a=int(v[1]), b=v[2] / 7, flags=np.array([True, v[0] > 0])), inner(a=1, b=0.5, flags=np.array([False, False]))],
                words=["w" * (k % 5)] * (k % 3),
                tail=np.array([v[0], v[1]], dtype=np.float32) / 8,
                last=int(v[5]),
            )

    def custom_rows(self):
        return [
            [
                float(v[0] > 0), abs(v[1]), v[2] * 300, v[3] / 4, v[4] / 4, v[5] / 4, v[6] / 3, abs(v[7]) * 10**15,
                v[1], v[2] / 7, 1.0, float(v[0] > 0), 1.0, 0.5, 0.0, 0.0, v[0] / 8, v[1] / 8, v[5],
            ]
            for v in (list(map(int, row)) for row in self.custom)
        ]


CUSTOM_NAMES = [
    "active", "mode", "ticks", "force[0]", "force[1]", "force[2]", "angle", "big", "inner[0].a", "inner[0].b",
    "inner[0].flags[0]", "inner[0].flags[1]", "inner[1].a", "inner[1].b", "inner[1].flags[0]", "inner[1].flags[1]",
    "tail[0]", "tail[1]", "last",
]
TOPICS = {
    "/joint_states": ("sensor_msgs/msg/JointState", Truth.joint_states),
    "/touch": ("std_msgs/msg/Float64MultiArray", Truth.arrays),
    "/odom": ("nav_msgs/msg/Odometry", Truth.odometry),
    "/custom": ("our_msgs/msg/Custom", Truth.customs),
    "/wide": ("std_msgs/msg/Float64MultiArray", Truth.wide),
}


def write_bag(truth, path, plugin, topics, version=9, mode=None, little=True):
    writer = Writer(path, version=version, storage_plugin=plugin)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        messages = []
        for topic in topics:
            name, make = TOPICS[topic]
            connection = writer.add_connection(topic, name, typestore=STORE)
            for time, message in make(truth):
                data = STORE.serialize_cdr(message, name, little_endian=little)
                messages.append((time, connection, data))
        for time, connection, data in sorted(messages, key=lambda entry: entry[0]):
            writer.write(connection, time, data)


def main():
    folder = Path(sys.argv[1])
    truth = Truth()
    cases = []

    def case(file, channels, values, topics=(), period=None, wanted=None, rate=None):
        cases.append({
            "file": file, "topics": list(topics), "period": period, "wanted": wanted, "channels": list(channels),
            "values": np.asarray(values, dtype=float).tolist(), "read_period": rate,
        })

    first = [JOINTS[k] for k in truth.orders[0]]
    by_first = truth.joints[:, truth.orders[0]]
    two = ["/joint_states", "/touch"]

    # rosbags: MCAP and sqlite3, plain and packed, with the bytes in both orders.
    everything = ["/joint_states", "/touch", "/odom", "/custom"]
    write_bag(truth, folder / "mcap", StoragePlugin.MCAP, everything)
    write_bag(truth, folder / "sqlite", StoragePlugin.SQLITE3, everything)
    write_bag(truth, folder / "big", StoragePlugin.SQLITE3, everything, little=False)
    write_bag(truth, folder / "old", StoragePlugin.SQLITE3, ["/joint_states", "/touch", "/odom"], version=8)
    write_bag(truth, folder / "packed", StoragePlugin.MCAP, everything, mode=CompressionMode.STORAGE)
    write_bag(truth, folder / "packed_messages", StoragePlugin.SQLITE3, everything, mode=CompressionMode.MESSAGE)
    write_bag(truth, folder / "alone", StoragePlugin.MCAP, ["/joint_states"])
    write_bag(truth, folder / "wide", StoragePlugin.SQLITE3, ["/wide"])
    # Bags before ROS 2 Iron hold no definitions.
    with closing(sqlite3.connect(folder / "old" / "old.db3")) as database, database:
        database.execute("DROP TABLE message_definitions")
    for bag in ["mcap", "sqlite", "big", "old", "packed", "packed_messages"]:
        case(bag, first, by_first, ["/joint_states"], rate=0.01)
        case(bag, ["data[0]", "data[1]", "data[2]"], truth.array, ["/touch"])
        case(bag, ["elbow", "gripper"], truth.joints[:, [1, 3]], ["/joint_states"], wanted=["elbow", "gripper"])
        case(bag, first, -by_first, ["/joint_states.velocity"], rate=0.01)
        odometry = ["pose.pose.position.y", "twist.twist.angular.z", "pose.covariance[7]"]
        rows = np.column_stack([truth.joints[:100, 1], truth.joints[:100, 0], np.full(100, 7.0)])
        case(bag, odometry, rows, ["/odom"], wanted=odometry)
        # Joined: where the joints are, the touch on straight lines between its messages.
        joined = [time for time in truth.times if truth.slow_times[0] <= time <= truth.slow_times[-1]]
        touch = [np.interp(np.array(joined) - BEGIN, np.array(truth.slow_times) - BEGIN, column) for column in truth.array.T]
        rows = np.column_stack([by_first[: len(joined)], *touch])
        case(bag, first + ["touch[0]", "touch[1]", "touch[2]"], rows, two, rate=0.01)
        if bag != "old":
            case(bag, CUSTOM_NAMES, truth.custom_rows(), ["/custom"], rate=0.02)
    # Messages of more than a page.
    case("wide", ["data[0]", "data[2999]"], [[k, k + 2999] for k in range(40)], wanted=["data[0]", "data[2999]"], rate=0.05)
    case("alone", first, by_first, rate=0.01)
    case("alone/alone.mcap", first, by_first, rate=0.01)
    between = np.repeat(by_first, 2, axis=0)[:-1]
    between[1::2] = (by_first[1:] + by_first[:-1]) / 2
    case("alone", first, between, period=0.005, rate=0.005)

    # mcap-ros2-support, in chunks of lz4 and zstd.
    for name, compression in [("lz4", CompressionType.LZ4), ("zstd", CompressionType.ZSTD), ("none", CompressionType.NONE)]:
        with open(folder / f"{name}.mcap", "wb") as file:
            writer = Ros2Writer(file, compression=compression, chunk_size=20_000)
            text, _ = STORE.generate_msgdef("sensor_msgs/msg/JointState", ros_version=2)
            schema = writer.register_msgdef("sensor_msgs/msg/JointState", text)
            for time, message in truth.joint_states():
                plain = {
                    "header": {"stamp": {"sec": message.header.stamp.sec, "nanosec": message.header.stamp.nanosec}, "frame_id": ""},
                    "name": list(message.name), "position": message.position.tolist(),
                    "velocity": message.velocity.tolist(), "effort": [],
                }
                writer.write_message("/joint_states", schema, plain, log_time=time + 1000, publish_time=time + 500)
            writer.finish()
        case(f"{name}.mcap", first, by_first, rate=0.01)

    # ros2idl: the bytes by rosbags, the definition in the other language.
    idl = """
    module our_msgs { module msg {
      typedef float float__3[3];
      typedef boolean boolean__2[2];
      module Custom_Constants { const uint8 KIND = 3; };
      struct Custom {
        boolean active; uint8 mode; short ticks; string label; float__3 force;
        @unit (value="rad") double angle; unsigned long long big;
        sequence<our_msgs::msg::Inner> inner; sequence<string<8>, 3> words; sequence<float> tail; int8 last;
      };
    }; };
    ================================================================================
    IDL: our_msgs/msg/Inner
    module our_msgs { module msg { typedef boolean boolean__2[2]; struct Inner { int8 a; double b; boolean__2 flags; }; }; };
    """
    with open(folder / "idl.mcap", "wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros2")
        schema = writer.register_schema("our_msgs/msg/Custom", "ros2idl", idl.encode())
        channel = writer.register_channel("/custom", "cdr", schema)
        for time, message in truth.customs():
            writer.add_message(channel, time, bytes(STORE.serialize_cdr(message, "our_msgs/msg/Custom")), time)
        writer.finish()
    case("idl.mcap", CUSTOM_NAMES, truth.custom_rows(), rate=0.02)

    # protobuf. Zeros are not sent.
    with open(folder / "protobuf.mcap", "wb") as file, ProtobufWriter(file) as writer:
        for k, (time, values, order) in enumerate(zip(truth.times, truth.joints, truth.orders)):
            at = Timestamp(seconds=time // 10**9, nanos=time % 10**9)
            joints = [JointState_pb2.JointState(name=JOINTS[j], position=values[j] if k != 5 else 0.0) for j in order]
            message = JointStates_pb2.JointStates(timestamp=at, joints=joints)
            writer.write_message("/joints", message, log_time=time, publish_time=time)
            pose = Pose_pb2.Pose(
                position=Vector3_pb2.Vector3(x=values[0], y=0.0, z=values[1]),
                orientation=Quaternion_pb2.Quaternion(x=0.0, y=0.0, z=values[2], w=values[3]),
            )
            in_frame = PoseInFrame_pb2.PoseInFrame(timestamp=at, frame_id="base", pose=pose)
            writer.write_message("/pose", in_frame, log_time=time, publish_time=time)
    rows = by_first.copy()
    rows[5] = 0.0
    case("protobuf.mcap", first, rows, ["/joints"], rate=0.01)
    names = [f"pose.position.{axis}" for axis in "xyz"] + [f"pose.orientation.{axis}" for axis in "xyzw"]
    zero = np.zeros(300)
    rows = np.column_stack([truth.joints[:, 0], zero, truth.joints[:, 1], zero, zero, truth.joints[:, 2], truth.joints[:, 3]])
    case("protobuf.mcap", names, rows, ["/pose"], rate=0.01)

    (folder / "cases.json").write_text(json.dumps(cases))


if __name__ == "__main__":
    main()

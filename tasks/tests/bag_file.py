"""Reads run.bag.mcap with PyPI's rosbags, as a ROS 2 bag, by the definitions that it holds."""

import pathlib
import sys

from rosbags.highlevel import AnyReader

folder = pathlib.Path(sys.argv[1])
counts, last = {}, {}
with AnyReader([folder / "run.bag.mcap"]) as reader:
    for connection, stamp, data in reader.messages():
        message = reader.deserialize(data, connection.msgtype)
        counts[connection.topic] = counts.get(connection.topic, 0) + 1
        assert stamp >= 0
        last[connection.topic] = (connection.msgtype, message)

kinds = {topic: kind for topic, (kind, _) in last.items()}
assert kinds["/joint_states"] == "sensor_msgs/msg/JointState", kinds
assert kinds["/odom"] == "nav_msgs/msg/Odometry", kinds
assert kinds["/tf"] == "tf2_msgs/msg/TFMessage", kinds
assert kinds["/cmd_vel"] == "geometry_msgs/msg/TwistStamped", kinds
assert kinds["/rosout"] == "rcl_interfaces/msg/Log", kinds
image = last["/camera/head/color/compressed"][1]
assert image.format == "png" and bytes(image.data[:4]) == b"\x89PNG"
joints = last["/joint_states"][1]
assert len(joints.name) == len(joints.position) == len(joints.velocity) > 0
base = last["/amcl_pose"][1].pose.pose.orientation
norm = base.x**2 + base.y**2 + base.z**2 + base.w**2
assert abs(norm - 1) < 1e-9, norm
assert last["/rosout"][1].name == "dsm" and last["/rosout"][1].msg
print(f"{sum(counts.values())} messages, {len(counts)} topics")

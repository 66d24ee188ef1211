"""Writes cdr.txt: a message of each kind as another implementation puts it on the wire.

    pip install rosbags==0.11.9
    python robot/ros2/tests/make_cdr.py > robot/ros2/tests/cdr.txt

A line holds the type, its hash (REP 2011) and the bytes in hex, the encapsulation's four included. `cdr.rs` builds the same
messages and compares. Types that rosbags does not bring are given as their packages define them.
"""

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
FURTHER = {
    "control_msgs/msg/GripperCommand": "float64 position\nfloat64 max_effort\n",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/msg/ObjectHypothesisWithPose": "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n",
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y\n",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta\n",
    "vision_msgs/msg/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y\n",
    "vision_msgs/msg/Detection2D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox2D bbox\nstring id\n",
    "vision_msgs/msg/Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections\n",
    "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
    "vision_msgs/msg/Detection3D": "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox3D bbox\nstring id\n",
    "vision_msgs/msg/Detection3DArray": "std_msgs/Header header\nvision_msgs/Detection3D[] detections\n",
}
for name, text in FURTHER.items():
    store.register(get_types_from_msg(text, name))
T = store.types


def make(kind, /, **fields):
    return T[kind](**fields)


def vector(x, y, z):
    return make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def point(x, y, z):
    return make("geometry_msgs/msg/Point", x=x, y=y, z=z)


def turn(x, y, z, w):
    return make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)


def pose():
    return make("geometry_msgs/msg/Pose", position=point(1.5, -2.0, 0.25), orientation=turn(0.5, -0.5, 0.5, 0.5))


def transform():
    return make("geometry_msgs/msg/Transform", translation=vector(1.5, -2.0, 0.25), rotation=turn(0.5, -0.5, 0.5, 0.5))


def time():
    return make("builtin_interfaces/msg/Time", sec=12, nanosec=345000000)


def span():
    return make("builtin_interfaces/msg/Duration", sec=1, nanosec=500000000)


def header(frame):
    return make("std_msgs/msg/Header", stamp=time(), frame_id=frame)


def covariance():
    return np.arange(36, dtype=np.float64)


def posed():
    return make("geometry_msgs/msg/PoseWithCovariance", pose=pose(), covariance=covariance())


def twist():
    return make("geometry_msgs/msg/Twist", linear=vector(0.25, 0.0, 0.0), angular=vector(0.0, 0.0, -0.5))


def numbers(*values):
    return np.array(values, dtype=np.float64)


def hypothesis():
    inner = make("vision_msgs/msg/ObjectHypothesis", class_id="mug", score=0.75)
    return make("vision_msgs/msg/ObjectHypothesisWithPose", hypothesis=inner, pose=posed())


def color():
    return make("std_msgs/msg/ColorRGBA", r=0.25, g=0.5, b=0.75, a=1.0)


def detection_2d():
    at = make("vision_msgs/msg/Point2D", x=320.5, y=240.0)
    center = make("vision_msgs/msg/Pose2D", position=at, theta=0.0)
    box = make("vision_msgs/msg/BoundingBox2D", center=center, size_x=20.0, size_y=30.0)
    return make("vision_msgs/msg/Detection2D", header=header("head"), results=[hypothesis()], bbox=box, id="1")


def detection_3d():
    box = make("vision_msgs/msg/BoundingBox3D", center=pose(), size=vector(0.1, 0.2, 0.3))
    return make("vision_msgs/msg/Detection3D", header=header("map"), results=[hypothesis()], bbox=box, id="object 7")


def marker():
    data = np.array([1, 2, 3], dtype=np.uint8)
    texture = make("sensor_msgs/msg/CompressedImage", header=header(""), format="", data=np.array([], dtype=np.uint8))
    uv = make("visualization_msgs/msg/UVCoordinate", u=0.5, v=0.25)
    mesh = make("visualization_msgs/msg/MeshFile", filename="a", data=data)
    return make(
        "visualization_msgs/msg/Marker", header=header("map"), ns="objects", id=7, type=1, action=0, pose=pose(),
        scale=vector(0.1, 0.2, 0.3), color=color(), lifetime=span(), frame_locked=True, points=[point(1.0, 2.0, 3.0)],
        colors=[color()], texture_resource="", texture=texture, uv_coordinates=[uv], text="mug", mesh_resource="",
        mesh_file=mesh, mesh_use_embedded_materials=False,
    )


MESSAGES = {
    "std_msgs/msg/Bool": lambda: make("std_msgs/msg/Bool", data=True),
    "std_msgs/msg/String": lambda: make("std_msgs/msg/String", data="the red mug"),
    "std_msgs/msg/Float64MultiArray": lambda: make(
        "std_msgs/msg/Float64MultiArray",
        layout=make("std_msgs/msg/MultiArrayLayout", dim=[make("std_msgs/msg/MultiArrayDimension", label="j", size=3, stride=3)], data_offset=0),
        data=numbers(0.1, -0.2, 0.3)),
    "rosgraph_msgs/msg/Clock": lambda: make("rosgraph_msgs/msg/Clock", clock=time()),
    "diagnostic_msgs/msg/DiagnosticArray": lambda: make(
        "diagnostic_msgs/msg/DiagnosticArray", header=header("base"),
        status=[make("diagnostic_msgs/msg/DiagnosticStatus", level=2, name="arm", message="hot", hardware_id="a1",
                     values=[make("diagnostic_msgs/msg/KeyValue", key="celsius", value="71")])]),
    "geometry_msgs/msg/PoseStamped": lambda: make("geometry_msgs/msg/PoseStamped", header=header("map"), pose=pose()),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda: make("geometry_msgs/msg/PoseWithCovarianceStamped", header=header("map"), pose=posed()),
    "geometry_msgs/msg/TwistStamped": lambda: make("geometry_msgs/msg/TwistStamped", header=header("base_link"), twist=twist()),
    "geometry_msgs/msg/TransformStamped": lambda: make("geometry_msgs/msg/TransformStamped", header=header("map"), child_frame_id="odom", transform=transform()),
    "tf2_msgs/msg/TFMessage": lambda: make("tf2_msgs/msg/TFMessage", transforms=[
        make("geometry_msgs/msg/TransformStamped", header=header("map"), child_frame_id="odom", transform=transform())]),
    "nav_msgs/msg/Odometry": lambda: make("nav_msgs/msg/Odometry", header=header("odom"), child_frame_id="base_link", pose=posed(),
        twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist(), covariance=covariance())),
    "sensor_msgs/msg/JointState": lambda: make("sensor_msgs/msg/JointState", header=header(""), name=["lift", "arm_1"],
        position=numbers(0.3, -1.25), velocity=numbers(0.0, 0.5), effort=numbers()),
    "sensor_msgs/msg/Image": lambda: make("sensor_msgs/msg/Image", header=header("head"), height=2, width=2, encoding="16UC1",
        is_bigendian=0, step=4, data=np.arange(8, dtype=np.uint8)),
    "sensor_msgs/msg/CameraInfo": lambda: make("sensor_msgs/msg/CameraInfo", header=header("head"), height=480, width=640,
        distortion_model="plumb_bob", d=numbers(0.0, 0.0, 0.0, 0.0, 0.0), k=numbers(500, 0, 319.5, 0, 500, 239.5, 0, 0, 1),
        r=numbers(1, 0, 0, 0, 1, 0, 0, 0, 1), p=numbers(500, 0, 319.5, 0, 0, 500, 239.5, 0, 0, 0, 1, 0), binning_x=1, binning_y=1,
        roi=make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)),
    "trajectory_msgs/msg/JointTrajectory": lambda: make("trajectory_msgs/msg/JointTrajectory", header=header(""), joint_names=["lift", "arm_1"],
        points=[make("trajectory_msgs/msg/JointTrajectoryPoint", positions=numbers(0.3, -1.25), velocities=numbers(0.0, 0.5),
                     accelerations=numbers(), effort=numbers(), time_from_start=span())]),
    "control_msgs/msg/GripperCommand": lambda: make("control_msgs/msg/GripperCommand", position=0.08, max_effort=30.0),
    "vision_msgs/msg/Detection2DArray": lambda: make("vision_msgs/msg/Detection2DArray", header=header("head"), detections=[detection_2d()]),
    "vision_msgs/msg/Detection3DArray": lambda: make("vision_msgs/msg/Detection3DArray", header=header("map"), detections=[detection_3d()]),
    "visualization_msgs/msg/MarkerArray": lambda: make("visualization_msgs/msg/MarkerArray", markers=[marker()]),
}

for name, build in MESSAGES.items():
    print(name, store.hash_rihs01(name), bytes(store.serialize_cdr(build(), name)).hex())

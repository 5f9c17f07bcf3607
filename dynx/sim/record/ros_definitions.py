"""Definitions of the ROS 2 messages of a recording, which every recording contains.

They are those of ROS 2 common_interfaces and rcl_interfaces without comments, from Humble to Rolling.
"""

from __future__ import annotations

DEFINITIONS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Accel": "Vector3 linear\nVector3 angular\n",
    "geometry_msgs/AccelStamped": "std_msgs/Header header\nAccel accel\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation\n",
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance\n",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/Transform": "Vector3 translation\nQuaternion rotation\n",
    "geometry_msgs/TransformStamped": "std_msgs/Header header\nstring child_frame_id\nTransform transform\n",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular\n",
    "geometry_msgs/TwistStamped": "std_msgs/Header header\nTwist twist\n",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Wrench": "Vector3 force\nVector3 torque\n",
    "geometry_msgs/WrenchStamped": "std_msgs/Header header\nWrench wrench\n",
    "nav_msgs/Odometry": (
        "std_msgs/Header header\nstring child_frame_id\n"
        "geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n"
    ),
    "sensor_msgs/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    ),
    "std_msgs/Float64": "float64 data\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "std_msgs/String": "string data\n",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "trajectory_msgs/JointTrajectory": (
        "std_msgs/Header header\nstring[] joint_names\nJointTrajectoryPoint[] points\n"
    ),
    "trajectory_msgs/JointTrajectoryPoint": (
        "float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\nfloat64[] effort\n"
        "builtin_interfaces/Duration time_from_start\n"
    ),
}
"""Definition of each message by ``package/Name``; a field type of its own package is written without it."""

SEPARATOR = "=" * 80


def schema_name(message: str) -> str:
    """Return the name of a type in ROS 2, ``package/msg/Name``."""
    package, name = message.split("/")
    return f"{package}/msg/{name}"


def schema_text(message: str) -> str:
    """Return the definition of `message` and, after separators, of all types inside it (``ros2msg``)."""
    needed = _needed(message)
    parts = [DEFINITIONS[message], *(f"{SEPARATOR}\nMSG: {name}\n{DEFINITIONS[name]}" for name in needed)]
    return "".join(parts)


def _needed(message: str) -> list[str]:
    """List the message types inside `message`, each once, in order of appearance."""
    found: dict[str, None] = {}
    for line in DEFINITIONS[message].splitlines():
        kind = line.split()[0].split("[")[0]
        name = kind if "/" in kind else f"{message.split('/')[0]}/{kind}"
        if name in DEFINITIONS:
            found |= dict.fromkeys([name, *_needed(name)])
    return list(found)

"""A rollout as topics of ROS 2 messages, their definitions and their encoding.

| topic | type | content |
|---|---|---|
| `/joint_states` | sensor_msgs/JointState | positions, velocities and efforts of the joints |
| `/accelerations` | trajectory_msgs/JointTrajectory | accelerations of the joints; one element in `points` |
| `/saturated` | sensor_msgs/JointState | `effort` is 1 if the motor was at its limit, otherwise 0 |
| `/energy` | std_msgs/Float64 | sum of kinetic and potential energy [J] |
| `/reference` | sensor_msgs/JointState | reference positions and velocities |
| `/reference_accelerations` | trajectory_msgs/JointTrajectory | accelerations of the reference |
| `/error` | sensor_msgs/JointState | `position` is the tracking error: the reference minus the position |
| `/robot_description` | std_msgs/String | the simulated robot as URDF, once, at the beginning |

These have the joints with one coordinate. A ball joint has the topics below, in which translations, linear
velocities and forces are 0, and all else but the attitude is in the axes of the child link. URDF has no ball
joints: the description has a hinge in the place of each, and the metadata list their names.

| topic | type | content |
|---|---|---|
| `/ball_joints` | sensor_msgs/MultiDOFJointState | attitudes, angular velocities and torques |
| `/ball_joints/accelerations` | trajectory_msgs/MultiDOFJointTrajectory | accelerations; one element |
| `/ball_joints/saturated` | sensor_msgs/MultiDOFJointState | `torque` is 1 at a limit, otherwise 0 |
| `/ball_joints/reference` | sensor_msgs/MultiDOFJointState | reference attitudes and angular velocities |
| `/ball_joints/reference_accelerations` | trajectory_msgs/MultiDOFJointTrajectory | of the reference |
| `/ball_joints/error` | sensor_msgs/MultiDOFJointState | `twist` has the rotation [rad] to the reference |

A floating base adds these topics. Its pose is in the frame ``world`` (``map`` if the root link is called
``world``), all else in the axes of the root link:

| topic | type | content |
|---|---|---|
| `/tf` | tf2_msgs/TFMessage | the pose of the root link |
| `/base/odometry` | nav_msgs/Odometry | pose and velocity; covariances are 0 |
| `/base/acceleration` | geometry_msgs/AccelStamped | derivative of the velocity in `/base/odometry` |
| `/base/wrench` | geometry_msgs/WrenchStamped | wrench that the controller exerts on the base, usually 0 |
| `/base/reference` | nav_msgs/Odometry | reference pose and velocity |
| `/base/reference_acceleration` | geometry_msgs/AccelStamped | reference acceleration |
| `/base/error` | geometry_msgs/TwistStamped | translation [m], rotation [rad] from base to reference |

A rollout in a scene adds a topic for each body and link that touches something; characters that ROS does not
allow in names become ``_``:

| topic | type | content |
|---|---|---|
| `/contacts/NAME` | geometry_msgs/WrenchStamped | sum of contact forces on a body or link, in world axes |

Each sensor of `Rollout.sensors` adds a topic of its samples. They are logged when they can be read; the stamp
of their header is the time at which they were taken, and its frame is called like the sensor:

| topic | type | content |
|---|---|---|
| `/sensors/NAME` | sensor_msgs/Imu | the sample of an IMU, with the covariances of its white noise |
| `/sensors/NAME` | geometry_msgs/WrenchStamped | force-torque sensor: wrench; contact sensor: force |
| `/sensors/NAME` | sensor_msgs/JointState | encoder: position, velocity; joint torque: effort |
| `/sensors/NAME` | std_msgs/Float64 | distance of a ray sensor |

Every number is the float64 of the record. The torque of a step is stamped with the time at which the step
begins, so the last state has no effort. Mimic joints are not listed, because the description defines how they
follow others.

Messages are encoded in CDR. Those of a recording have different numbers but the same layout, so each field is
a column of bytes with one row for each message. The encoding is XCDR1 in little-endian order. After four
bytes that name the encoding, each number is aligned to a multiple of its size; a string is its length
including the terminating zero, then its UTF-8 bytes; a sequence is its length, then its elements (DDS-XTypes
1.3, section 7.4.3). The writer of mcap-ros2-support is not used: it leaves out channels without messages and
the entry of the quality of service, and encodes one message at a time.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.model import Model
from dynx.model.documents import with_hinges_for_balls
from dynx.sim.record.rollout import Rollout
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.world.sensors.readings import Readings

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
    "sensor_msgs/Imu": (
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
    ),
    "sensor_msgs/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    ),
    "sensor_msgs/MultiDOFJointState": (
        "std_msgs/Header header\nstring[] joint_names\ngeometry_msgs/Transform[] transforms\n"
        "geometry_msgs/Twist[] twist\ngeometry_msgs/Wrench[] wrench\n"
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
    "trajectory_msgs/MultiDOFJointTrajectory": (
        "std_msgs/Header header\nstring[] joint_names\nMultiDOFJointTrajectoryPoint[] points\n"
    ),
    "trajectory_msgs/MultiDOFJointTrajectoryPoint": (
        "geometry_msgs/Transform[] transforms\ngeometry_msgs/Twist[] velocities\n"
        "geometry_msgs/Twist[] accelerations\nbuiltin_interfaces/Duration time_from_start\n"
    ),
}
"""Definition of each message by ``package/Name``; a field type of its own package is written without it. They
are those of ROS 2 common_interfaces and rcl_interfaces without comments, from Humble to Rolling."""

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


LITTLE_ENDIAN = b"\x00\x01\x00\x00"
"""The first four bytes of a message: plain CDR, little-endian."""

Bytes = NDArray[np.uint8]
Field = str | int | NDArray[np.int64] | Floats
"""Part of n messages: a text or a number for all, whole numbers of four bytes (n,), or float64 (n, k)."""


def encode_messages(n: int, fields: Iterable[Field]) -> list[bytes]:
    """Encode n messages whose fields follow each other; a sequence is its length and then its elements."""
    columns, size = [_repeated(n, LITTLE_ENDIAN)], 0  # the header does not count for alignment
    for field in fields:
        text = field.encode() + b"\0" if isinstance(field, str) else b""
        numbers = np.asarray(len(text) if isinstance(field, str) else field)
        kind = np.dtype("<f8" if numbers.dtype.kind == "f" else "<u4")
        values = numbers if numbers.ndim == 2 else numbers.reshape(-1, 1)
        rows = np.broadcast_to(values, (n, values.shape[1])).astype(kind, order="C")
        for column in (_repeated(n, bytes(-size % kind.itemsize)), rows.view(np.uint8), _repeated(n, text)):
            columns.append(column)
            size += column.shape[1]
    whole = np.concatenate(columns, axis=1)
    width, data = whole.shape[1], whole.tobytes()
    return [data[k * width : (k + 1) * width] for k in range(n)]


def _repeated(n: int, data: bytes) -> Bytes:
    return np.broadcast_to(np.array(list(data), dtype=np.uint8), (n, len(data)))


class MessageReader:
    """The fields of one message, read one after the other.

    Each method raises ValueError where the message ends before the field does.
    """

    def __init__(self, data: bytes) -> None:
        """Raises ValueError for another encoding than plain CDR in little-endian order."""
        if data[:4] != LITTLE_ENDIAN:
            raise ValueError(f"a message has the encoding {data[:4]!r}; wanted little-endian CDR")
        self._data, self._at = memoryview(data)[4:], 0

    def whole(self) -> int:
        """Return a whole number of four bytes."""
        return int.from_bytes(self._bytes(4, 4), "little")

    def text(self) -> str:
        """Return a text."""
        return bytes(self._bytes(self.whole(), 1)).removesuffix(b"\0").decode()

    def texts(self) -> tuple[str, ...]:
        """Return a sequence of texts."""
        return tuple(self.text() for _ in range(self.whole()))

    def numbers(self, count: int | None = None) -> Floats:
        """Return so many float64, or those of a sequence, which begins with their number."""
        n = self.whole() if count is None else count
        return np.frombuffer(self._bytes(8 * n, 8), "<f8").astype(np.float64) if n else np.zeros(0)

    def _bytes(self, size: int, alignment: int) -> memoryview:
        begin = self._at + -self._at % alignment
        if begin + size > len(self._data):
            raise ValueError(f"a message of {len(self._data)} bytes ends before its fields do")
        self._at = begin + size
        return self._data[begin : self._at]


NO_VALUES = np.zeros((0, 0))
"""Empty field of a joint state."""

Stamps = np.ndarray[Any, np.dtype[np.int64]]
"""Times in nanoseconds."""

Fields = Callable[[Stamps, slice], list[Field]]
"""Function that returns all fields of the messages for a slice of the states, whose stamps are given."""


class Topic(NamedTuple):
    """Messages of one type, one at each of the states `first` to `last` (exclusive)."""

    name: str
    message: str
    first: int
    last: int
    fields: Fields
    samples: tuple[Stamps, Stamps] | None = None
    """Of a sensor, the times at which samples were taken, and the numbers of the states at which they are
    logged."""

    def encoded(self, stamps: Stamps, begin: int, end: int) -> list[tuple[int, bytes]]:
        """Return the messages of the states `begin` to `end` (exclusive), each with its state's number."""
        if self.samples is not None:
            taken, states = self.samples
            first, last = np.searchsorted(states, [begin, end]).tolist()
            if first == last:
                return []
            fields = self.fields(taken[first:last], slice(first, last))
            return list(zip(states[first:last].tolist(), encode_messages(last - first, fields), strict=True))
        begin, end = max(begin, self.first), min(end, self.last)
        if begin >= end:
            return []
        fields = self.fields(stamps[begin:end], slice(begin, end))
        return list(zip(range(begin, end), encode_messages(end - begin, fields), strict=True))


def topics_of(rollout: Rollout) -> list[Topic]:
    """Return all topics of `rollout`; one whose layout differs at the last state appears twice."""
    base = _base_topics(rollout) if rollout.model.floating else []
    balls = _ball_topics(rollout) if rollout.model.ball_joints else []
    return [*_joint_topics(rollout), *balls, *base, *_contact_topics(rollout), *_sensor_topics(rollout)]


class JointColumns(NamedTuple):
    """Names of the joints with one coordinate and their columns of q and v, then those of the ball joints:
    four columns of q and three of v for each."""

    names: list[str]
    in_q: list[int]
    in_v: list[int]
    balls: list[str]
    balls_in_q: list[int]
    balls_in_v: list[int]

    @classmethod
    def of(cls, model: Model) -> JointColumns:
        """Return the columns of a robot."""
        balls = [joint.name for joint in model.ball_joints]
        names = [name for name in model.joint_names if name not in balls]
        return cls(
            names,
            [model.position_index(name) for name in names],
            [model.coordinate_index(name) for name in names],
            balls,
            [model.position_index(name) + k for name in balls for k in range(4)],
            [model.coordinate_index(name) + k for name in balls for k in range(3)],
        )


def _joint_topics(rollout: Rollout) -> list[Topic]:
    n, columns = len(rollout), JointColumns.of(rollout.model)
    names, in_q, in_v = columns.names, columns.in_q, columns.in_v
    flags = rollout.saturated[:, in_v].astype(np.float64)

    def topic(name: str, kind: str, fields: Fields, first: int = 0, last: int = n + 1) -> Topic:
        return Topic(name, kind, first, last, fields)

    state, points = "sensor_msgs/JointState", "trajectory_msgs/JointTrajectory"
    q, v, description = rollout.q[:, in_q], rollout.v[:, in_v], with_hinges_for_balls(rollout.model).to_urdf()
    topics = [
        topic("/robot_description", "std_msgs/String", _text(description), last=1),
        topic("/joint_states", state, _joint_states(names, q, v, rollout.tau[:, in_v]), last=n),
        topic("/joint_states", state, _joint_states(names, q, v), first=n),
        topic("/accelerations", points, _accelerations(names, rollout.a[:, in_v]), last=n),
        topic("/saturated", state, _joint_states(names, effort=flags), last=n),
        topic("/energy", "std_msgs/Float64", _numbers(rollout.energy[:, None])),
    ]
    if rollout.reference is not None:
        wanted = rollout.reference
        topics += [
            topic("/reference", state, _joint_states(names, wanted.q[:, in_q], wanted.v[:, in_v])),
            topic("/reference_accelerations", points, _accelerations(names, wanted.a[:, in_v])),
            topic("/error", state, _joint_states(names, rollout.error[:, in_v])),
        ]
    return topics


def _ball_topics(rollout: Rollout) -> list[Topic]:
    n, columns = len(rollout), JointColumns.of(rollout.model)
    names, in_q, in_v = columns.balls, columns.balls_in_q, columns.balls_in_v
    flags = rollout.saturated[:, in_v].astype(np.float64)

    def topic(name: str, fields: Fields, first: int = 0, last: int = n + 1) -> Topic:
        kind = "sensor_msgs/MultiDOFJointState"
        if name.endswith("accelerations"):
            kind = "trajectory_msgs/MultiDOFJointTrajectory"
        return Topic(f"/ball_joints{name}", kind, first, last, fields)

    q, v = rollout.q[:, in_q], rollout.v[:, in_v]
    topics = [
        topic("", _ball_states(names, q, v, rollout.tau[:, in_v]), last=n),
        topic("", _ball_states(names, q, v), first=n),
        topic("/accelerations", _ball_accelerations(names, rollout.a[:, in_v]), last=n),
        topic("/saturated", _ball_states(names, torque=flags), last=n),
    ]
    if rollout.reference is not None:
        wanted = rollout.reference
        topics += [
            topic("/reference", _ball_states(names, wanted.q[:, in_q], wanted.v[:, in_v])),
            topic("/reference_accelerations", _ball_accelerations(names, wanted.a[:, in_v])),
            topic("/error", _ball_states(names, velocity=rollout.error[:, in_v])),
        ]
    return topics


def _base_topics(rollout: Rollout) -> list[Topic]:
    n, base = len(rollout), rollout.model.root

    world = "world" if base != "world" else "map"

    def topic(name: str, kind: str, fields: Fields, last: int = n + 1) -> Topic:
        return Topic(name, kind, 0, last, fields)

    def odometry(q: Floats, v: Floats) -> Fields:
        return _odometry(world, base, q[:, :7], v[:, :6])

    topics = [
        topic("/tf", "tf2_msgs/TFMessage", _transform(world, base, rollout.q[:, :7])),
        topic("/base/odometry", "nav_msgs/Odometry", odometry(rollout.q, rollout.v)),
        topic("/base/acceleration", "geometry_msgs/AccelStamped", _stamped(base, rollout.a[:, :6]), n),
        topic("/base/wrench", "geometry_msgs/WrenchStamped", _stamped(base, rollout.tau[:, :6]), n),
    ]
    if rollout.reference is not None:
        q, v, a = rollout.reference
        topics += [
            topic("/base/reference", "nav_msgs/Odometry", odometry(q, v)),
            topic("/base/reference_acceleration", "geometry_msgs/AccelStamped", _stamped(base, a[:, :6])),
            topic("/base/error", "geometry_msgs/TwistStamped", _stamped(base, rollout.error[:, :6])),
        ]
    return topics


def _contact_topics(rollout: Rollout) -> list[Topic]:
    if rollout.surroundings is None:
        return []
    contacts, n = rollout.surroundings.contacts, len(rollout)
    world = "world" if rollout.model.root != "world" else "map"
    topics = []
    for name, topic in _topic_names("/contacts", contacts.touching).items():
        force = np.concatenate([contacts.force_on(name), np.zeros((n, 3))], axis=1)
        topics.append(Topic(topic, "geometry_msgs/WrenchStamped", 0, n, _stamped(world, force)))
    return topics


def _sensor_topics(rollout: Rollout) -> list[Topic]:
    """Return a topic for each sensor, of the samples that can be read by the end."""
    topics = []
    stamps = _nanoseconds(rollout.t)
    for name, topic in _topic_names("/sensors", rollout.sensors).items():
        readings = rollout.sensors[name]
        message, fields = _sensor_message(readings)
        # Logged at the first state at which they can be read.
        states = np.searchsorted(stamps, _nanoseconds(readings.available))
        readable = int(np.searchsorted(states, len(stamps)))
        samples = _nanoseconds(readings.t)[:readable], states[:readable]
        topics.append(Topic(topic, message, 0, len(stamps), fields, samples))
    return topics


def _nanoseconds(times: Floats) -> Stamps:
    return np.rint(times * 1e9).astype(np.int64)


def _sensor_message(readings: Readings) -> tuple[str, Fields]:
    """Return the type and the fields of the messages of a sensor."""
    sensor, values = readings.sensor, readings.values
    _, _, part = sensor.on.rpartition("/")
    if sensor.kind == "imu":
        return "sensor_msgs/Imu", _inertial(readings)
    if sensor.kind == "encoder":
        return "sensor_msgs/JointState", _joint_states([part], values[:, :1], values[:, 1:])
    if sensor.kind == "joint_torque":
        return "sensor_msgs/JointState", _joint_states([part], effort=values)
    if sensor.kind == "ray":
        return "std_msgs/Float64", _numbers(values)
    wrench = np.concatenate([values, np.zeros((len(values), 6 - values.shape[1]))], axis=1)
    return "geometry_msgs/WrenchStamped", _stamped(sensor.name, wrench)


def _inertial(readings: Readings) -> Fields:
    """Return the fields of messages of an inertial sensor, which has no orientation."""
    sensor, period = readings.sensor, readings.period
    unknown = np.array([[0.0, 0.0, 0.0, 1.0, -1.0, *np.zeros(8)]])
    covariance = {
        name: np.diag(np.broadcast_to(errors.deviation(period) ** 2, 3)).reshape(1, 9)
        for name, errors in sensor.errors.items()
    }
    rate, force = readings["angular_velocity"], readings["acceleration"]
    return lambda stamps, rows: [
        *(*_header(stamps, sensor.name), unknown, rate[rows], covariance["angular_velocity"]),
        *(force[rows], covariance["acceleration"]),
    ]


def _topic_names(folder: str, names: Iterable[str]) -> dict[str, str]:
    """Return a topic for each name, in which characters that ROS does not allow are ``_``; names that differ
    in those alone get a number."""
    found: dict[str, str] = {}
    for name in names:
        allowed = re.sub(r"[^A-Za-z0-9_/]", "_", name)
        topics = _numbered(f"{folder}/{allowed}")
        found[name] = next(topic for topic in topics if topic not in found.values())
    return found


def _numbered(name: str) -> Iterator[str]:
    yield name
    yield from (f"{name}_{k}" for k in count(2))


def _joint_states(
    names: Sequence[str],
    position: Floats = NO_VALUES,
    velocity: Floats = NO_VALUES,
    effort: Floats = NO_VALUES,
) -> Fields:
    columns = (position, velocity, effort)
    return lambda stamps, states: [*_header(stamps, ""), *_listed(names, *(x[states] for x in columns))]


def _accelerations(names: Sequence[str], values: Floats) -> Fields:
    def fields(stamps: Stamps, states: slice) -> list[Field]:
        point = _listed(NO_VALUES, NO_VALUES, values[states], NO_VALUES)
        return [*_header(stamps, ""), *_listed(names), 1, *point, *_time(0 * stamps)]

    return fields


def _ball_states(
    names: Sequence[str],
    attitude: Floats = NO_VALUES,
    velocity: Floats = NO_VALUES,
    torque: Floats = NO_VALUES,
) -> Fields:
    columns = [_after_zeros(x, len(names)) for x in (attitude, velocity, torque)]
    return lambda stamps, states: [
        *_header(stamps, ""),
        *_listed(names),
        *(field for x in columns for field in _structures(x[states], len(names))),
    ]


def _ball_accelerations(names: Sequence[str], values: Floats) -> Fields:
    accelerations = _after_zeros(values, len(names))
    return lambda stamps, states: [
        *(*_header(stamps, ""), *_listed(names), 1, 0, 0),
        *_structures(accelerations[states], len(names)),
        *_time(0 * stamps),
    ]


def _after_zeros(values: Floats, count: int) -> Floats:
    """Return the numbers of `count` structures of each row, each after a vector of zeros."""
    if not values.shape[1]:
        return values
    rows = values.reshape(len(values), count, -1)
    return np.concatenate([np.zeros((len(values), count, 3)), rows], axis=2).reshape(len(values), -1)


def _structures(values: Floats, count: int) -> list[Field]:
    """Return a sequence of `count` structures of float64."""
    return [count, values] if values.shape[1] else [0]


def _numbers(values: Floats) -> Fields:
    return lambda _, states: [values[states]]


def _text(text: str) -> Fields:
    return lambda *_: [text]


def _transform(world: str, base: str, pose: Floats) -> Fields:
    return lambda stamps, states: [1, *_header(stamps, world), base, pose[states]]


def _odometry(world: str, base: str, pose: Floats, velocity: Floats) -> Fields:
    certain = np.zeros((1, 36))
    return lambda stamps, states: [
        *(*_header(stamps, world), base),
        *(pose[states], certain, velocity[states], certain),
    ]


def _stamped(frame: str, values: Floats) -> Fields:
    """Return the fields of two vectors with a header: a twist, an acceleration or a wrench."""
    return lambda stamps, states: [*_header(stamps, frame), values[states]]


def _header(stamps: Stamps, frame: str) -> list[Field]:
    return [*_time(stamps), frame]


def _time(nanoseconds: Stamps) -> list[Field]:
    return [nanoseconds // 10**9, nanoseconds % 10**9]


def _listed(*sequences: Sequence[str] | Floats) -> list[Field]:
    """Return sequences of text for all messages, or of the k numbers of each row (n, k)."""
    found: list[Field] = []
    for each in sequences:
        if not isinstance(each, np.ndarray):
            found += [len(each), *each]
        else:
            # Numbers that are absent are not aligned either.
            found += [each.shape[1], each] if each.shape[1] else [0]
    return found

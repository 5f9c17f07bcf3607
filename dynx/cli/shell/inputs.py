"""Command-line input as objects: a backend, a frame, a configuration, a velocity, a target pose."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.cli.shell.exits import one_line, remark
from dynx.cli.shell.options import PayloadInput
from dynx.errors import ArgumentError, NotInstalledError, UnknownNameError, nearest, shown
from dynx.model import Model, Pose
from dynx.model.configuration import checked_q
from dynx.model.loading import load
from dynx.model.numbers import checked_array
from dynx.model.topology import longest_chain_end
from dynx.model.tree import STANDARD_GRAVITY, Base
from dynx.model.unlikely_inputs import gravity_notes, position_notes
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat, rotation_from_rpy
from dynx.steppers.registry import world_class
from dynx.steppers.settings import Setting

if TYPE_CHECKING:
    from dynx.backends import Backend


Numbers = Sequence[float] | Mapping[str, float] | None
"""Value of an option such as ``--q``: a list, values by joint, or None where it was not given."""

Locks = tuple[tuple[str, float], ...]
"""Value of ``--lock``."""

_LISTED_NAMES = 8
"""Number of coordinates listed in the message about a wrong count."""


def load_robot(
    robot: str,
    base: Base | None,
    lock: Locks,
    base_pose: Sequence[float] | None = None,
    gravity: Sequence[float] | None = None,
) -> Model:
    """Load the robot of a command with its options."""
    pose = None if base_pose is None else pose_of(base_pose, "--base-pose")
    for note in gravity_notes(gravity or STANDARD_GRAVITY):
        remark(f"--gravity: {note}")
    return load(robot, base=base, lock=dict(lock), gravity=gravity, base_pose=pose)


def open_backend(
    robot: str,
    base: Base | None,
    lock: Locks,
    base_pose: Sequence[float] | None = None,
    engine: str | None = None,
    gravity: Sequence[float] | None = None,
    payload: Sequence[PayloadInput] = (),
) -> Backend:
    """Open the backend of a robot by its name, with bodies fixed to its frames; None is Pinocchio if it is
    installed, else `compiled`."""
    # Commands that open none start sooner.
    from dynx.backends import backend

    model = load_robot(robot, base, lock, base_pose, gravity)
    if payload:
        from dynx.rbd.parameters import Payload, plant_model

        model = plant_model(model, [Payload(*each) for each in payload])
    if engine is not None:
        return backend(engine, model)
    try:
        return backend("pinocchio", model)
    except NotInstalledError:
        return backend("compiled", model)


def configuration(
    model: Model, given: Numbers | str, option: str = "--q", default: Floats | None = None
) -> Floats:
    """Return q (nq,): `given`, where joints without a value keep `default` (None: the neutral one).

    A `str` is the name of one of `Model.configurations`."""
    if isinstance(given, str):
        return _named_configuration(model, given, option)
    base = ["x", "y", "z", "qx", "qy", "qz", "qw"] if model.floating else []
    start = model.neutral() if default is None else default.copy()
    q = checked_q(model, _filled(model, given, start, base, model.position_names, option), option)
    if given is not None:
        for note in position_notes(model, q, option):
            remark(note)
    return q


def _named_configuration(model: Model, name: str, option: str) -> Floats:
    try:
        q = np.array(model.configurations[name])
        for note in model.notes:
            if f"keyframe {shown(name)}" in note.message:
                remark(str(note))
        return q
    except UnknownNameError as error:
        hint = "" if model.configurations else ", such as 0,1.5,... or joint=value,..."
        raise UnknownNameError(f"{option}: {error}{hint}") from error


def velocity(model: Model, given: Numbers, option: str) -> Floats:
    """Return v, a or tau (nv,): `given`, where joints without a value are zero."""
    names = model.coordinate_names
    filled = _filled(model, given, np.zeros(model.nv), _base_velocity(model), names, option)
    return checked_array(option, filled, model.nv)


def velocity_names(model: Model) -> list[str]:
    """Name the coordinate of each entry of v, a and tau."""
    return [*_base_velocity(model), *model.coordinate_names]


def target_pose(given: Numbers, option: str) -> Floats:
    """Return a position (3,) or a pose (4, 4) from the numbers of `option`."""
    if not isinstance(given, list):
        raise ArgumentError(f"{option} takes numbers without names")
    numbers = np.array(given)
    if len(numbers) == 3:
        return numbers
    if len(numbers) in (6, 7):
        return homogeneous(_rotation(numbers[3:], option), numbers[:3])
    if len(numbers) == 16:
        return numbers.reshape(4, 4)
    raise ArgumentError(
        f"{option}: wanted 3 numbers (position), 6 (with roll, pitch, yaw), "
        f"7 (with a quaternion qx,qy,qz,qw) or 16 (a matrix); got {len(numbers)}"
    )


def target_rotation(given: Numbers, option: str) -> Floats:
    """Return a rotation (3, 3), or the pose (4, 4) that has it, from the numbers of `option`."""
    numbers = np.array(given) if isinstance(given, list) else None
    if numbers is None or len(numbers) in (6, 7, 16):
        return target_pose(given, option)
    if len(numbers) in (3, 4):
        return _rotation(numbers, option)
    if len(numbers) == 9:
        return numbers.reshape(3, 3)
    raise ArgumentError(
        f"{option}: wanted a rotation of 3 numbers (roll, pitch, yaw), 4 (a quaternion qx,qy,qz,qw) or 9 "
        f"(a matrix), or a pose of 6, 7 or 16; got {len(numbers)}"
    )


def angle_note(given: Numbers, option: str, *, rotation_only: bool = False) -> str:
    """Return a sentence if roll, pitch or yaw among the numbers of `option` is beyond a full turn, as angles
    in degrees are; otherwise an empty text. `rotation_only`: three numbers are angles, not a position."""
    numbers = given if isinstance(given, list) else []
    angles = numbers[3:] if len(numbers) == 6 else numbers if rotation_only and len(numbers) == 3 else []
    largest = max(angles, key=abs, default=0.0)
    if abs(largest) <= 2.0 * math.pi:
        return ""
    return (
        f"{option}: roll, pitch and yaw are in radians; {largest:g} is beyond a full turn, and {largest:g} "
        f"degrees would be {math.radians(largest):.6g}"
    )


def _rotation(numbers: Floats, option: str) -> Floats:
    """Return the rotation (3, 3) of roll, pitch, yaw [rad] or of a quaternion (x, y, z, w)."""
    if len(numbers) == 3:
        return rotation_from_rpy(numbers)
    norm = float(np.linalg.norm(numbers))
    if abs(norm - 1.0) > 1e-3:
        raise ArgumentError(f"{option}: the quaternion has norm {norm:.6g}; wanted 1")
    return rotation_from_quat(numbers / norm)


def pose_of(numbers: Sequence[float], option: str) -> Pose:
    """Return the pose given by the numbers of `option`; a position alone has the rotation of the world."""
    if len(numbers) in (3, 6):
        x, y, z, *rpy = numbers
        roll, pitch, yaw = rpy or (0.0, 0.0, 0.0)
        return Pose((x, y, z), (roll, pitch, yaw))
    return Pose.from_matrix(target_pose(list(numbers), option), option)


def chosen_frame(model: Model, given: str | None) -> str:
    """Return the frame that ``--frame`` gave, or the default."""
    return default_frame(model) if given is None else given


def default_frame_note(frame: str) -> str:
    """Make the line that names the frame used without ``--frame``."""
    return f"frame {one_line(frame)} ends the longest chain of moving joints; --frame chooses another"


def default_frame(model: Model) -> str:
    """Return the end of the longest chain of moving joints."""
    return longest_chain_end(model.links, model.joints)


def _base_velocity(model: Model) -> list[str]:
    return ["base vx", "base vy", "base vz", "base wx", "base wy", "base wz"] if model.floating else []


def _filled(
    model: Model, given: Numbers, default: Floats, base: Sequence[str], own: Sequence[str], option: str
) -> Floats:
    """Fill an array like `default`, whose entries are those of the `base` and its `own`, from the option."""
    if given is None:
        return default
    if isinstance(given, Mapping):
        for name, value in given.items():
            default[len(base) + _joint_number(model, own, name, option)] = value
        return default
    if len(given) != len(default):
        names = [*base, *map(one_line, own)]
        listed = ", ".join(names[:_LISTED_NAMES]) + (", ..." if len(names) > _LISTED_NAMES else "")
        numbers = "1 number" if len(given) == 1 else f"{len(given)} numbers"
        needed = f"{len(names)}: {listed}" if names else "none"
        raise ArgumentError(f"{option} has {numbers}; {one_line(model.name)} needs {needed}")
    return np.array(given, dtype=np.float64)


def _joint_number(model: Model, names: Sequence[str], name: str, option: str) -> int:
    """Return the position in `names`, or raise an error with the reason why there is none."""
    if name in names:
        return names.index(name)
    if all(joint.name != name for joint in model.joints):
        raise UnknownNameError(f"{option}: {model.name} has no joint {shown(name)}{nearest(name, names)}")
    if model.joint(name).type == "ball":
        parts = [each for each in names if each.rpartition(".")[0] == name]
        raise UnknownNameError(f"{option}: {shown(name)} is a ball joint; its parts are {', '.join(parts)}")
    try:
        return model.coordinate_index(name)
    except UnknownNameError as error:
        raise UnknownNameError(f"{option}: {error}") from error


WORDS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}
"""Words for truth values of settings."""


def settings_by_engine(
    engines: Sequence[str], given: Sequence[tuple[str, str]], options: Mapping[str, Setting] | None = None
) -> dict[str, dict[str, Any]]:
    """Return the settings of each engine from ``name=value`` and ``engine.name=value``, which has precedence.

    `options` are settings that every engine has besides its own. Raises UnknownNameError for a setting that
    no engine has, ArgumentError for one that is given twice or has a value of another type.
    """
    known: dict[str, Mapping[str, Setting]] = {
        name: {**world_class(name).settings, **(options or {})} for name in engines
    }
    found: dict[str, dict[str, Any]] = {name: {} for name in engines}
    names = [name for name, _ in given]
    for full in names:
        if names.count(full) > 1:
            raise ArgumentError(f"--set {shown(full)} is given twice")
    for full, text in sorted(given, key=lambda each: "." in each[0]):
        engine, dot, name = full.rpartition(".")
        if dot and engine not in known:
            raise UnknownNameError(
                f"--set {shown(full)}: {shown(engine)} does not run{nearest(engine, known)}"
            )
        having = [each for each in ([engine] if dot else engines) if name in known[each]]
        if not having:
            names = sorted({each for settings in known.values() for each in settings})
            raise UnknownNameError(
                f"--set {shown(full)}: no such setting of {', '.join([engine] if dot else engines)}"
                f"{nearest(name, names)}"
            )
        for each in having:
            found[each][name] = _value(known[each][name], full, text)
    return found


def _value(setting: Setting, name: str, text: str) -> Any:
    """Return the text as a value of the type of the setting."""
    if isinstance(setting.default, bool):
        if text.lower() not in WORDS:
            raise ArgumentError(f"--set {name}={text}: wanted true or false")
        return WORDS[text.lower()]
    if isinstance(setting.default, str):
        return text
    try:
        if isinstance(setting.default, tuple):
            return [float(word) for word in text.replace(",", " ").split()]
        return int(text) if isinstance(setting.default, int) else float(text)
    except ValueError:
        kind = "a whole number" if isinstance(setting.default, int) else "a number"
        raise ArgumentError(f"--set {name}={text}: wanted {kind}") from None

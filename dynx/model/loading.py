"""`load`: creates a model from a path, URDF text or the name of a robot."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import PurePath
from typing import Any

from numpy.typing import ArrayLike

from dynx.argument_types import is_listed
from dynx.errors import ArgumentError, DescriptionError, RobotNotFoundError, nearest, shown
from dynx.files.reading import printable, read_file
from dynx.model.elements import IDENTITY, Frame, Pose, checked_pose
from dynx.model.library import find, robots
from dynx.model.model import Model
from dynx.model.package_search import StrPath, data_folders, environment_folders, resolve_package
from dynx.model.tree import Base, Description
from dynx.model.urdf.geometry import urdf_geometry
from dynx.model.urdf.reader import read_urdf

_SUFFIXES = (".urdf", ".xacro", ".xml", ".mjcf", ".sdf", ".world")

# Without the colon an argument is a mistake, which is named.
_WITH_ARGUMENTS = re.compile(r"(?P<path>.*\.xacro)\s+(?P<arguments>\w+:?=.*)", re.DOTALL)

_ARGUMENT = re.compile(r"(\w+):=(.*)", re.DOTALL)


def load(
    x: StrPath | bytes | bytearray | Model,
    *,
    base: Base | None = None,
    lock: Mapping[str, float] | None = None,
    gravity: ArrayLike | None = None,
    base_pose: Pose | ArrayLike | None = None,
    package_dirs: Iterable[StrPath] = (),
) -> Model:
    """Load the model of a robot.

    `x` is one of

    - text of URDF, MJCF or SDF: a `str` or `bytes` that begins with ``<`` after white space or a byte-order
      mark;
    - a path: any `os.PathLike`, or a `str` with a separator or with the suffix .urdf, .xacro, .xml, .mjcf,
      .sdf or .world. Such a string is never the name of a robot. If the file does not exist, dynx searches
      the package ``pybullet_data``, as PyBullet does, for example for ``plane.urdf`` or ``mjcf/ant.xml``. A
      .xacro file needs the extra ``xacro``, which evaluates expressions of the file as Python code: expand
      only files that you trust. Arguments of a xacro file follow its path:
      ``"ur.urdf.xacro name:=ur ur_type:=ur5e"``;
    - ``package://NAME/FILE``: a file of a package in `package_dirs`, in ROS_PACKAGE_PATH or
      AMENT_PREFIX_PATH, or of the Python package ``pybullet_data``; never one outside the package;
    - the name of a robot in the library (see ``dynx robots``). For a file of this name in the working
      directory, write ``./name``. If the library does not have the name, dynx searches ``pybullet_data`` for
      a file of this name without suffix, such as ``r2d2``, then the working directory;
    - a `Model`. Its base, base pose and gravity are kept unless you give others.

    `base` is ``"fixed"`` (default) or ``"floating"``. MJCF and SDF state their base and gravity. `lock` fixes
    joints, by name, at positions [rad or m]; a locked joint has no entry in q. `gravity` is (3,) [m/s^2] in
    world axes, by default (0, 0, -9.81). `base_pose` is the pose of the root link of a fixed base in the
    world, by default the identity. It is a `Pose`, a matrix (4, 4) or a pair of position and quaternion (x,
    y, z, w). Packages and meshes are searched in the folders `package_dirs` and around the file.

    Raises RobotNotFoundError if no robot or file is found, DescriptionError if the description is malformed
    (with file and line), UnsupportedFeatureError if it uses a feature that dynx does not support,
    ArgumentError for a `base` that contradicts the file, UnknownNameError for an unknown joint in `lock`.
    """
    if lock is not None and not isinstance(lock, Mapping):
        raise ArgumentError(
            f"lock is {shown(lock)}; wanted positions by the name of a joint, such as {{'finger': 0.02}}"
        )
    if isinstance(x, Model):
        return _with_options(x, base, lock, gravity, base_pose)
    if not isinstance(package_dirs, str | os.PathLike) and not is_listed(package_dirs):
        raise ArgumentError(f"package_dirs is {shown(package_dirs)}; wanted folders")
    folders = [package_dirs] if isinstance(package_dirs, str | os.PathLike) else list(package_dirs)
    data, source, name = read_description(x, folders)
    return read_model(
        data,
        source,
        name,
        base=base,
        lock=lock,
        gravity=gravity,
        base_pose=base_pose,
        package_dirs=folders,
    )


def read_description(
    x: StrPath | bytes | bytearray, package_dirs: Iterable[StrPath] = ()
) -> tuple[str | bytes, str, str | None]:
    """Return the text that `load` would read, its source, and the name of the file without suffixes.

    The text is bytes or characters; the name is None for text that is not from a file. A .xacro file is
    expanded. Raises the errors of `load`.
    """
    if isinstance(x, bytes | bytearray | memoryview):
        return bytes(x), "<string>", None
    if isinstance(x, str) and x.lstrip("\ufeff \t\r\n").startswith("<"):
        return x, "<string>", None
    if not isinstance(x, str | os.PathLike):
        raise ArgumentError(f"x is of type {type(x).__name__}; wanted a path, text, a name or a Model")
    named, arguments = split_arguments(x) if isinstance(x, str) else (x, {})
    path = _path_of(named, package_dirs)
    name = PurePath(path).name.split(".")[0]
    if path.endswith(".xacro"):
        # Imported here, because most robots are read from URDF.
        from dynx.model.xacro_reading import expand_xacro

        return expand_xacro(path, package_dirs, arguments), printable(path), name
    return read_file(path), printable(path), name


def split_arguments(path: str) -> tuple[str, dict[str, str]]:
    """Split ``FILE.xacro name:=value ...``, as ROS writes it, into the path and the arguments.

    A value with blanks stands in quotes. A path without arguments is returned as it is. Raises ArgumentError
    for a part after the path that is no argument.
    """
    match = _WITH_ARGUMENTS.fullmatch(path)
    if match is None:
        return path, {}
    try:
        parts = shlex.split(match["arguments"])
    except ValueError as error:
        raise ArgumentError(f"arguments of {shown(match['path'], 300)}: {error}") from None
    arguments = {}
    for part in parts:
        argument = _ARGUMENT.fullmatch(part)
        if argument is None:
            raise ArgumentError(
                f"{shown(part)} is no argument of {shown(match['path'], 300)}; wanted name:=value"
            )
        arguments[argument[1]] = argument[2]
    return match["path"], arguments


def _path_of(x: StrPath, package_dirs: Iterable[StrPath]) -> str:
    if not isinstance(x, str):
        return os.fsdecode(os.fspath(x))
    if x.startswith("package://"):
        try:
            return str(resolve_package(x, [*package_dirs, *environment_folders(), *data_folders()]))
        except DescriptionError as error:
            raise RobotNotFoundError(str(error)) from None
    separators = {os.sep, os.altsep or os.sep, "/"}
    if any(separator in x for separator in separators) or x.endswith(_SUFFIXES):
        path = os.path.expanduser(x)
        if not _exists(path):
            # Imported here, because most files are there.
            from dynx.model.missing_robot import hint_for_file, in_data_package

            elsewhere = in_data_package(x)
            if elsewhere is not None:
                return str(elsewhere)
            library = {each.name: each.path for each in robots()}
            raise RobotNotFoundError(f"no such file: {shown(x, 300)}{hint_for_file(x, library)}")
        return path
    try:
        return str(find(x))
    except RobotNotFoundError:
        if x and _exists(x):
            return x
        raise


def _exists(path: str) -> bool:
    try:
        return os.path.lexists(path)
    except ValueError:
        # A null character in the path.
        return False


def read_model(
    data: str | bytes,
    source: str,
    name: str | None = None,
    *,
    base: Base | None = None,
    lock: Mapping[str, float] | None = None,
    gravity: ArrayLike | None = None,
    base_pose: Pose | ArrayLike | None = None,
    package_dirs: Iterable[StrPath] = (),
) -> Model:
    """Create the model of URDF, MJCF or SDF text; `source` names it in errors.

    A robot without a name in the text is called `name`. The other arguments and errors are those of `load`.
    """
    content = _read(data, source, package_dirs, base)
    return build_described(content, source, name, base=base, lock=lock, gravity=gravity, base_pose=base_pose)


def build_described(
    content: Description,
    source: str,
    name: str | None = None,
    *,
    base: Base | None = None,
    lock: Mapping[str, float] | None = None,
    gravity: ArrayLike | None = None,
    base_pose: Pose | ArrayLike | None = None,
) -> Model:
    """Create the model of what was read of a file; the arguments and errors are those of `read_model`."""
    chosen = base or content.base or "fixed"
    if base_pose is None:
        # A floating base has its pose in q.
        base_pose = content.base_pose if chosen == "fixed" else IDENTITY
    try:
        model = Model.build(
            content.name or name or "robot",
            content.links,
            content.joints,
            base=chosen,
            gravity=content.gravity if gravity is None else gravity,
            base_pose=base_pose,
            lock=lock,
            notes=content.notes,
            source=source,
            geometry=content.geometry,
            actuators=content.actuators,
            contact_filter=content.contact_filter,
        )
    except DescriptionError as error:
        if content.unread is None:
            raise
        raise DescriptionError(
            f"{content.unread.message} (read without it: {error.message})",
            source=source,
            line=content.unread.line,
        ) from None
    if content.configurations is not None:
        data: Any = {name: getattr(content, name) for name in ("sensors", "tendons", "equalities")}
        data |= {"stated_configurations": content.configurations, "stated_initial": content.initial}
        model = replace(model, gravity_compensation=content.gravity_compensation, **data)
    return _with_frames(model, content.frames, source) if content.frames else model


def _with_frames(model: Model, frames: Iterable[Frame], source: str) -> Model:
    """Add frames at once, as `Model.with_frame` adds each: a file may have thousands."""
    names, placed = dict.fromkeys(model.frame_names), []
    for frame in frames:
        if frame.link not in names:
            raise DescriptionError(
                f"frame {shown(frame.name)} is on {shown(frame.link)}, which is not a link"
                + nearest(frame.link, model.frame_names),
                source=source,
            )
        model.link(frame.link)
        if frame.name in names:
            raise ArgumentError(f"frame {shown(frame.name)} exists already in {model.name}")
        names[frame.name] = None
        placed.append(replace(frame, placement=checked_pose("placement", frame.placement)))
    return replace(model, extra_frames=(*model.extra_frames, *placed))


def _read(data: str | bytes, source: str, package_dirs: Iterable[StrPath], base: Base | None) -> Description:
    content = None
    # Imported here, because most robots are read from URDF. A URDF file may have an element <mujoco>, too.
    if _contains(data, "<mujoco"):
        from dynx.model.mjcf.reader import read_mjcf

        content = read_mjcf(data, source, package_dirs)
    if content is None and _contains(data, "<sdf"):
        from dynx.model.sdf.reader import read_sdf

        content = read_sdf(data, source, package_dirs)
    if content is None:
        content = read_urdf(data, source)
        frames = [frame.name for frame in content.frames]
        return replace(content, geometry=urdf_geometry(data, source, package_dirs, frames))
    if base not in (None, content.base):
        raise ArgumentError(
            f"base is {shown(base)}, and the file says that the robot is {content.base}; "
            f"load(...).with_base({base!r}) makes a robot with that base of it"
        )
    return content


def _contains(data: str | bytes, text: str) -> bool:
    return text.encode() in data if isinstance(data, bytes) else text in data


def _with_options(
    model: Model,
    base: Base | None,
    lock: Mapping[str, float] | None,
    gravity: ArrayLike | None,
    base_pose: Pose | ArrayLike | None,
) -> Model:
    if lock:
        relocked = Model.build(
            model.name, model.links, model.joints, lock=lock, notes=model.notes, source=model.source
        )
        model = replace(model, joints=relocked.joints, notes=relocked.notes)
    if base is not None:
        model = model.with_base(base)
    if base_pose is not None:
        model = model.with_base_pose(base_pose)
    return model if gravity is None else model.with_gravity(gravity)

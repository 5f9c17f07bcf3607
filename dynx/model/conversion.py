"""A robot in another format: its text, the files that go along, what the format cannot say, and the proof.

The document is written into a folder of its own, read back and compared with the robot part by part: it is
handed over only where links, joints, frames, inertias, limits and coefficients are the same to rounding.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, DescriptionError, DynxError, UnknownNameError, nearest, shown
from dynx.files.links import refuse_links
from dynx.files.reading import read_file
from dynx.files.temporary import temporary_folder
from dynx.files.writing import write_bytes
from dynx.model.document_format import SUFFIXES, Format
from dynx.model.elements import Frame, Inertial, Joint, Pose
from dynx.model.geometry import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Geometry,
    LinkGeometry,
    Mesh,
    Sphere,
    Visual,
)
from dynx.model.geometry.asset_files import AssetFiles
from dynx.model.loading import load
from dynx.model.mjcf.sensor_objects import SensorObjects
from dynx.model.mjcf.writer import MESH_SUFFIXES, RobotWriter
from dynx.model.model import Model
from dynx.model.sdf.writer import SdfWriter
from dynx.model.stated_parts import StatedEquality, StatedTendon
from dynx.model.urdf.writer import urdf_notes, urdf_text
from dynx.spatial.scalar import Floats

_COPIED: Mapping[Format, tuple[str, ...]] = {
    "mjcf": MESH_SUFFIXES,
    "sdf": (".obj",),
    "urdf": (".stl", ".obj", ".dae", ".glb"),
}
"""Formats of meshes that are copied; others are written as OBJ."""

ROUNDING = 1e-12
"""Largest difference of two equal numbers, relative to the largest of their kind."""


@dataclass(frozen=True)
class Conversion:
    """A robot as a document of a format, which has been read back."""

    format: Format
    text: str
    notes: tuple[str, ...]
    """Sentences on what the format cannot say of the robot, each with its effect."""
    files: Mapping[str, bytes]
    """Contents of meshes and images, by their paths beside the document, with / between folders."""
    differences: tuple[str, ...]
    """Sentences on what the document, read back, does not say of the robot; empty for the same robot."""
    shape_differences: tuple[str, ...] = ()
    """Sentences on shapes that the document lacks or states differently."""
    robot: Model | None = None
    """The robot that the document, read back, states, without its shapes; None where it is not read."""

    def write(self, path: str | os.PathLike[str]) -> list[str]:
        """Write the document, and its files beside it; return the paths, the document last.

        Raises ArgumentError for a path that cannot be written, and for a document that is another robot.
        """
        if self.differences:
            raise ArgumentError(f"{shown(os.fspath(path), 300)} is not written: {self.differences[0]}")
        return write_document(Path(path), self.text, self.files)


@checks_types
def convert(model: Model, to: Format, stem: str = "robot") -> Conversion:
    """Return a robot as a document of a format, read back and compared.

    `stem` is the name of its file without the suffix: meshes and images are in the folder ``STEM_assets``
    beside it. Raises UnknownNameError for another format, DescriptionError and its kinds for a robot that
    the format cannot express.
    """
    if to not in get_args(Format):
        raise UnknownNameError(f"format is {shown(to)}{nearest(to, get_args(Format))}")
    assets = AssetFiles(model.geometry, f"{stem}_assets", _COPIED[to])
    if to == "urdf":
        written, left_out = _without_unread_meshes(without_collision_faults(model), assets)
        text = urdf_text(written, geometry=True, mesh_path=assets.mesh_path, image_path=assets.image_path)
        notes = (*urdf_notes(model), *left_out)
    else:
        writer = (
            RobotWriter(model, assets.mesh_path, assets.image_path)
            if to == "mjcf"
            else SdfWriter(model, assets.mesh_path)
        )
        text, notes = writer.text(), tuple(writer.notes)
    read = None
    with temporary_folder() as folder:
        path = Path(folder) / f"{stem}{SUFFIXES[to][0]}"
        write_document(path, text, assets.files, sync=False)
        try:
            back = load(path)
            differences = tuple(robot_differences(model, back))
            shapes = tuple(shape_differences(model, back))
            # Its meshes are gone with the folder.
            read = without_shapes(back)
        except DynxError as error:
            differences, shapes = (f"the document is not read back: {error}",), ()
    return Conversion(to, text, notes, assets.files, differences, shapes, read)


def without_shapes(model: Model) -> Model:
    """Return a robot without its shapes."""
    return replace(model, geometry=Geometry({}).for_links(link.name for link in model.links))


def without_collision_faults(model: Model) -> Model:
    """Return a robot without the collision shapes of links of which one cannot be used."""
    links = model.geometry.links
    if all(each.collision_fault is None for each in links.values()):
        return model
    usable = {name: replace(each, collision_fault=None) for name, each in links.items()}
    return replace(model, geometry=Geometry(usable))


def _without_unread_meshes(model: Model, assets: AssetFiles) -> tuple[Model, list[str]]:
    """Return a robot without the shapes whose mesh files cannot be read, and a note on each of them."""
    notes: list[str] = []

    def is_read(placed: Visual | Collision, link: str) -> bool:
        if isinstance(placed.shape, Mesh) and placed.shape.fault is None and placed.shape.file:
            try:
                assets.mesh_path(placed.shape)
            except DescriptionError as error:
                kind = "visual" if isinstance(placed, Visual) else "collision"
                notes.append(f"A {kind} shape of link {shown(link)} is left out: {error}.")
                return False
        return True

    links = {
        name: replace(
            each,
            visuals=tuple(shape for shape in each.visuals if is_read(shape, name)),
            collisions=tuple(shape for shape in each.collisions if is_read(shape, name)),
        )
        for name, each in model.geometry.links.items()
    }
    return (replace(model, geometry=Geometry(links)), notes) if notes else (model, notes)


def write_document(path: Path, text: str, files: Mapping[str, bytes], *, sync: bool = True) -> list[str]:
    """Write a document and the files beside it; return their paths, the document last.

    A file beside it that has its content already is left as it is. Raises ArgumentError where a link is in
    the place of such a file or its folder, and for a path that cannot be written.
    """
    refuse_links(path.parent, files)
    written = []
    for name, content in files.items():
        file = path.parent / name
        written.append(str(file))
        if holds(file, content):
            continue
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ArgumentError(
                f"{shown(str(file.parent), 300)} cannot be created: {error.strerror}"
            ) from None
        write_bytes(file, content, sync=sync)
    write_bytes(path, text.encode(), sync=sync)
    return [*written, str(path)]


def holds(path: str | os.PathLike[str], content: bytes) -> bool:
    """Check whether a file exists with that content."""
    try:
        return os.path.getsize(path) == len(content) and read_file(os.fspath(path)) == content
    except (OSError, DescriptionError):
        return False


# -- comparison -------------------------------------------------------------------------------------------


def robot_differences(model: Model, back: Model) -> Iterator[str]:
    """Yield a sentence for each part of a robot that a document, read back, states differently.

    Links, joints and frames are compared by their names. A revolute joint without limits is the same as a
    continuous one, a link without inertial as one with zeros; equal limits may be 1e-12 apart, because
    MuJoCo refuses equal ones.
    """
    for what, mine, theirs in (
        ("name", model.name, back.name),
        ("base", model.base, back.base),
        ("root link", model.root, back.root),
        ("gravity", model.gravity, back.gravity),
        ("order of the coordinates", model.joint_names, back.joint_names),
    ):
        if mine != theirs:
            yield f"the {what} is {shown(theirs)} instead of {shown(mine)}"
    size = max([1.0, *(abs(x) for joint in model.joints for x in joint.origin.xyz)])
    if not _same_pose(model.base_pose, back.base_pose, size):
        yield "the pose of the base differs"
    links = {link.name: link for link in back.links}
    yield from _missing("link", [link.name for link in model.links], [*links])
    for link in model.links:
        if link.name in links:
            found = _inertial_difference(link.inertial or Inertial(), links[link.name].inertial or Inertial())
            if found:
                yield f"the {found} of link {shown(link.name)} differs"
    if model.actuators is not None and back.actuators is not None:
        moving = {joint.name for joint in model.joints if joint.moves}
        tendons = {each.name for each in back.tendons or () if each.name}
        kept = (each for each in model.actuators if each.joint in moving or each.tendon in tendons)
        if back.actuators != tuple(kept):
            yield "the actuators differ"
    yield from _data_differences(model, back)
    if model.sensors is not None and back.sensors is not None:
        parts = SensorObjects.of(back)
        if back.sensors != tuple(each for each in model.sensors if parts.missing(each) is None):
            yield "the sensors differ"
    if back.stated_configurations is not None:
        yield from _missing("configuration", [*model.configurations], [*back.configurations])
        for name in model.configurations:
            if name in back.configurations and not _same_configuration(model, back, name):
                yield f"configuration {shown(name)} differs"
    joints = {joint.name: joint for joint in back.joints}
    yield from _missing("joint", [joint.name for joint in model.joints], [*joints])
    for joint in model.joints:
        if joint.name in joints:
            for found in _joint_differences(joint, joints[joint.name], size):
                yield f"the {found} of joint {shown(joint.name)} differs"
    frames = {frame.name: frame for frame in back.extra_frames}
    yield from _missing("frame", [frame.name for frame in model.extra_frames], [*frames])
    for frame in model.extra_frames:
        other = frames.get(frame.name)
        if other is not None and not _same_frame(frame, other, size):
            yield f"the placement of frame {shown(frame.name)} differs"


def _data_differences(model: Model, back: Model) -> Iterator[str]:
    """Yield sentences on tendons, constraints, gravity compensation and the initial configuration; nothing
    where a format leaves them open."""
    moving = {joint.name for joint in model.joints if joint.moves}
    if model.tendons is not None and back.tendons is not None:
        kept = tuple(each for each in model.tendons if moving.issuperset(each.joints))
        if len(back.tendons) != len(kept) or not all(map(_same_tendon, kept, back.tendons)):
            yield "the tendons differ"
    if model.equalities is not None and back.equalities is not None:
        names = SensorObjects.of(back).names
        left = list(back.equalities)
        for each in model.equalities:
            found = next((other for other in left if _same_equality(each, other)), None)
            if found is not None:
                left.remove(found)
            elif set(each.objects).issubset(names.get(each.object_type, ())) and each.type != "connect":
                yield f"equality constraint {shown(each.name or each.first)} differs"
        for other in left:
            yield f"equality constraint {shown(other.name or other.first)} differs"
    compensations = model.gravity_compensation, back.gravity_compensation
    if None not in compensations and compensations[0] != compensations[1]:
        yield "the gravity compensation differs"
    if model.stated_initial is not None and back.stated_initial is not None:
        coupled = {name for joint in model.joints if joint.mimic for name in (joint.name, joint.mimic.joint)}
        at = [model.position_index(name) for name in model.joint_names if name in coupled]
        mine, theirs = (np.array(each.initial_configuration) for each in (model, back))
        mine[at] = 0.0
        for k in model.quaternions if mine.shape == theirs.shape else ():
            theirs[k : k + 4] *= np.sign(theirs[k : k + 4] @ mine[k : k + 4])
        if mine.shape != theirs.shape or not _close(theirs, mine):
            yield "the initial configuration differs"


def _same_tendon(mine: StatedTendon, theirs: StatedTendon) -> bool:
    """Check whether two tendons are equal, the length of the spring to rounding."""
    lengths = np.array(theirs.spring_length), np.array(mine.spring_length)
    return replace(theirs, spring_length=mine.spring_length) == mine and _close(*lengths)


def _same_equality(mine: StatedEquality, theirs: StatedEquality) -> bool:
    """Check whether two constraints are equal to rounding. Their references may differ, if the polynomials
    allow for it."""
    poses = (mine.first_pose, theirs.first_pose), (mine.second_pose, theirs.second_pose)
    size = max([1.0, *(abs(x) for pair in poses for pose in pair for x in pose.xyz)])
    if not all(_same_pose(*pair, size) for pair in poses):
        return False
    alike = replace(
        theirs,
        first_pose=mine.first_pose,
        second_pose=mine.second_pose,
        polynomial=mine.polynomial,
        references=mine.references,
    )
    return alike == mine and _close(theirs.absolute_polynomial, mine.absolute_polynomial)


def _same_configuration(model: Model, back: Model, name: str) -> bool:
    mine, theirs = (each.configurations[name] for each in (model, back))
    return mine.shape == theirs.shape and _close(theirs, mine)


def _missing(kind: str, mine: list[str], theirs: list[str]) -> Iterator[str]:
    for name in mine:
        if name not in theirs:
            yield f"{kind} {shown(name)} is missing"
    for name in theirs:
        if name not in mine:
            yield f"{kind} {shown(name)} is added"


def _same_frame(frame: Frame, other: Frame, size: float) -> bool:
    return frame.link == other.link and _same_pose(frame.placement, other.placement, size)


def _same_pose(a: Pose, b: Pose, size: float) -> bool:
    difference = np.abs(a.matrix - b.matrix)
    return bool(difference[:3, :3].max() <= ROUNDING and difference[:3, 3].max() <= ROUNDING * size)


def _inertial_difference(mine: Inertial, theirs: Inertial) -> str:
    if mine.mass != theirs.mass:
        return "mass"
    centers = [each.origin.matrix[:3, 3] for each in (mine, theirs)]
    if not _close(centers[1], centers[0]) and mine.mass:
        return "centre of mass"
    return "" if _close(theirs.link_tensor, mine.link_tensor) else "inertia"


def _close(got: Floats, want: Floats) -> bool:
    return bool(np.abs(got - want).max(initial=0.0) <= ROUNDING * np.abs(want).max(initial=0.0))


def _joint_differences(mine: Joint, theirs: Joint, size: float) -> Iterator[str]:
    if (mine.parent, mine.child) != (theirs.parent, theirs.child):
        yield "pair of links"
    if not _same_pose(mine.origin, theirs.origin, size):
        yield "origin"
    if mine.locked_at != theirs.locked_at:
        yield "locked position"
    if _kind(mine) != _kind(theirs):
        yield "type"
        return
    if not mine.moves:
        return
    if not _close(np.array(theirs.axis), np.array(mine.axis)):
        yield "axis"
    for name in ("dynamics", "mimic"):
        if getattr(mine, name) != getattr(theirs, name):
            yield {"dynamics": "damping, friction, armature or spring", "mimic": "coupling"}[name]
    if (mine.limits.velocity, mine.limits.effort) != (theirs.limits.velocity, theirs.limits.effort):
        yield "limit of velocity or effort"
    if _kind(mine) != "continuous":
        ends = [sorted((each.limits.lower, each.limits.upper)) for each in (mine, theirs)]
        if not all(map(_same_limit, *ends)):
            yield "range"


def _same_limit(a: float, b: float) -> bool:
    return a == b or abs(a - b) <= 2.0 * ROUNDING * max(1.0, abs(a))


def _kind(joint: Joint) -> str:
    limits = (abs(joint.limits.lower), abs(joint.limits.upper))
    unlimited = limits == (math.inf, math.inf)
    return "continuous" if joint.type == "revolute" and unlimited else joint.type


# -- shapes -----------------------------------------------------------------------------------------------


def shape_differences(model: Model, back: Model) -> Iterator[str]:
    """Yield a sentence for each link whose shapes a document, read back, states differently.

    Shapes are compared in their order: kind and size, pose, colour, and the triangles of meshes.
    """
    for link in model.links:
        mine, theirs = (each.geometry.links.get(link.name, LinkGeometry()) for each in (model, back))
        kinds: tuple[tuple[str, tuple[Visual | Collision, ...], tuple[Visual | Collision, ...]], ...] = (
            ("visual", mine.visuals, theirs.visuals),
            ("collision", mine.collisions, theirs.collisions),
        )
        for kind, fault in (("visual", mine.visual_fault), ("collision", mine.collision_fault)):
            if fault is not None:
                yield f"no {kind} shape of link {shown(link.name)} is in the document, since one is not read"
        for kind, first, second in kinds:
            where = f"{kind} shapes of link {shown(link.name)}"
            if len(first) != len(second):
                yield f"{len(second)} of {len(first)} {where} are in the document"
                continue
            found = [_shape_difference(a, b) for a, b in zip(first, second, strict=True)]
            for number, difference in enumerate(found):
                if difference:
                    yield f"the {difference} of number {number + 1} of the {where} differs"


def _shape_difference(mine: Visual | Collision, theirs: Visual | Collision) -> str:
    a, b = mine.shape, theirs.shape
    if type(a) is not type(b) and not (isinstance(a, Mesh) and isinstance(b, Mesh)):
        return "kind"
    if not _same_pose(mine.origin, theirs.origin, 1.0 + max(map(abs, mine.origin.xyz))):
        return "pose"
    if isinstance(a, Mesh) and isinstance(b, Mesh):
        if not _same_mesh(a, b):
            return "mesh"
    elif isinstance(a, Box | Sphere | Cylinder | Capsule | Ellipsoid):
        assert isinstance(b, Box | Sphere | Cylinder | Capsule | Ellipsoid)
        if not _close(_sizes(b), _sizes(a)):
            return "size"
    if isinstance(mine, Visual) and isinstance(theirs, Visual):
        colours = [None if each.material is None else each.material.rgba for each in (mine, theirs)]
        if colours[0] != colours[1]:
            return "colour"
    return ""


def _sizes(shape: Box | Sphere | Cylinder | Capsule | Ellipsoid) -> Floats:
    if isinstance(shape, Ellipsoid):
        return np.array(shape.radii)
    if isinstance(shape, Box):
        return np.array(shape.size)
    return np.array([shape.radius] if isinstance(shape, Sphere) else [shape.radius, shape.length])


def _same_mesh(a: Mesh, b: Mesh) -> bool:
    if a.scale != b.scale:
        return False
    if a.fault is not None or b.fault is not None:
        # There is nothing to compare but the names of files that are not read.
        return a.fault is not None and b.fault is not None and a.file == b.file
    try:
        if a.file and b.file and read_file(a.file) == read_file(b.file) and a.part is b.part:
            return True
        triangles: list[Floats] = [each.triangles[0][each.triangles[1]] for each in (a, b)]
    except DescriptionError:
        return False
    if triangles[0].shape != triangles[1].shape:
        return False
    # Those of one colour stand together where a mesh is written anew.
    orders = [np.lexsort(each.reshape(len(each), -1).T) for each in triangles]
    return _close(triangles[1][orders[1]], triangles[0][orders[0]])

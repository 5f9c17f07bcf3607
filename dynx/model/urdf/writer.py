"""Writer of a model as URDF text in canonical form, each number the shortest that reads back exactly."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

from dynx.argument_types import checks_types
from dynx.errors import DescriptionError, shown
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.elements import IDENTITY, Frame, Inertial, Joint, JointDynamics, Pose, Vector
from dynx.model.geometry import (
    Appearance,
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Geometry,
    LinkGeometry,
    Mesh,
    Plane,
    Shape,
    Sphere,
    Visual,
)
from dynx.model.tree import STANDARD_GRAVITY, Tree
from dynx.model.urdf.reader import FRAME_TAG, LOCKED_TAG, ROBOT_TAG, SPRING_TAG
from dynx.model.xml.text import quoteattr
from dynx.model.xml.values import name_fault

# -- visual and collision shapes of a link --------------------------------------------------------


INDENT = "    "

WriteOrigin = Callable[[Pose, str], Iterator[str]]


MeshPath = Callable[[Mesh], str]
"""Function from a mesh to the path of its file in the document."""

ImagePath = Callable[[str], str]
"""Function from the path of an image to that in the document."""


def _as_it_is(path: str) -> str:
    return path


def _file_of(mesh: Mesh) -> str:
    return mesh.file


def write_shapes(
    geometry: Geometry,
    link: str,
    origin: WriteOrigin,
    mesh_path: MeshPath = _file_of,
    image_path: ImagePath = _as_it_is,
) -> Iterator[str]:
    """Yield the lines of the shapes of a link, with the files of meshes by their full paths, unless other
    paths are given.

    Visual shapes with a fault in the description are left out. Raises DescriptionError for a fault in a
    collision shape, and for a shape that URDF cannot express.
    """
    visuals = () if geometry.links[link].visual_fault else geometry.visuals(link)
    placed: tuple[Visual | Collision, ...] = (*visuals, *geometry.collisions(link))
    for each in placed:
        tag = "visual" if isinstance(each, Visual) else "collision"
        name = f" name={quoteattr(each.name)}" if each.name else ""
        yield f"{INDENT}<{tag}{name}>"
        yield from origin(each.origin, f"{INDENT}  ")
        yield f"{INDENT}  <geometry>{_shape(each.shape, link, mesh_path)}</geometry>"
        if isinstance(each, Visual) and each.material is not None:
            yield f"{INDENT}  {_material(each.material, image_path)}"
        yield f"{INDENT}</{tag}>"


def _shape(shape: Shape, link: str, mesh_path: MeshPath) -> str:
    if isinstance(shape, Box):
        return f'<box size="{_finite_numbers(shape.size)}"/>'
    if isinstance(shape, Sphere):
        return f'<sphere radius="{shape.radius!r}"/>'
    if isinstance(shape, Cylinder | Capsule):
        tag = "cylinder" if isinstance(shape, Cylinder) else "capsule"
        return f'<{tag} radius="{shape.radius!r}" length="{shape.length!r}"/>'
    if isinstance(shape, Ellipsoid):
        return f'<ellipsoid radii="{_finite_numbers(shape.radii)}"/>'
    if isinstance(shape, Plane):
        return '<plane normal="0 0 1"/>'
    if isinstance(shape, Mesh):
        # A mesh that was not found keeps the name that it has in the description, and is not found again.
        path = shape.file if shape.fault is not None else mesh_path(shape)
        if not path:  # Of a mesh that the description states.
            from dynx.model.geometry.stated_mesh import StatedMesh
            from dynx.model.urdf.stated_meshes import stated_mesh_element

            assert isinstance(shape, StatedMesh)
            return stated_mesh_element(shape)
        return f'<mesh filename={quoteattr(path)} scale="{_finite_numbers(shape.scale)}"/>'
    raise DescriptionError(f"URDF cannot express the {type(shape).__name__} of link {shown(link)}")


def _material(material: Appearance, image_path: ImagePath) -> str:
    colour = "" if material.rgba is None else f'<color rgba="{_finite_numbers(material.rgba)}"/>'
    # An image that was not found keeps its name, too.
    path = material.texture
    if path is not None and not material.fault:
        path = image_path(path)
    texture = "" if path is None else f"<texture filename={quoteattr(path)}/>"
    return f"<material name={quoteattr(material.name)}>{colour}{texture}</material>"


def _finite_numbers(numbers: tuple[float, ...]) -> str:
    return " ".join(repr(float(x)) for x in numbers)


# -- the robot ------------------------------------------------------------------------------------


@checks_types
def write_urdf(tree: Tree, /, *, geometry: bool = False) -> str:
    """Return the robot as URDF text in canonical form: one element a line, and nothing that has its default.

    `dynx.load` of the text returns an equal model; equality ignores shapes. Extensions state what URDF cannot
    express, and other readers ignore them: ``<dynx_robot>`` the base, its pose and gravity where they are
    not the default, ``<dynx_locked>`` the position of a locked joint, which is written as fixed,
    ``<dynx_spring>`` stiffness and reference of a joint's spring, ``<dynx_frame>`` that a massless link on a
    fixed joint is an added frame. An infinite limit is written as the largest double, which every engine can
    read; limits of 1e60 (`dynx.model.numbers.MAX_MAGNITUDE`) or more are read back as infinite. With
    `geometry` the visual and collision shapes are written too.

    Raises DescriptionError for a name that URDF cannot express and for a number that is NaN, and with
    `geometry` as `write_shapes` does.
    """
    return urdf_text(tree, geometry=geometry)


def urdf_text(
    tree: Tree,
    *,
    geometry: bool,
    mesh_path: MeshPath = _file_of,
    image_path: ImagePath = _as_it_is,
) -> str:
    """Return the robot as `write_urdf` does, with other paths of meshes and images."""
    refuse_ball_joints(tree, "URDF", "MJCF and SDF do")
    lines = ['<?xml version="1.0"?>', f"<robot name={_name(tree.name)}>", *_settings(tree)]
    for link in tree.links:
        content = [] if link.inertial is None else [*_inertial(link.inertial)]
        if geometry:
            content += write_shapes(tree.geometry, link.name, _origin, mesh_path, image_path)
        if content:
            lines += [f"  <link name={_name(link.name)}>", *content, "  </link>"]
        else:
            lines.append(f"  <link name={_name(link.name)}/>")
    for joint in tree.joints:
        lines += _joint(joint)
    taken = {joint.name for joint in tree.joints}
    for frame in tree.extra_frames:
        name = f"{frame.name}_frame"
        while name in taken:
            name += "_"
        taken.add(name)
        lines.append(f"  <link name={_name(frame.name)}/>")
        marked = Joint(name, "fixed", frame.link, frame.name, frame.placement)
        lines += _joint(marked, f"    <{FRAME_TAG}/>")
    lines += ["</robot>", ""]
    return "\n".join(lines)


def urdf_notes(tree: Tree) -> Iterator[str]:
    """Yield sentences on what URDF cannot say of a robot with its shapes, each with its effect."""
    alone = f"dynx alone reads it, in <{ROBOT_TAG}>"
    if tree.gravity != STANDARD_GRAVITY:
        yield f"URDF states no gravity: {_vector(tree.gravity)} m/s^2 is in an extension; {alone}."
    if tree.floating:
        yield f"URDF does not state that the base moves freely; {alone}."
    if tree.base_pose != IDENTITY:
        yield f"URDF does not state the pose of the base in the world; {alone}."
    for reason, names in (
        ("Added frames are links without mass on fixed joints to other readers", _names(tree.extra_frames)),
        (
            "Locked joints are fixed joints to other readers",
            [joint.name for joint in tree.joints if joint.locked_at is not None],
        ),
        (
            "The armature is an attribute of <dynamics> that other readers may ignore",
            [joint.name for joint in tree.joints if joint.dynamics.armature],
        ),
        (
            f"URDF states no springs of joints: dynx alone reads them, in <{SPRING_TAG}>",
            [joint.name for joint in tree.joints if joint.dynamics.stiffness],
        ),
    ):
        if names:
            yield f"{reason} ({listed(names)})."
    yield from notes_of_open_parts(tree, "URDF")
    kinds: dict[str, list[str]] = {}
    for link in tree.links:
        shapes = tree.geometry.links.get(link.name, LinkGeometry())
        for kind, fault in (("visual", shapes.visual_fault), ("collision", shapes.collision_fault)):
            if fault is not None:
                yield f"The {kind} shapes of link {shown(link.name)} are left out: {fault.message}."
        every: tuple[Visual | Collision, ...] = (*shapes.visuals, *shapes.collisions)
        for each in every:
            if isinstance(each.shape, Capsule | Ellipsoid | Plane):
                tag = f"<{type(each.shape).__name__.lower()}>"
                who = (
                    "dynx alone has it" if isinstance(each.shape, Ellipsoid) else "some readers alone have it"
                )
                kind = f"{tag} is no shape of URDF, and {who}"
                kinds.setdefault(kind, []).append(link.name)
            if isinstance(each.shape, Mesh) and each.shape.fault is not None:
                kind = f"Meshes are named and not copied: {each.shape.fault.message}"
                kinds.setdefault(kind, []).append(link.name)
    for kind, names in kinds.items():
        yield note_of_kind(kind, names)


def notes_of_open_parts(tree: Tree, language: str) -> Iterator[str]:
    """Yield notes on actuators, sensors, contacts, configurations, tendons, constraints and gravity
    compensation, which a format leaves open."""
    if tree.actuators:
        joints = dict.fromkeys(each.joint or each.tendon for each in tree.actuators)
        yield f"{language} has no actuators of a robot; those of some joints are left out ({listed(joints)})."
    if tree.tendons:
        names = listed(each.name or each.joints[0] for each in tree.tendons)
        yield f"{language} has no tendons; those of the robot are left out ({names})."
    if tree.equalities:
        names = listed(each.name or each.first for each in tree.equalities)
        yield (
            f"{language} has no equality constraints as MJCF has them; those of the robot are left out, so "
            f"that loops stay open and joints that they couple move freely ({names})."
        )
    if tree.gravity_compensation:
        names = listed(each.link for each in tree.gravity_compensation)
        yield f"{language} has no gravity compensation; that of some links is left out ({names})."
    if tree.sensors:
        names = listed(each.name or each.type for each in tree.sensors)
        yield f"{language} has no sensors as MJCF has them; those of the robot are left out ({names})."
    if tree.contact_filter is not None and tree.contact_filter.restricts:
        yield f"{language} does not state which shapes may touch; what the robot's file states is left out."
    if tree.configurations:
        names = listed(tree.configurations)
        yield f"{language} has no named configurations; those of the robot are left out ({names})."


def note_of_kind(kind: str, names: Sequence[str]) -> str:
    """Return the one note on all parts that it concerns: how many there are, and their first names."""
    times = f"{len(names)} times: " if len(names) > 1 else ""
    return f"{kind} ({times}{listed(dict.fromkeys(names))})."


def listed(names: Iterable[str]) -> str:
    """Return the first names of a list, and how many more there are."""
    every = list(names)
    more = f" and {len(every) - 3} more" if len(every) > 3 else ""
    return f"{', '.join(map(shown, every[:3]))}{more}"


def _names(frames: Iterable[Frame]) -> list[str]:
    return [frame.name for frame in frames]


def _settings(tree: Tree) -> Iterator[str]:
    """Yield the element of base, gravity and pose of the base, unless they are the default."""
    base = ' base="floating"' if tree.floating else ""
    gravity = f' gravity="{_vector(tree.gravity)}"' if tree.gravity != STANDARD_GRAVITY else ""
    if tree.base_pose != IDENTITY:
        yield f"  <{ROBOT_TAG}{gravity}>"
        yield from _origin(tree.base_pose, "    ")
        yield f"  </{ROBOT_TAG}>"
    elif base or gravity:
        yield f"  <{ROBOT_TAG}{base}{gravity}/>"


def _inertial(inertial: Inertial) -> Iterator[str]:
    yield "    <inertial>"
    yield from _origin(inertial.origin, "      ")
    yield f'      <mass value="{_number(inertial.mass)}"/>'
    moments = " ".join(
        f'{name}="{_number(getattr(inertial, name))}"' for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    yield f"      <inertia {moments}/>"
    yield "    </inertial>"


def _joint(joint: Joint, *marks: str) -> Iterator[str]:
    yield f'  <joint name={_name(joint.name)} type="{joint.type}">'
    yield from _origin(joint.origin, "    ")
    yield f"    <parent link={_name(joint.parent)}/>"
    yield f"    <child link={_name(joint.child)}/>"
    if joint.moves or joint.locked_at is not None:
        yield from _motion(joint)
    yield from marks
    yield "  </joint>"


def _motion(joint: Joint) -> Iterator[str]:
    yield f'    <axis xyz="{_vector(joint.axis)}"/>'
    limits, dynamics, mimic = joint.limits, joint.dynamics, joint.mimic
    ends = f'lower="{_number(limits.lower)}" upper="{_number(limits.upper)}" '
    if joint.type == "continuous":
        ends = ""
    yield f'    <limit {ends}velocity="{_number(limits.velocity)}" effort="{_number(limits.effort)}"/>'
    if dynamics.stiffness:
        stiffness, reference = _number(dynamics.stiffness), _number(dynamics.spring_reference)
        yield f'    <{SPRING_TAG} stiffness="{stiffness}" reference="{reference}"/>'
    if replace(dynamics, stiffness=0.0) != JointDynamics():
        armature = f' armature="{_number(dynamics.armature)}"' if dynamics.armature else ""
        damping, friction = _number(dynamics.damping), _number(dynamics.friction)
        yield f'    <dynamics damping="{damping}" friction="{friction}"{armature}/>'
    if mimic is not None:
        scale, offset = _number(mimic.multiplier), _number(mimic.offset)
        yield f'    <mimic joint={_name(mimic.joint)} multiplier="{scale}" offset="{offset}"/>'
    if joint.locked_at is not None:
        yield f'    <{LOCKED_TAG} value="{_number(joint.locked_at)}"/>'


def _origin(pose: Pose, indent: str) -> Iterator[str]:
    if pose != Pose():
        yield f'{indent}<origin xyz="{_vector(pose.xyz)}" rpy="{_vector(pose.rpy)}"/>'


def _vector(vector: Vector) -> str:
    return " ".join(map(_number, vector))


def _number(value: float) -> str:
    if math.isnan(value):
        raise DescriptionError("a number of the robot is NaN, which URDF cannot express")
    # `float` first: the repr of a NumPy scalar names its type.
    return repr(max(-sys.float_info.max, min(sys.float_info.max, float(value))))


def _name(name: str) -> str:
    fault = name_fault(name)
    if fault is not None:
        raise DescriptionError(f"a name that URDF cannot express: it {fault}")
    return quoteattr(name)

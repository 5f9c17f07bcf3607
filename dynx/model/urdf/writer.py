"""Writer of a model as URDF text in canonical form, each number the shortest that reads back exactly."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator

from dynx.argument_types import checks_types
from dynx.errors import DescriptionError, shown
from dynx.model.elements import Inertial, Joint, JointDynamics, Pose, Vector
from dynx.model.geometry import (
    Appearance,
    Box,
    Capsule,
    Collision,
    Cylinder,
    Geometry,
    Mesh,
    Plane,
    Shape,
    Sphere,
    Visual,
)
from dynx.model.tree import Tree
from dynx.model.urdf.reader import FRAME_TAG, LOCKED_TAG
from dynx.model.urdf.values import name_fault
from dynx.model.xml.text import quoteattr

# -- visual and collision shapes of a link --------------------------------------------------------


INDENT = "    "

WriteOrigin = Callable[[Pose, str], Iterator[str]]


def write_shapes(geometry: Geometry, link: str, origin: WriteOrigin) -> Iterator[str]:
    """Yield the lines of the shapes of a link, with the files of meshes by their full paths.

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
        yield f"{INDENT}  <geometry>{_shape(each.shape, link)}</geometry>"
        if isinstance(each, Visual) and each.material is not None:
            yield f"{INDENT}  {_material(each.material)}"
        yield f"{INDENT}</{tag}>"


def _shape(shape: Shape, link: str) -> str:
    if isinstance(shape, Box):
        return f'<box size="{_finite_numbers(shape.size)}"/>'
    if isinstance(shape, Sphere):
        return f'<sphere radius="{shape.radius!r}"/>'
    if isinstance(shape, Cylinder | Capsule):
        tag = "cylinder" if isinstance(shape, Cylinder) else "capsule"
        return f'<{tag} radius="{shape.radius!r}" length="{shape.length!r}"/>'
    if isinstance(shape, Plane):
        return '<plane normal="0 0 1"/>'
    if isinstance(shape, Mesh):
        # A mesh that was not found keeps the name that it has in the description, and is not found again.
        return f'<mesh filename={quoteattr(shape.file)} scale="{_finite_numbers(shape.scale)}"/>'
    raise DescriptionError(f"URDF cannot express the {type(shape).__name__} of link {shown(link)}")


def _material(material: Appearance) -> str:
    colour = "" if material.rgba is None else f'<color rgba="{_finite_numbers(material.rgba)}"/>'
    texture = "" if material.texture is None else f"<texture filename={quoteattr(material.texture)}/>"
    return f"<material name={quoteattr(material.name)}>{colour}{texture}</material>"


def _finite_numbers(numbers: tuple[float, ...]) -> str:
    return " ".join(repr(float(x)) for x in numbers)


# -- the robot ------------------------------------------------------------------------------------


@checks_types
def write_urdf(tree: Tree, *, geometry: bool = False) -> str:
    """Return the robot as URDF text in canonical form: one element a line, and nothing that has its default.

    With the same base, base pose and gravity, which URDF cannot express, `dynx.load` of the text returns an
    equal model; equality ignores shapes. A locked joint is written as fixed, with its position in the
    extension ``<dynx_locked>``; an added frame as a massless link on a fixed joint, marked by
    ``<dynx_frame>``; other readers ignore both marks. An infinite limit is written as the largest double,
    which every engine can read; limits of 1e60 (`dynx.model.numbers.MAX_MAGNITUDE`) or more are read back as
    infinite. With `geometry` the visual and collision shapes are written too.

    Raises DescriptionError for a name that URDF cannot express and for a number that is NaN, and with
    `geometry` as `write_shapes` does.
    """
    lines = ['<?xml version="1.0"?>', f"<robot name={_name(tree.name)}>"]
    for link in tree.links:
        content = [] if link.inertial is None else [*_inertial(link.inertial)]
        if geometry:
            content += write_shapes(tree.geometry, link.name, _origin)
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
    if dynamics != JointDynamics():
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

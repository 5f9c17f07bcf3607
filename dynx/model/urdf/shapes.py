"""Writer of the visual and collision shapes of a link as URDF text."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from dynx.errors import DescriptionError, shown
from dynx.model.elements import Pose
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
from dynx.model.xml.quoting import quoteattr

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
        return f'<box size="{_numbers(shape.size)}"/>'
    if isinstance(shape, Sphere):
        return f'<sphere radius="{shape.radius!r}"/>'
    if isinstance(shape, Cylinder | Capsule):
        tag = "cylinder" if isinstance(shape, Cylinder) else "capsule"
        return f'<{tag} radius="{shape.radius!r}" length="{shape.length!r}"/>'
    if isinstance(shape, Plane):
        return '<plane normal="0 0 1"/>'
    if isinstance(shape, Mesh):
        # A mesh that was not found keeps the name that it has in the description, and is not found again.
        return f'<mesh filename={quoteattr(shape.file)} scale="{_numbers(shape.scale)}"/>'
    raise DescriptionError(f"URDF cannot express the {type(shape).__name__} of link {shown(link)}")


def _material(material: Appearance) -> str:
    colour = "" if material.rgba is None else f'<color rgba="{_numbers(material.rgba)}"/>'
    texture = "" if material.texture is None else f"<texture filename={quoteattr(material.texture)}/>"
    return f"<material name={quoteattr(material.name)}>{colour}{texture}</material>"


def _numbers(numbers: tuple[float, ...]) -> str:
    return " ".join(repr(float(x)) for x in numbers)

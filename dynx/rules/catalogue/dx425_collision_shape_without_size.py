"""DX425 collision-shape-without-size: A size of a collision shape is zero, negative or missing, or a mesh has
no file.

Exporters and templates write ``<box size="0 0 0"/>``, ``<sphere radius="0"/>`` or ``<mesh filename=""/>`` for
a link that has no shape, and a plate gets a thickness of zero.

- MuJoCo 4.0 refuses the file for any size that is not positive, of a box, sphere, cylinder or capsule ("size
  0 must be positive in geom"), and for a missing attribute ("required attribute missing"). Every positive
  size will do, however small.
- PyBullet 3.2.7 reads sizes of zero and below; it refuses the file ("Cannot load URDF file") where the
  attribute is missing.
- Both refuse a ``<mesh>`` without ``filename``, or with an empty one.
- Drake 1.51 reads shapes only into a scene graph. Then a size that is not positive, of a visual shape too,
  raises ``SystemExit``, which ends the program; it accepts a sphere of radius zero.
- Pinocchio 4.1 reads no shapes into a model.

The dynamics of a link that states its inertia does not depend on shapes; whether the file loads does.

What to do: remove the shape, or give it its size. ``dynx doctor --fix`` removes the ``<collision>``.
``--choose DX425=thicken`` writes 1e-6 m for each size of zero and positive sizes for negative ones instead,
which keeps the contacts of a plate (a shape of which a size or the file is missing is removed all the same);
``--choose DX425=keep`` keeps the file, and MuJoCo refuses it.
"""

from collections.abc import Iterable, Mapping

from dynx.errors import DescriptionError
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.attributes import number_of, vector_of
from dynx.rules.geometry import lacks_file
from dynx.rules.numbers_in_text import decimal

_SIZES: Mapping[str, tuple[str, ...]] = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
}
"""The attributes that every engine requires, by shape."""

_KNOWN = (*_SIZES, "mesh")

_LEAST = 1e-6
"""Size [m] in place of zero: too small for anyone to see, and large beside the rounding of contacts."""


class CollisionShapeWithoutSize(EditingRule):
    stage = "reading"
    advice = "Remove the shape, or give it its size or file."
    engines = measured_on("mujoco", "pybullet")
    choices = {
        "remove": "remove collisions without size",
        "thicken": "write 1e-6 m for sizes of zero; remove a collision only where a size is missing",
        "keep": "keep them; engines that need a size then refuse the file",
    }
    changed = "removed collision shapes without size or file, or gave them a size"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the collisions whose first known shape has such a size."""
        for link in case.source.root.all("link"):
            for collision in link.all("collision"):
                geometry = collision.first("geometry")
                shapes = (
                    [] if geometry is None else [each for each in geometry.children if each.tag in _KNOWN]
                )
                for shape in shapes[:1]:
                    if fault := _fault(shape):
                        yield correction(
                            shape, f"<{shape.tag}> {fault}", *self._edits(case, collision, shape)
                        )

    def _edits(self, case: Case, collision: SourceElement, shape: SourceElement) -> tuple[Edit, ...]:
        chosen = self.chosen(case)
        if chosen == "keep":
            return ()
        sizes = {name: _sizes(shape, name) for name in _SIZES.get(shape.tag, ())}
        if chosen == "remove" or not sizes or None in sizes.values():
            return (case.source.removal(collision),)
        return tuple(
            case.source.attribute_edit(shape, name, " ".join(decimal(abs(each) or _LEAST) for each in found))
            for name, found in sizes.items()
            if found is not None and min(found) <= 0.0
        )


def _fault(shape: SourceElement) -> str | None:
    """Describe the fault of a shape's sizes; None also for text that is no number, which has other rules."""
    if shape.tag == "mesh":
        return "names no file" if lacks_file(shape) else None
    for name in _SIZES[shape.tag]:
        if name not in shape.attributes:
            return f"has no {name}"
        found = _sizes(shape, name)
        if found is not None and min(found) <= 0.0:
            return f'has {name}="{shape.attributes[name]}"'
    return None


def _sizes(shape: SourceElement, name: str) -> tuple[float, ...] | None:
    """Return the sizes [m] in an attribute; None where it is absent or holds anything but finite numbers."""
    try:
        if name == "size":
            return vector_of(shape, name)
        number = number_of(shape, name)
    except DescriptionError:
        return None
    return None if number is None else (number,)

"""DX424 shape-without-geometry: A visual or collision has no geometry, or one that no engine knows.

``<collision/>``, ``<visual><geometry/></visual>`` or a ``<geometry>`` with an element of another format: a
template was not filled in, or an exporter had no shape.

- PyBullet 3.2.7 refuses the file ("Cannot load URDF file"), also for a visual.
- MuJoCo 4.0 refuses it for a collision ("geometry specification not found") and ignores the visual.
- Pinocchio 4.1 drops the shape with a line on stderr. Drake 1.51 warns about it or ignores it.

The dynamics of a link that states its inertia does not depend on shapes; whether the file loads does. The
shapes ``<plane>`` and ``<cdf>``, which PyBullet alone reads, are DX417.

What to do: remove the element, or give it a geometry. ``dynx doctor --fix`` removes it.
``--choose DX424=keep`` keeps it, and engines refuse the file.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.geometry import has_shape, shapes_in


class ShapeWithoutGeometry(EditingRule):
    stage = "reading"
    advice = "Remove the element, or give it a geometry."
    engines = measured_on("pybullet", "mujoco")
    choices = {
        "remove": "remove visuals and collisions without a geometry that an engine knows",
        "keep": "keep them; engines then refuse the file",
    }
    changed = "removed visuals and collisions without geometry"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield visuals and collisions of links without a known shape."""
        for link in case.source.root.all("link"):
            for shape in link.children:
                if shape.tag not in ("visual", "collision") or has_shape(shape):
                    continue
                found = ", ".join(f"<{tag}>" for tag in shapes_in(shape)) or "nothing"
                edits = () if self.chosen(case) == "keep" else (case.source.removal(shape),)
                yield correction(shape, f"the geometry of <{shape.tag}> is {found}", *edits)

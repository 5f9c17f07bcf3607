"""DX417 unknown-collision-shape: A collision has a shape that not every engine knows.

``<plane>`` and ``<cdf>`` are PyBullet's extensions to URDF, whose shapes are box, sphere, cylinder and mesh
(and capsule in later versions).

- MuJoCo 4.0 refuses the file: "visual geometry specification not found", also for a collision.
- Pinocchio 4.1 drops the shape with a line on stderr; Drake 1.51 warns about it or ignores it.
- PyBullet 3.2.7 reads it.

The dynamics of a link that states its inertia does not depend on shapes; whether the file loads does.

What to do: write the shape as a box or a mesh where you need it in other engines. ``dynx doctor --fix``
removes the ``<collision>``. ``--choose DX417=keep`` keeps it, and MuJoCo refuses the file.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.geometry import BULLET_ONLY, KNOWN, shapes_in


class UnknownCollisionShape(EditingRule):
    stage = "reading"
    advice = "Write the shape as a box, sphere, cylinder or mesh."
    engines = measured_on("mujoco")
    choices = {
        "remove": "remove collisions of a shape that not every engine knows",
        "keep": "keep them; MuJoCo then refuses the file",
    }
    changed = "removed collisions of unknown shape"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield collisions whose first geometry contains such a shape and no other."""
        for link in case.source.root.all("link"):
            for collision in link.all("collision"):
                shapes = shapes_in(collision)
                if KNOWN.intersection(shapes) or not BULLET_ONLY.intersection(shapes):
                    continue
                named = ", ".join(f"<{shape}>" for shape in shapes)
                edits = () if self.chosen(case) == "keep" else (case.source.removal(collision),)
                yield correction(collision, f"the geometry of <collision> is {named}", *edits)

"""DX411 repeated-element: An element that is allowed once is repeated.

It happens when files are merged or templates expanded. Readers that look for the origin of a joint find the
first one.

- MuJoCo 4.0 refuses the file: "repeated element", with the line. Collisions and materials count too.
- Pinocchio 4.1, PyBullet 3.2.7 and Drake 1.51 use the first and ignore the others without a warning. So does
  dynx, with a note.

The engines that read the file agree, but an edit of the second of two elements has no effect.

What to do: find out which one is right and remove the other. ``dynx doctor --fix`` keeps the first, which the
engines use.
"""

from collections.abc import Iterable

from dynx.model.xml.source import SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, measured_on

_ONCE = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
    "collision": ("origin", "geometry"),
    "visual": ("material",),
    "geometry": ("box", "sphere", "cylinder", "capsule", "mesh"),
    "material": ("color", "texture"),
}
"""Elements that may occur once, by the element that they are in."""


class RepeatedElement(EditingRule):
    stage = "reading"
    advice = "Keep the right one; engines use the first."
    engines = measured_on("mujoco")
    changed = "removed repeated elements, of which engines use the first"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield every element after the first of its kind."""
        for part in case.source.root.children:
            if part.tag in ("link", "joint", "material"):
                yield from _in(case, part)


def _in(case: Case, part: SourceElement) -> Iterable[Correction]:
    seen = set()
    for child in part.children:
        if child.tag in seen and child.tag in _ONCE[part.tag]:
            message = f"a further <{child.tag}> in the same <{part.tag}>; engines use the first"
            yield correction(child, message, case.source.removal(child))
        elif child.tag in _ONCE:
            yield from _in(case, child)
        seen.add(child.tag)

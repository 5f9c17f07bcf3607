"""DX428 visual-incomplete: A visual lacks a size, a mesh file, or the name or colour of its material.

Dynamics does not depend on visuals; whether the file loads does. Engines read the first shape and the first
material of each.

- PyBullet 3.2.7 refuses the file ("Cannot load URDF file") for a ``<box>`` without ``size``, a ``<sphere>``
  without ``radius``, a ``<cylinder>`` or ``<capsule>`` without ``radius`` or ``length``, a ``<mesh>`` without
  ``filename`` or with an empty one, and a ``<material>`` without ``name``.
- MuJoCo 4.0 refuses it for a ``<color>`` whose ``rgba`` is missing or not four numbers ("attribute 'rgba'
  does not have enough data"), and for a ``<material>`` with neither name nor colour.
- Pinocchio 4.1 and Drake 1.51 load the robot: they read no visuals into a model without geometry.

A collision without its size is DX425, a material directly in the robot DX427, a second material DX411.

What to do: write what is missing. ``dynx doctor --fix`` removes a visual whose shape is incomplete, and gives
a material a name or a grey colour. ``--choose DX428=keep`` keeps the file as it is, and engines refuse it.
"""

from collections.abc import Iterable

from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.geometry import GREY, visual_faults


class VisualIncomplete(EditingRule):
    stage = "reading"
    advice = "Write the size, the file, or the name and colour that the visual lacks."
    engines = measured_on("pybullet", "mujoco")
    choices = {
        "complete": "remove visuals of an incomplete shape, and complete their materials",
        "keep": "keep them; engines then refuse the file",
    }
    changed = "removed incomplete visuals, and completed the materials of visuals"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the faults of each visual of a link."""
        for link in case.source.root.all("link"):
            for visual in link.all("visual"):
                faults = list(visual_faults(visual))
                # A visual is removed once, whatever else is wrong in it.
                whole = [each for each, _ in faults if each.tag not in ("material", "color")]
                for element, message in faults:
                    keep = self.chosen(case) == "keep"
                    edits = () if keep or (whole and element not in whole) else _edits(case, visual, element)
                    yield correction(element, message, *edits)


def _edits(case: Case, visual: SourceElement, element: SourceElement) -> tuple[Edit, ...]:
    if element.tag == "material":
        line = f"visual_in_line_{visual.line}"
        return (case.source.attribute_edit(element, "name", line),)
    if element.tag == "color":
        return (case.source.replacement(element, GREY),)
    return (case.source.removal(visual),)

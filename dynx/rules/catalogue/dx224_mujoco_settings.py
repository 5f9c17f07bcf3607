"""DX224 mujoco-settings: The file has settings of MuJoCo's compiler that change the masses or forces of the
robot.

MuJoCo reads an element ``<mujoco>`` in a URDF, which authors add for the folder of the meshes. Other
attributes of its ``<compiler>`` change the robot: ``boundmass`` and ``boundinertia`` raise small masses and
moments, ``settotalmass`` scales all masses, ``balanceinertia`` and ``inertiafromgeom`` replace tensors, and
``autolimits="false"`` makes MuJoCo refuse the limits of a URDF. In ``<option>`` the attributes ``density``,
``viscosity`` and ``wind`` add the drag of a fluid, and ``<flag>`` switches gravity or constraints off.

- MuJoCo 4.0 obeys them.
- Pinocchio 4.1, PyBullet 3.2.7 and Drake 1.51 ignore ``<mujoco>``. So does dynx.

The effect on MuJoCo is of any size: masses scaled to another total scale all torques.

What to do: state the masses and tensors that you mean, and set options in the program. ``dynx doctor --fix``
removes these attributes and leaves the others, such as ``meshdir`` and ``fusestatic``.
``--choose DX224=keep`` keeps them, and MuJoCo reads another robot.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on

_SETTINGS = {
    "compiler": (
        *("boundmass", "boundinertia", "settotalmass", "balanceinertia", "inertiafromgeom"),
        *("inertiagrouprange", "autolimits"),
    ),
    "option": ("density", "viscosity", "wind"),
    "flag": (
        *("constraint", "equality", "frictionloss", "limit", "contact", "gravity"),
        *("passive", "spring", "damper"),
    ),
}
"""Attributes that change masses or forces, by element."""


class MujocoSettings(EditingRule):
    stage = "reading"
    advice = "Remove these settings from <mujoco>."
    engines = measured_on("mujoco")
    choices = {
        "remove": "remove settings of MuJoCo that change masses or forces",
        "keep": "keep them; MuJoCo then reads another robot",
    }
    changed = "removed settings of MuJoCo that change masses or forces"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the elements with such an attribute."""
        for mujoco in case.source.root.all("mujoco"):
            for element in mujoco.walk():
                names = [name for name in _SETTINGS.get(element.tag, ()) if name in element.attributes]
                if not names:
                    continue
                edits = (
                    ()
                    if self.chosen(case) == "keep"
                    else [case.source.attribute_removal(element, name) for name in names]
                )
                message = f"<{element.tag}> of <mujoco> sets {' and '.join(names)}"
                yield correction(element, message, *edits)

"""DX305 empty-dynamics: A dynamics element has neither damping nor friction.

``<dynamics/>``, or one that holds only an extension such as ``armature="0.01"``. URDF makes both attributes
optional and defines their defaults; it does not require one of them.

- Pinocchio 4.1 and PyBullet 3.2.7 refuse the file: "joint dynamics element specified with no damping and no
  friction". They do so for every type of joint, fixed ones included.
- MuJoCo 4.0 and Drake 1.51 read it.

What to do: write ``damping="0"``, or remove the element. ``dynx doctor --fix`` adds ``damping="0"``, which
keeps other attributes. A number under a misspelled name, ``<dynamics dampng="0.5"/>``, is what was meant, and
gets the right name.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, measured_on
from dynx.rules.attributes import completion, misspelled_numbers
from dynx.rules.joints import elements_in_joints

_EITHER = ("damping", "friction")


class EmptyDynamics(EditingRule):
    stage = "reading"
    advice = 'Write damping="0", or remove the element.'
    engines = measured_on("pinocchio", "pybullet")
    changed = "wrote a damping of 0 into <dynamics> without damping and friction"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the first ``<dynamics>`` of every joint, moving or not."""
        for _, dynamics in elements_in_joints(case, "dynamics"):
            if not set(_EITHER) & dynamics.attributes.keys():
                meant = misspelled_numbers(dynamics, _EITHER)
                message = "<dynamics> has neither damping nor friction"
                yield completion(case, dynamics, message, tuple(meant) or _EITHER[:1], "0")

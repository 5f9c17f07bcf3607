"""DX110 massless-moving-link: A joint carries a link without mass, which MuJoCo refuses although the link
carries others.

Links without mass between two joints are common: a shoulder of three axes is mostly written as three joints
with two empty links between them. The motion is well defined, because they carry a link with mass.

- MuJoCo 4.0.0 refuses the file ("mass and inertia of moving bodies must be larger than mjMINVAL"). Links
  rigidly connected to the link count with it.
- Pinocchio 4.1.0, PyBullet 3.2.7 and Drake 1.51.1 accept such links.

The effect: the file does not load in MuJoCo.

What to do: the robot is correct. For MuJoCo, give the link a mass that is too small to measure.

``dynx doctor --fix`` gives the link 2e-15 kg and 1.5e-14 kg m^2 about every axis, just above the smallest
that MuJoCo accepts. In a robot of kilograms and metres that is below rounding. Choose ``--choose DX110=keep``
to keep the file. Where nothing beyond the joint has mass, see DX113.
"""

from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, links_of, measured_on
from dynx.rules.inertia import massless_links, with_least_inertia


class MasslessMovingLink(Rule):
    engines = measured_on("mujoco")
    advice = "For MuJoCo, give the link a mass and moments just above 1e-15 and 1e-14."
    choices = {
        "least": "give the link the least mass and moments that MuJoCo accepts",
        "keep": "keep the file; MuJoCo refuses it",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the moving links without mass and tensor that carry a link with mass or tensor."""
        message = "a joint carries the link, which has neither mass nor inertia"
        for name, bare in massless_links(case).items():
            if not bare:
                yield Detection(name, None, case.links[name].line, message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the case with the least mass and moments that MuJoCo accepts."""
        if self.chosen(case) == "keep":
            return None
        return Remedy(*with_least_inertia(case, links_of(detections)), self.decision(case))

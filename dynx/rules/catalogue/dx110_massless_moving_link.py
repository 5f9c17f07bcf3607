"""DX110 massless-moving-link: A joint carries a link without mass, which MuJoCo refuses though others hang on
it.

Links without mass between two joints are common: a shoulder of three axes is mostly written as three joints
with two empty links between them. The motion is well defined, because something with mass hangs on them.

- MuJoCo 4.0.0 refuses the file ("mass and inertia of moving bodies must be larger than mjMINVAL"). What is
  welded to the link counts with it.
- Pinocchio 4.1.0, PyBullet 3.2.7 and Drake 1.51.1 take such links without trouble.

The effect: the file does not load in MuJoCo.

What to do: nothing is wrong with the robot. For MuJoCo, give the link a mass that nobody can measure.

``dynx doctor --fix`` gives the link 2e-15 kg and 1.5e-14 kg m^2 about every axis, just above what MuJoCo
takes for nothing. In a robot of kilograms and metres that is below rounding. Choose ``--choose DX110=keep``
to leave the file as it is. Where nothing beyond the joint has mass, see DX113.
"""

from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, measured_on
from dynx.rules.inertia.massless_links import massless_links, with_least_inertia


class MasslessMovingLink(Rule):
    engines = measured_on("mujoco")
    advice = "For MuJoCo, give the link a mass and moments just above 1e-15 and 1e-14."
    choices = {
        "least": "give the link the least mass and moments that MuJoCo takes",
        "keep": "leave the file as it is; MuJoCo refuses it",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Links that a joint moves, that have neither mass nor tensor, and that carry something with mass."""
        message = "a joint carries the link, which has neither mass nor inertia"
        return [
            Detection(name, None, case.links[name].line, message)
            for name, bare in massless_links(case).items()
            if not bare
        ]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """The least that MuJoCo takes."""
        if self.chosen(case) == "keep":
            return None
        names = [detection.link for detection in detections if detection.link is not None]
        return Remedy(*with_least_inertia(case, names), self.decision(case))

"""DX120 negative-mass: The mass of a link is negative.

No body has a negative mass. It comes from an edit by hand, from an exporter that subtracts a hole, or from a
"correction" that makes the sum of several links right.

For a link that moves, measured:

- Pinocchio 4.1 adds inertias and divides their first moment by the larger of the mass and 2e-16 kg. The
  centre of mass of the link is then 1e20 m away or more, and torques are beyond 1e40 N m.
- PyBullet 3.2.7 loads the file, and inverse dynamics and the mass matrix fail ("invalid mass").
- MuJoCo 4.0 refuses the file ("mass and inertia of moving bodies must be larger than mjMINVAL").
- Drake 1.51 replaces the inertia by that of a ball of water of 1 kg, with a warning.

dynx refuses the file, with the line.

What to do: enter the mass of the body. ``dynx doctor --fix`` removes the sign, which is a guess that the
report names. ``--choose DX120=zero`` writes 0 instead.
"""

from collections.abc import Iterable

from dynx.rules import EVERY_ENGINE, Case, Correction, EditingRule, correction
from dynx.rules.attributes import number_or_none


class NegativeMass(EditingRule):
    stage = "reading"
    advice = "Enter the mass of the body, in kilograms."
    engines = EVERY_ENGINE
    choices = {
        "absolute": "remove the sign of a negative mass",
        "zero": "make a negative mass zero",
    }
    changed = "made the mass of links positive or zero"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the mass that engines read in each link."""
        for link in case.source.root.all("link"):
            inertial = link.first("inertial")
            mass = None if inertial is None else inertial.first("mass")
            if mass is None or (number_or_none(mass, "value") or 0.0) >= 0.0:
                continue
            written = mass.attributes["value"].strip()
            instead = "0" if self.chosen(case) == "zero" else written.removeprefix("-")
            edit = case.source.attribute_edit(mass, "value", instead)
            yield correction(mass, f"the link has a mass of {written} kg", edit)

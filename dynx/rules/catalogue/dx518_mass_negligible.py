"""DX518 mass-negligible: A link has a mass below a microgram, which no part of a robot has.

A screw has a gram, a grain of sand a milligram. Masses such as 1e-10 or 1e-15 kg are written because an
importer refused a link without mass, or they are residues of a computation whose result is zero. The lightest
link of example-robot-data that is not zero has 1e-9 kg, exactly a microgram.

Engines accept such a mass down to a bound of their own: MuJoCo 4.0.0 refuses a moving body below 1e-15 kg. A
joint that carries nothing else accelerates by millions of rad/s^2 under the smallest torque, so a simulation
with any step diverges, and forward dynamics loses digits.

What to do: write zero, and attach frames by fixed joints; or enter the mass of the part. The file does not
say which was meant, so no edit removes the cause. The mass that ``dynx doctor --fix`` gives to moving links
without mass (DX110), 2e-15 kg, is not reported.
"""

from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule
from dynx.rules.inertia import MIN_MASS, line_of

_MICROGRAM = 1e-9
"""One microgram [kg]."""


class MassNegligible(Rule):
    kind = "practice"
    advice = "Write zero and attach the frame by a fixed joint, or enter the mass of the part."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links with a mass between zero and a microgram."""
        for name, inertial in case.inertials.items():
            if inertial is not None and 0.0 < inertial.mass < _MICROGRAM and inertial.mass != 2.0 * MIN_MASS:
                message = f"the mass is {inertial.mass:.3g} kg"
                yield Detection(name, None, line_of(case, name, "mass"), message)

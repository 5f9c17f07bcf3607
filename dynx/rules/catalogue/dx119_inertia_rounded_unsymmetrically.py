"""DX119 inertia-rounded-unsymmetrically: PyBullet's inverse dynamics refuses the robot for the rounding of a
heavy link's tensor.

Before the first call of ``calculateInverseDynamics``, ``calculateMassMatrix`` or ``calculateJacobian``,
PyBullet 3.2.7 moves the tensor of each link to the link's origin, and checks that it is symmetric. It
computes two opposite entries as ``(m x) y`` and ``(m y) x``, which are rounded differently, and compares them
with a fixed bound of 1.1e-15 kg m^2 (five units in the last place of 1), whatever the size of the link. A
link can fail once two coordinates of its centre of mass, along the principal axes, and its mass have a
product above 2 kg m^2. Of links with a centre of mass within half a metre, a quarter failed at 100 kg, and
four of five at 100 t.

- PyBullet 3.2.7 prints "invalid inertia tensor for body 3 I(2,0)!=I(0,2)", and all three calls raise an
  exception for the robot from then on. Links that cannot move are checked too, but never the root. Poses and
  the simulation are right.
- Pinocchio 4.1.0, MuJoCo 4.0.0 and Drake 1.51.1 have no such check.

The effect: no inverse dynamics, no mass matrix and no Jacobian in PyBullet.

What to do: change the last digit of the centre of mass.

``dynx doctor --fix`` moves the centre of mass by a few units in the last place, so that the products are
rounded alike. The equations of motion change by rounding.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product

from dynx.engines.pybullet.inertia_checks import MAX_ASYMMETRY, tree_asymmetry
from dynx.model.elements import Inertial
from dynx.rules import Case, Detection, Remedy, Rule, links_of, measured_on
from dynx.rules.inertia import line_of, with_inertials

_STEPS = range(-16, 17)
"""Units in the last place by which each coordinate is moved."""


class InertiaRoundedUnsymmetrically(Rule):
    engines = measured_on("pybullet")
    advice = "Move the centre of mass by a few units in its last place."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links whose tensor PyBullet's inverse dynamics finds unsymmetric."""
        for name, inertial in case.inertials.items():
            if inertial is None or name == case.model.root:
                continue
            gap = tree_asymmetry(inertial)
            if gap > MAX_ASYMMETRY:
                message = (
                    f"about the link's origin PyBullet's tensor of {inertial.mass:.6g} kg is unsymmetric by "
                    f"{gap:.2g} kg m^2"
                )
                yield Detection(name, None, line_of(case, name, "origin"), message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the case with each centre of mass moved by rounding."""
        held = {name: case.inertials[name] for name in links_of(detections)}
        moved = {name: new for name, each in held.items() if each and (new := _moved(each)) is not None}
        done = "moved the centre of mass of heavy links by a few units in the last place"
        return Remedy(with_inertials(case, moved), done) if moved else None


def _moved(inertial: Inertial) -> Inertial | None:
    """Return the inertial with the nearest centre of mass whose tensor is symmetric; None where none is."""
    x, y, z = inertial.origin.xyz
    for i, j, k in sorted(product(_STEPS, repeat=3), key=lambda steps: sum(map(abs, steps))):
        xyz = (x + i * math.ulp(x), y + j * math.ulp(y), z + k * math.ulp(z))
        moved = replace(inertial, origin=replace(inertial.origin, xyz=xyz))
        if tree_asymmetry(moved) <= MAX_ASYMMETRY:
            return moved
    return None

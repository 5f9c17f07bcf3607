"""DX105 inertia-not-diagonal: PyBullet diagonalises a tensor with products of inertia only to a millionth.

Bullet stores principal moments only. Where ``ixy``, ``ixz`` or ``iyz`` is not zero, its loader diagonalises
the tensor by Jacobi's method and stops as soon as the products of inertia are below a millionth of the trace,
after one more rotation. The remaining products are dropped.

- PyBullet 3.2.7: its tensor is off by 1e-14 to 1e-9 of its size, and by up to 2e-6 where principal moments
  are nearly equal.
- Pinocchio 4.1.0, MuJoCo 4.0.0 and Drake 1.51.1 are right to rounding.

The effect: mass matrix and inverse dynamics are off by 1e-13 to 1e-9 of their size, accelerations by up to
1e-8. No simulation shows that; a comparison of two engines to rounding does, and smaller differences are
hidden behind it. 46 of 69 public robots have this difference.

What to do: nothing if a millionth is good enough. To make engines agree to rounding, give the principal
moments and rotate the inertial frame instead.

``dynx doctor --fix`` does that: the moments about the principal axes, no products of inertia, and the axes in
the ``rpy`` of the inertial's origin, each with as many digits as a double has, calculated in extended
precision. It is the same tensor. MuJoCo up to 3.13 ignored that ``rpy`` (DX112).
"""

from collections.abc import Iterable, Sequence

from dynx.engines.pybullet.inertia_checks import bullet_reading, diagonalisation_error
from dynx.rules import Case, Detection, Remedy, Rule, links_of, measured_on
from dynx.rules.inertia import (
    CentralInertia,
    fault_beyond_rounding,
    inertials_in_groups,
    is_borderline,
    line_of,
    with_inertials,
    with_raised_moments,
)

_MAX_ERROR = 1e-14
"""Largest error, relative to the tensor, that is not reported: 1 % of the tolerance of `dynx.diagnose`."""


class InertiaNotDiagonal(Rule):
    engines = measured_on("pybullet")
    advice = "Give the principal moments, with the axes in the rpy of the inertial."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links that can move and whose tensor PyBullet's diagonalisation does not reproduce."""
        for name, inertial, group in inertials_in_groups(case):
            if group.static or bullet_reading(inertial).zeroed:
                continue
            error = diagonalisation_error(inertial)
            if error > _MAX_ERROR:
                message = f"PyBullet's diagonalisation of the tensor is off by {error:.1e} of its size"
                yield Detection(name, None, line_of(case, name, "inertia"), message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Return the same tensors in principal form."""
        found = set(links_of(detections))
        new = {}
        for name, inertial, group in inertials_in_groups(case):
            if name not in found:
                continue
            principal = CentralInertia.of(inertial).inertial(inertial.origin.rpy)
            root, on_fixed_joint = name == case.model.root, name in group.parents
            if fault_beyond_rounding(inertial) is None and is_borderline(
                principal, root=root, on_fixed_joint=on_fixed_joint
            ):
                principal = with_raised_moments(principal)
            new[name] = principal
        many = "one tensor" if len(new) == 1 else f"{len(new)} tensors"
        done = f"gave {many} by principal moments, with the axes in the inertial's rpy"
        return Remedy(with_inertials(case, new), done)

"""DX105 inertia-not-diagonal: PyBullet turns a tensor with products of inertia to its principal axes only to
a millionth.

Bullet knows principal moments alone. Where ``ixy``, ``ixz`` or ``iyz`` is not zero, its loader turns the
tensor to its principal axes by Jacobi's method and stops as soon as the products of inertia are below a
millionth of the trace, after one more rotation. What is left of them is dropped.

- PyBullet 3.2.7: the tensor it holds is off by 1e-14 to 1e-9 of its size, and by up to 2e-6 where principal
  moments are nearly equal.
- Pinocchio 4.1.0, MuJoCo 4.0.0 and Drake 1.51.1 are right to rounding.

The effect: mass matrix and inverse dynamics are off by 1e-13 to 1e-9 of their size, accelerations by up to
1e-8. No simulation will notice; a comparison of two engines to rounding will, and it hides there whatever
else is wrong below that level. 46 of 69 public robots have this difference.

What to do: nothing, if a millionth is good enough. To make engines agree to rounding, give the principal
moments and turn the inertial frame instead.

``dynx doctor --fix`` does that: the moments about the principal axes, no products of inertia, and the axes
in the ``rpy`` of the inertial's origin, each with as many digits as a double has, calculated in extended
precision. It is the same tensor. MuJoCo up to 3.13 ignored that ``rpy`` (DX112).
"""

from collections.abc import Iterable, Sequence

from dynx.engines.pybullet.inertia_checks import diagonalisation_error, read_by_bullet
from dynx.rules import Case, Detection, Remedy, Rule, measured_on
from dynx.rules.inertia.central import CentralInertia
from dynx.rules.inertia.edits import line_of, with_inertials
from dynx.rules.inertia.physical import clear_fault, lifted, on_the_edge
from dynx.rules.inertia.rigid_groups import rigid_groups

_NOTICEABLE = 1e-14
"""Share of the tensor: a hundredth of what the comparison of engines can show."""


class InertiaNotDiagonal(Rule):
    engines = measured_on("pybullet")
    advice = "Give the principal moments, with the axes in the rpy of the inertial."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Links that can move and whose tensor PyBullet's diagonalisation does not reproduce."""
        groups = rigid_groups(case)
        for link in case.model.links:
            inertial = link.inertial
            if inertial is None or groups[link.name].static or read_by_bullet(inertial).zeroed:
                continue
            error = diagonalisation_error(inertial)
            if error > _NOTICEABLE:
                message = f"PyBullet's diagonalisation of the tensor is off by {error:.1e} of its size"
                yield Detection(link.name, None, line_of(case, link.name, "inertia"), message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """The same tensors in principal form."""
        groups = rigid_groups(case)
        new = {}
        for detection in detections:
            name = detection.link
            inertial = None if name is None else case.inertials[name]
            if name is None or inertial is None:
                continue
            turned = CentralInertia.of(inertial).inertial(inertial.origin.rpy)
            root, welded = name == case.model.root, name in groups[name].parents
            if clear_fault(inertial) is None and on_the_edge(turned, root=root, welded=welded):
                turned = lifted(turned)
            new[name] = turned
        many = "one tensor" if len(new) == 1 else f"{len(new)} tensors"
        done = f"gave {many} by principal moments, with the axes in the inertial's rpy"
        return Remedy(with_inertials(case, new), done)

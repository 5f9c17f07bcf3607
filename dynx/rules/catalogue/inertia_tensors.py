"""Inertia tensors that no body can have, or that engines round, rotate or drop."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from dynx.engines.pybullet.file_checks import (
    MAX_ASYMMETRY,
    bullet_reading,
    diagonalisation_error,
    tree_asymmetry,
)
from dynx.model.elements import Inertial
from dynx.model.mechanism import pose_arrays
from dynx.rules import Case, Detection, Remedy, Rule, links_of, measured_on
from dynx.rules.inertia import (
    ACCEPTED_MOMENT,
    MIN_MASS,
    MIN_MOMENT,
    ROUNDING,
    CentralInertia,
    ImpossibleInertia,
    RigidGroup,
    as_inertial,
    fault_beyond_rounding,
    inertials_in_groups,
    is_borderline,
    line_of,
    merged_inertials,
    moment_increase,
    nearest_moments,
    principal_moments,
    rigid_groups,
    with_inertials,
    with_raised_moments,
)
from dynx.spatial.scalar import FLOAT64_EPS, Floats, longdouble
from dynx.spatial.so3 import rotation_from_rpy

_MAX_CORRECTIONS = 4


class InertiaBrokenByRounding(Rule):
    """DX102 inertia-broken-by-rounding: A principal moment equals the sum of the other two, so rounding
    decides whether engines accept it.

    The principal moments of a rigid body are never negative, and none exceeds the sum of the other two. For a
    thin plate or rod, and for a point mass about the joint, the largest moment equals this sum. Then the last
    binary digit decides whether an engine accepts the moments, and engines round differently. For example,
    0.3 does not exceed 0.1 + 0.2 in doubles, but 0.13 exceeds 0.1 + 0.03 by 3e-17.

    - PyBullet 3.2.7 tests the moments to the last bit after its own diagonalisation. If the moments fail this
      test, PyBullet prints "Bad inertia tensor properties" and sets the whole tensor to zero. Inverse
      dynamics of PyBullet tests the moments again, about the origin of the link. If the moments fail this
      second test, inverse dynamics, mass matrix and Jacobian of the whole robot fail.
    - MuJoCo 4.0.0 may refuse the file ("inertia must satisfy A + B >= C"). If the rpy of the inertial rotates
      a plate, this happens in about two of five cases.
    - Pinocchio 4.1.0 has no such test. Drake 1.51.1 has a tolerance of 1e-14.

    The effect: if PyBullet sets the tensor to zero, its mass matrix is off by 1e-6 to 0.9 of its size.

    What to do: the tensor is correct. Raise the moments by less than anyone can measure.

    ``dynx doctor --fix`` adds the same amount to all three moments: 16 units in the last place of the largest
    moment about the link's origin. If the link is a point mass on a fixed joint, ``dynx doctor --fix`` merges
    it with its parent link. The equations of motion change by a few 1e-15 of their size.
    """

    engines = measured_on("pybullet", "mujoco")
    advice = "Raise the moments by a few units in the last place."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links that a check refuses because of rounding at the triangle inequality."""
        for name, inertial, group in inertials_in_groups(case):
            # Inverse dynamics checks no link that cannot move.
            root = group.static or name == case.model.root
            if not is_borderline(inertial, root=root, on_fixed_joint=name in group.parents):
                continue
            small, middle, large = principal_moments(inertial)
            message = (
                f"the principal moment {float(large):.6g} and the sum of the others, {float(small):.6g} and "
                f"{float(middle):.6g}, differ by rounding only: {float(small + middle - large):.2g}"
            )
            if large == 0.0:
                message = "a point mass: its inertia about the origin of the link has a moment of zero"
            yield Detection(name, None, line_of(case, name, "inertia"), message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Raise the moments of each link, or merge a point mass on a fixed joint with its parent."""
        wrong = links_of(detections)
        kept = set(links_of(self.detect(case))).difference(wrong)
        # Merged inertias may need a correction in their turn.
        for _ in range(_MAX_CORRECTIONS):
            for name in wrong:
                case = _without_borderline(case, name)
            wrong = [name for name in links_of(self.detect(case)) if name not in kept]
            if not wrong:
                break
        return Remedy(case, "raised moments on the bound of what a body can have by a few 1e-15 of them")


def _without_borderline(case: Case, name: str) -> Case:
    inertial, group = case.inertials[name], rigid_groups(case)[name]
    if inertial is None:
        return case
    if name in group.parents and not inertial.tensor.any():
        return with_inertials(case, merged_inertials(case, group, (group.head, name), group.head))
    return with_inertials(case, {name: with_raised_moments(inertial)})


class InertiaOfNoBody(ImpossibleInertia):
    """DX103 inertia-of-no-body: A principal moment of inertia exceeds the sum of the other two, which no body
    can have.

    Each principal moment of a body is an integral over its mass, such as the integral of x^2 + y^2. So no
    principal moment can exceed the sum of the other two. If a tensor violates this by more than rounding,
    there was a mistake: the tensor was mistyped, written in mixed units, or computed about several points.
    Sometimes all six numbers are the placeholder 1e-6.

    - PyBullet 3.2.7 prints "Bad inertia tensor properties" and sets the whole tensor to zero.
    - MuJoCo 4.0.0 refuses the file ("inertia must satisfy A + B >= C"), even if the link cannot move.
    - Drake 1.51.1 prints a warning, and replaces the tensor by that of a ball of water of the same mass.
    - Pinocchio 4.1.0 uses the numbers unchanged, as dynx does.

    So three engines load three different robots, and MuJoCo loads none. On public robots the mass matrix is
    off by 6e-6 (a finger) to 4 % (a sensor mount), and the accelerations are off by up to 40 %.

    What to do: find the true tensor. With the tensor of the file, the results of every engine are wrong.

    ``dynx doctor --fix`` first adds the inertias of the links that are rigidly connected to this link. If a
    body can have this sum, it merges the inertias into one link, which changes no equation of motion.
    Otherwise it writes the nearest tensor that a body can have, and the report says that the physics changed.
    ``--choose DX103=nearest`` never merges links. With ``--choose DX103=keep`` the file keeps the tensor, and
    the report prints code that sets it in PyBullet and Drake after loading. MuJoCo cannot use such a tensor.
    """

    fault = "triangle"


class NegativePrincipalMoment(ImpossibleInertia):
    """DX104 negative-principal-moment: The inertia tensor has a negative principal moment, which no body can
    have.

    A moment of inertia is a sum of masses times squared distances, so it cannot be negative. A negative
    principal moment mostly comes from one of two mistakes. Either the parallel axis theorem was applied in
    the wrong direction or twice. Or the products of inertia are too large for the moments, because of a
    misplaced decimal point, mixed units, or two exchanged numbers. The three numbers on the diagonal may look
    correct.

    - PyBullet 3.2.7 prints "Bad inertia tensor properties" and sets the whole tensor to zero.
    - MuJoCo 4.0.0 refuses the file ("inertia must have positive eigenvalues"), even if the link cannot move.
    - Drake 1.51.1 prints a warning, and replaces the tensor by that of a ball of water of the same mass.
    - Pinocchio 4.1.0 uses the numbers unchanged, as dynx does. The mass matrix may then have a negative
      eigenvalue, and a simulation gains energy without a source.

    What to do: find the true tensor. With the tensor of the file, the results of every engine are wrong.

    ``dynx doctor --fix`` first adds the inertias of the links that are rigidly connected to this link. If a
    body can have this sum, it merges the inertias into one link, which changes no equation of motion.
    Otherwise it writes the nearest tensor that a body can have, and the report says that the physics changed.
    ``--choose DX104=nearest`` never merges links. With ``--choose DX104=keep`` the file keeps the tensor, and
    the report prints code that sets it in PyBullet and Drake after loading. If PyBullet's inverse dynamics
    still refuses the tensor, the doctor extrapolates the results from those of two robots that PyBullet
    accepts. MuJoCo cannot use such a tensor.
    """

    fault = "negative"


_MAX_DIAGONALISATION_ERROR = 1e-14
"""Largest error, relative to the tensor, that is not reported: 1 % of the tolerance of `dynx.diagnose`."""


class InertiaNotDiagonal(Rule):
    """DX105 inertia-not-diagonal: PyBullet diagonalises a tensor with products of inertia only to a
    millionth.

    PyBullet stores principal moments only. If ``ixy``, ``ixz`` or ``iyz`` is not zero, its loader
    diagonalises the tensor by Jacobi's method. When the products of inertia are below a millionth of the
    trace, the loader makes one last rotation, and drops the remaining products.

    - The tensor in PyBullet 3.2.7 is off by 1e-14 to 1e-9 of its size. If principal moments are nearly equal,
      it is off by up to 2e-6.
    - Pinocchio 4.1.0, MuJoCo 4.0.0 and Drake 1.51.1 are right to rounding.

    The effect: mass matrix and inverse dynamics are off by 1e-13 to 1e-9 of their size, and accelerations by
    up to 1e-8. This is too small to see in a simulation. But if you compare two engines to rounding, this
    difference hides smaller differences. 46 of the 69 robots of example-robot-data have this difference.

    What to do: if an accuracy of a millionth is good enough, do nothing. To make engines agree to rounding,
    write the principal moments, and rotate the inertial frame.

    ``dynx doctor --fix`` writes the moments about the principal axes, zero products of inertia, and the axes
    as the ``rpy`` of the inertial's origin. It calculates them in extended precision, and writes all digits
    of a double. The tensor is the same. MuJoCo up to 3.13 ignores this ``rpy`` (DX112).
    """

    engines = measured_on("pybullet")
    advice = "Write the principal moments, with the axes as the rpy of the inertial."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links that can move and whose tensor PyBullet's diagonalisation does not reproduce."""
        for name, inertial, group in inertials_in_groups(case):
            if group.static or bullet_reading(inertial).zeroed:
                continue
            error = diagonalisation_error(inertial)
            if error > _MAX_DIAGONALISATION_ERROR:
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


_ROUNDING_OF_ROTATION = 4.0 * float(np.finfo(float).eps)


class RootInertialRotated(Rule):
    """DX106 root-inertial-rotated: With a fixed base PyBullet mistakes the axes of the root's inertial frame
    for those of the world.

    The ``<inertial>`` of the root link has an ``rpy`` that is not zero. With a fixed base the mass of the
    root does not affect the motion, so the ``rpy`` should have no effect.

    - PyBullet 3.2.7 calculates inverse dynamics and Jacobians in the axes of this inertial frame. So the
      direction of gravity and the rows of the Jacobian are rotated. The kinematics and the mass matrix are
      right, so the error is hard to find.
    - Pinocchio 4.1.0, MuJoCo 4.0.0 and Drake 1.51.1 are not affected.

    The effect grows with the rotation: gravity is off by 2 sin(angle/2) of its magnitude. A rotation by 90
    degrees makes gravity horizontal. Products of inertia of the root have no effect with a fixed base.

    What to do: write the root's tensor in the axes of its link.

    ``dynx doctor --fix`` rotates the tensor into the axes of the link, and sets the ``rpy`` to zero. The body
    is the same. With a floating base there is no such difference, and the file stays as it is.
    """

    engines = measured_on("pybullet")
    advice = "Write the root's tensor in the axes of its link, with rpy zero."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the root, on the fixed base, where its inertial frame is rotated."""
        model = case.model
        inertial = case.inertials[model.root]
        if case.base != "fixed" or inertial is None:
            return []
        turn = rotation_from_rpy(np.array(inertial.origin.rpy)) - np.eye(3)
        if float(np.max(np.abs(turn))) <= _ROUNDING_OF_ROTATION:
            return []
        rpy = " ".join(f"{angle:.6g}" for angle in inertial.origin.rpy)
        message = f"the inertial frame of the root is rotated by rpy {rpy}"
        return [Detection(model.root, None, line_of(case, model.root, "origin"), message)]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Return the tensor in the axes of the link."""
        found = {name: case.inertials[name] for name in links_of(detections)}
        new = {name: CentralInertia.of(inertial).aligned() for name, inertial in found.items() if inertial}
        done = "gave the tensor of the root in the axes of its link, with rpy zero"
        return Remedy(with_inertials(case, new), done)


_MAX_ADDED_SHARE = 1e-3
"""Largest addition to the moments of a body, as a share of the robot's largest moment of inertia."""


class InertiaTooSmall(Rule):
    """DX111 inertia-too-small: A moment of inertia is below 1e-14 kg m^2, which MuJoCo refuses.

    Some engines compare moments of inertia with fixed small numbers, whatever the size of the robot.

    - MuJoCo 4.0.0 refuses a file in which a principal moment is below 1e-14 kg m^2 ("inertia must have
      positive eigenvalues"), unless the whole tensor is zero. Examples are a thin rod with a moment of 0
      about its axis, and tensors of rounding residues such as -1e-20. MuJoCo also refuses a point mass on a
      joint ("mass and inertia of moving bodies must be larger than mjMINVAL"). MuJoCo merges rigidly
      connected links one after another. It refuses the file if one of the sums is a point or a rod. MuJoCo
      also checks links that cannot move.
    - PyBullet 3.2.7 replaces a tensor with a negative residue by zero, which has no effect on the results. If
      the inertia about a joint axis is below 2.2e-16 kg m^2, PyBullet's simulation does not move the joint.
    - Pinocchio 4.1.0 and Drake 1.51.1 use the numbers unchanged.

    The effect: the file does not load in MuJoCo.

    What to do: in a robot of ordinary size, raise the moment to 1e-14 kg m^2, which has no effect on the
    results. For a robot of micrometres, change the unit of length or mass.

    ``dynx doctor --fix`` merges such a link with the links rigidly connected to it, which changes no equation
    of motion. If this is not enough, it raises the moments to 1.5e-14 kg m^2. In a very small robot this
    number is more than a rounding error of the largest inertia. The report then says that the physics
    changed. If 1.5e-14 kg m^2 is more than a thousandth of the largest inertia, the file stays as it is.
    """

    engines = measured_on("mujoco")
    advice = "Raise the moment to 1e-14 kg m^2, or change the unit if the robot really is so small."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links with such a tensor, and moving links whose rigid group is a point or a rod."""
        groups = rigid_groups(case)
        inertials, found = case.inertials, {}
        for name, inertial in inertials.items():
            if inertial is not None and _is_too_small(inertial, static=groups[name].static):
                smallest = float(principal_moments(inertial)[0])
                found[name] = f"the principal moment {smallest:.3g} is below {MIN_MOMENT:g} kg m^2"
        for group in dict.fromkeys(groups.values()):
            if group.static or any(name in found for name in group.links):
                continue
            if (what := _group_defect(group, inertials)) is not None:
                found[group.head] = what
        for name in inertials:
            if name in found:
                yield Detection(name, None, line_of(case, name, "inertia"), found[name])

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Merge each with the links rigidly connected to it; raise moments where that is not enough."""
        before, merged, raised, largest = case, 0, 0, 0.0
        for name in links_of(detections):
            group = rigid_groups(case)[name]
            own = case.inertials[name]
            if group.static and own is not None and own.mass == 0.0:
                # A link that has no mass and cannot move needs no tensor.
                case = with_inertials(case, {name: Inertial(0.0, own.origin)})
                raised += 1
                continue
            heavy = [each for each in group.links if case.model.inertial(each).mass > 0.0]
            into = group.head
            if name != into or (heavy and heavy != [into] and not group.static):
                links = (into, name) if group.static else tuple(dict.fromkeys((into, *heavy)))
                bodies = merged_inertials(case, group, links, into)
                case = with_inertials(case, bodies)
                merged += 1
            held = case.inertials[into]
            if held is None or not (
                _is_too_small(held, static=group.static) or (_is_point(held) and not group.static)
            ):
                continue
            central = CentralInertia.of(held)
            moments, axes = central.principal(held.origin.rpy)
            near = central.about(nearest_moments(moments), axes)
            if (
                moment_increase(near, ACCEPTED_MOMENT)
                > _MAX_ADDED_SHARE * _largest_inertia(before, in_parent=True)
                and not group.static
            ):
                continue
            largest = max(largest, moment_increase(near, ACCEPTED_MOMENT))
            raised_body = CentralInertia.of(with_raised_moments(near, ACCEPTED_MOMENT))
            case = with_inertials(case, {into: as_inertial(case, into, raised_body, held)})
            raised += 1
        if not (merged or raised):
            return None
        parts = [f"merged {merged} links with links rigidly connected to them"] if merged else []
        parts += [f"raised moments of {raised} links to {ACCEPTED_MOMENT:g} kg m^2"] if raised else []
        changes_physics = largest > ROUNDING * _largest_inertia(before)
        return Remedy(case, " and ".join(parts), changes_physics=changes_physics)


def _is_too_small(inertial: Inertial, *, static: bool) -> bool:
    """Check whether MuJoCo refuses the tensor by itself; DX108 is about moving links without mass."""
    if inertial.mass == 0.0 and not static:
        return False
    if not inertial.tensor.any() or fault_beyond_rounding(inertial) is not None:
        return False
    return bool(principal_moments(inertial)[0] < MIN_MOMENT)


def _is_point(inertial: Inertial) -> bool:
    return inertial.mass >= MIN_MASS and not inertial.tensor.any()


def _group_defect(group: RigidGroup, inertials: Mapping[str, Inertial | None]) -> str | None:
    """Explain why a moving group has no inertia about an axis, adding its links from the head on; or None."""
    total: CentralInertia | None = None
    for count, name in enumerate(n for n in group.links if (i := inertials[n]) is not None and i.mass > 0.0):
        inertial = inertials[name]
        assert inertial is not None
        part = CentralInertia.of(inertial).transform(*group.poses[name])
        total = part if total is None else total + part
        if count > 0 and total.moments()[0] < MIN_MOMENT and fault_beyond_rounding(inertial) is None:
            return "together with its rigid group the link is a row of points, without inertia about one axis"
    if total is not None and total.mass >= MIN_MASS and not total.tensor.any():
        return f"a joint carries a point mass of {float(total.mass):.6g} kg, without inertia"
    return None


def _largest_inertia(case: Case, *, in_parent: bool = False) -> float:
    """Return the largest moment of inertia of a link about its origin, or also about that of its parent."""
    arms = {joint.child: pose_arrays(joint.origin, longdouble) for joint in case.model.joints if in_parent}
    largest = 0.0
    for link in case.model.links:
        if link.inertial is not None:
            body = CentralInertia.of(link.inertial)
            frames = [body, body.transform(*arms[link.name])] if link.name in arms else [body]
            largest = max(largest, *(float(np.max(np.diagonal(each.about_origin()))) for each in frames))
    return largest


_MAX_CHANGE_BY_ROTATION = 1e-14
"""Largest change, relative to the largest moment, that is not reported."""


class InertialRotationIgnored(Rule):
    """DX112 inertial-rotation-ignored: MuJoCo up to 3.13 ignores the rpy of an inertial.

    The ``<origin>`` of an ``<inertial>`` may rotate the axes of the tensor.

    - MuJoCo 3.3.7, 3.12 and 3.13 drop the rotation. They use the tensor as if its axes were those of the link
      (issue 3559 of MuJoCo's repository). MuJoCo 4.0.0 is right.
    - Pinocchio 4.1.0, PyBullet 3.2.7, Drake 1.51.1 are right.

    The effect grows with the difference between the principal moments. For long thin links, entries of the
    mass matrix are wrong by up to a factor of ten. Mass and centre of mass are right, so poses and gravity
    torques are right.

    What to do: use MuJoCo 4. Or write the tensor in the axes of the link, with rpy zero. PyBullet then has an
    error of 1e-9 (DX105).

    dynx does not edit the file, because this edit would undo the remedy of DX105.
    """

    engines = measured_on(mujoco=">=3.3.7,<=3.13.0")
    advice = "Use MuJoCo 4."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links that can move and whose tensor changes where the rotation is left out."""
        for name, inertial, group in inertials_in_groups(case):
            if group.static or not any(inertial.origin.rpy):
                continue
            change = np.max(np.abs(CentralInertia.of(inertial).tensor - inertial.tensor))
            size = float(np.max(np.abs(inertial.tensor)))
            if change > _MAX_CHANGE_BY_ROTATION * size:
                line = line_of(case, name, "origin")
                message = f"without its rpy the tensor is off by {float(change) / size:.2g} of its size"
                yield Detection(name, None, line, message)


_MUJOCO_THRESHOLD = 1e-6
"""Bound on each coordinate of the centre of mass [m] and of the vector part of the quaternion."""

_NEGLIGIBLE_OFFSET = 1e-14
"""Offset [m] and relative change of the tensor that are not reported."""

_ROUNDING_OF_PRODUCTS = 8.0 * FLOAT64_EPS
"""Products of inertia, relative to the largest moment, with which MuJoCo does not rotate the axes."""

_EQUAL_MOMENTS = 1e-12
"""Relative difference of two moments up to which MuJoCo does not exchange their axes."""

_EXACT_FRAMES = "mujoco.exact_inertial_frames"


class TinyInertialOffset(Rule):
    """DX117 tiny-inertial-offset: MuJoCo drops the pose of an inertial frame that differs from the link frame
    by less than 1e-6.

    MuJoCo stores the inertia of a body about its principal axes, the largest moment first. It also stores the
    pose of these axes in the body frame: the centre of mass and the rotation. When MuJoCo compiles a model,
    it marks each body whose inertial frame nearly coincides with the body frame (``body_sameframe``). For a
    marked body it does not use the stored pose.

    - MuJoCo 4.0.0 drops the rotation if it is smaller than about 2e-6 rad (each component of the vector part
      of its quaternion is below 1e-6). If also each coordinate of the centre of mass is below 1e-6 m, MuJoCo
      drops the centre of mass. MuJoCo first merges rigidly connected links, so these bounds apply to the
      merged body. With ``<mujoco><compiler fusestatic="false"/></mujoco>`` they apply to each link.
    - Pinocchio 4.1.0, PyBullet 3.2.7 and Drake 1.51.1 use all numbers.

    The effect: a dropped centre of mass changes torques by 1e-7 of their size or less. But in a robot whose
    links are all balanced, a centre of mass at 7e-7 m caused 2.3e-2 of the torques. A dropped rotation
    changes the mass matrix by 1e-6 of the difference between the moments.

    What to do: usually the offset is noise of a CAD program. Then write zero. If the number is intended,
    clear the marks after loading:
    ``model.body_sameframe[:] = model.body_simple[:] = model.dof_simplenum[:] = 0``. No other text of the
    ``<inertial>`` avoids the marks, because MuJoCo orders the axes itself.

    By default dynx prints this line of code, and uses it to prove the cause. ``--choose DX117=zero`` writes
    zero into the file instead, for all engines. The report then says that the physics changed. If a robot
    with a floating base has no moving joint, the line of code has no effect, and dynx writes zero.
    """

    engines = measured_on("mujoco")
    advice = "Write zero if the offset is noise; otherwise clear MuJoCo's marks after loading."
    choices = {
        "call": "clear the marks in MuJoCo after loading",
        "zero": "write zero for what MuJoCo drops; this changes the physics",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first link of each moving rigid group whose inertial frame MuJoCo drops."""
        if _EXACT_FRAMES in case.calls:
            return
        for group, body in _moving_bodies(case):
            message = _dropped_by_mujoco(body)
            if message:
                yield Detection(group.head, None, line_of(case, group.head, "origin"), message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Add the call, or write zero, as chosen; only the latter helps where no joint moves."""
        if self.chosen(case) == "call" and any(joint.moves for joint in case.model.joints):
            done = "gave MuJoCo the inertial frames of the file"
            return Remedy(case.with_calls(_EXACT_FRAMES), done, self.decision(case))
        for name in links_of(detections):
            group = rigid_groups(case)[name]
            held = [each for each in group.links if case.inertials[each] is not None]
            merged = merged_inertials(case, group, held, name) if held != [name] else {}
            whole = merged.get(name) or case.model.inertial(name)
            case = with_inertials(case, merged | {name: _without_offset(whole)})
        done = "wrote zero for offsets of inertial frames below 1e-6"
        return Remedy(case, done, self.decision(case), changes_physics=True)


def _moving_bodies(case: Case) -> Iterator[tuple[RigidGroup, CentralInertia]]:
    """Yield each moving rigid group with mass, and its inertia in the frame of its head."""
    for group in dict.fromkeys(rigid_groups(case).values()):
        total: CentralInertia | None = None
        for name in () if group.static else group.links:
            inertial = case.inertials[name]
            if inertial is not None:
                part = CentralInertia.of(inertial).transform(*group.poses[name])
                total = part if total is None else total + part
        if total is not None and total.mass > 0.0 and total.tensor.any():
            yield group, total


def _dropped_by_mujoco(body: CentralInertia) -> str:
    """Describe what MuJoCo drops of the pose of the principal axes; empty for nothing that matters."""
    center, tensor = np.abs(body.center.astype(np.float64)), _without_rounding(body.tensor.astype(np.float64))
    moments, axes = CentralInertia(body.mass, body.center, tensor).principal()
    largest = float(np.max(moments))
    if np.any(np.diff(moments) > _EQUAL_MOMENTS * largest):
        return ""  # MuJoCo exchanges axes, and so keeps the attitude.
    R = axes.astype(np.float64)
    vector = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 4.0
    if np.any(np.abs(vector) >= _MUJOCO_THRESHOLD) or np.trace(R) < 2.0:
        return ""
    change = float(np.max(np.abs(tensor - np.diag(np.diagonal(tensor))))) / largest
    parts = []
    if np.all(center < _MUJOCO_THRESHOLD) and np.max(center) > _NEGLIGIBLE_OFFSET:
        parts.append(f"a centre of mass {float(np.linalg.norm(center)):.2g} m off the link frame")
    if change > _NEGLIGIBLE_OFFSET:
        parts.append(f"principal axes rotated by {2.0 * float(np.linalg.norm(vector)):.2g} rad")
    return f"MuJoCo drops {' and '.join(parts)}" if parts else ""


def _without_rounding(tensor: Floats) -> Floats:
    """Return the tensor without products of inertia that are rounding."""
    small = np.abs(tensor) <= _ROUNDING_OF_PRODUCTS * np.max(np.abs(tensor))
    return np.where(small & ~np.eye(3, dtype=bool), 0.0, tensor)


def _without_offset(inertial: Inertial) -> Inertial:
    """Return the inertial with its frame in that of the link, where MuJoCo drops the difference."""
    tensor = CentralInertia.of(inertial)
    x, y, z = (float(value) for value in np.diagonal(tensor.tensor))
    center = tensor.center.astype(np.float64)
    at_origin = bool(np.all(np.abs(center) < _MUJOCO_THRESHOLD))
    origin = inertial.origin
    xyz = (0.0, 0.0, 0.0) if at_origin else origin.xyz
    return Inertial(inertial.mass, type(origin)(xyz, (0.0, 0.0, 0.0)), ixx=x, iyy=y, izz=z)


_STEPS_IN_LAST_PLACE = range(-16, 17)
"""Units in the last place by which each coordinate is moved."""


class InertiaRoundedUnsymmetrically(Rule):
    """DX119 inertia-rounded-unsymmetrically: PyBullet's inverse dynamics refuses the robot because of
    rounding errors in a heavy link's tensor.

    PyBullet 3.2.7 checks each link before the first call of ``calculateInverseDynamics``,
    ``calculateMassMatrix`` or ``calculateJacobian``. It computes the tensor of the link about the link's
    origin, and checks that the tensor is symmetric. It computes two opposite entries as ``(m x) y`` and
    ``(m y) x``, whose rounding errors differ. Here m is the mass, and x and y are two coordinates of the
    centre of mass along the principal axes. PyBullet compares the difference of the two entries with a fixed
    bound of 1.1e-15 kg m^2 (five units in the last place of 1), whatever the size of the link. So a link can
    fail if m x y is above 2 kg m^2. In a test with centres of mass within half a metre, a quarter of the
    links failed at 100 kg, and four of five at 100 t.

    - PyBullet 3.2.7 prints "invalid inertia tensor for body 3 I(2,0)!=I(0,2)", and all three calls raise an
      exception for this robot. PyBullet also checks links that cannot move, but never the root. Poses and the
      simulation are right.
    - Pinocchio 4.1.0, MuJoCo 4.0.0 and Drake 1.51.1 have no such check.

    The effect: no inverse dynamics, no mass matrix and no Jacobian in PyBullet.

    What to do: change the last digit of the centre of mass.

    ``dynx doctor --fix`` moves the centre of mass by a few units in the last place, so that both products
    have the same rounding error. The equations of motion change by rounding.
    """

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
        moved = {
            name: new
            for name, each in held.items()
            if each and (new := _with_symmetric_tensor(each)) is not None
        }
        done = "moved the centre of mass of heavy links by a few units in the last place"
        return Remedy(with_inertials(case, moved), done) if moved else None


def _with_symmetric_tensor(inertial: Inertial) -> Inertial | None:
    """Return the inertial with the nearest centre of mass whose tensor is symmetric; None where none is."""
    x, y, z = inertial.origin.xyz
    for i, j, k in sorted(product(_STEPS_IN_LAST_PLACE, repeat=3), key=lambda steps: sum(map(abs, steps))):
        xyz = (x + i * math.ulp(x), y + j * math.ulp(y), z + k * math.ulp(z))
        moved = replace(inertial, origin=replace(inertial.origin, xyz=xyz))
        if tree_asymmetry(moved) <= MAX_ASYMMETRY:
            return moved
    return None

"""Masses and inertias that hardly any body has."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from itertools import product

import numpy as np

from dynx.model import Link
from dynx.model.elements import Inertial
from dynx.rules import Case, Detection, Rule
from dynx.rules.geometry import (
    Extent,
    body_extents,
    geometry_elements,
    group_extents,
    largest_volume,
    link_extent,
)
from dynx.rules.inertia import LEAST_MASS, line_of, rigid_groups
from dynx.spatial.scalar import Floats

_ROUNDING_OF_BOUNDS = 1e-9
"""Relative margin for rounding: a spherical shell on a sphere reaches the bound exactly."""


class InertiaBeyondGeometry(Rule):
    """DX501 inertia-beyond-geometry: A moment of inertia is larger than the link's shape and mass allow.

    The rule has two bounds.

    The first bound is a largest moment. Let R be the largest distance of a point of the body from an axis.
    Then the moment of inertia about this axis is at most m R^2, where m is the mass. Real parts have a third
    of this bound or less. The rule uses the principal axes of the tensor through the centre of mass. It
    computes R from all shapes of the link and of the links rigidly connected to it. A mesh counts as its
    convex hull, so R is never too small.

    The second bound is a largest extent. Let the hull of the shapes reach from -a to b along a direction, as
    seen from the centre of mass. Then the mean square of the mass's coordinate in this direction is at most a
    b (Bhatia and Davis 2000). The tensor determines this mean square: half the sum of the three moments,
    minus the moment about the direction, divided by the mass. The rule examines thirteen directions (the
    link's axes and diagonals), and the three principal directions. For example, this bound finds a plate with
    the tensor of a block. Shapes are often drawn without the motor inside. So the rule widens the hull by a
    hundredth of its diagonal. It reports a root mean square only if this is more than a tenth above the
    bound.

    Usual causes:

    - The tensor is in kg mm^2 or g mm^2 instead of kg m^2.
    - The tensor was computed about the origin of the link frame instead of the centre of mass.
    - The mesh is scaled by 0.001, but the tensor is not.
    - The tensor is a placeholder.

    All engines use the numbers unchanged. So they agree with each other, but not with the real robot: torques
    are too large, and controllers that were tuned with this model are too stiff.

    The file does not contain the true tensor, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Export the tensor again, in kg m^2 and about the centre of mass."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links with such a moment, one detection each, for what is furthest beyond its bound."""
        for link, extent in group_extents(case):
            assert link.inertial is not None
            excess, moment, bound = max(_against_bounds(link.inertial, extent))
            message = None
            if excess > 1.0 + _ROUNDING_OF_BOUNDS:
                message = (
                    f"a principal moment is {moment:.3g} kg m^2, {excess:.3g} times the {bound:.3g} that "
                    f"{link.inertial.mass:.3g} kg have at the farthest point of {_shapes_around(case, link)}"
                )
            else:
                message = _spread_beyond(case, link, extent)
            if message:
                yield Detection(link.name, None, link.inertial.line, message)


_MARGIN_OF_SHAPES = 0.01
"""Ratio of the margin of a link's shapes to the diagonal of their box."""

_EXCESS_OF_SPREAD = 0.1
"""Relative excess of a root mean square beyond its bound from which it is reported."""

_DIRECTIONS = np.array(
    [each for each in product((-1.0, 0.0, 1.0), repeat=3) if each > (0.0, 0.0, 0.0)], dtype=np.float64
)
"""Axes and diagonals of a cube (13, 3), of each line one direction."""


def _shapes_around(case: Case, link: Link) -> str:
    """Name the shapes over which the mass of a link may be spread: its own, or those of its rigid group."""
    group = rigid_groups(case)[link.name].links
    shaped = [name for name in group if next(geometry_elements(case.links[name]), None) is not None]
    return "the link's shape" if shaped == [link.name] else "the shapes of the link and those fixed to it"


def _spread_beyond(case: Case, link: Link, extent: Extent) -> str | None:
    """Describe the direction in which the mass is spread furthest beyond what the shape allows."""
    inertial = case.model.inertial(link.name)
    center, tensor = inertial.origin.matrix[:3, 3], inertial.link_tensor / inertial.mass
    principal = np.linalg.eigh(tensor)[1].T
    directions = np.concatenate([_DIRECTIONS, principal])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    squares = np.trace(tensor) / 2.0 - np.einsum("ni,ij,nj->n", directions, tensor, directions)
    low, high = extent.range_along(directions)
    margin = _MARGIN_OF_SHAPES * extent.diagonal()
    below, above = directions @ center - low + margin, high - directions @ center + margin
    if np.any(below <= 0.0) or np.any(above <= 0.0):
        return None  # The centre of mass is outside: DX503.
    worst = int(np.argmax(squares / (below * above)))
    spread, bound = math.sqrt(max(squares[worst], 0.0)), math.sqrt(below[worst] * above[worst])
    if spread <= bound * (1.0 + _EXCESS_OF_SPREAD):
        return None
    direction = " ".join(f"{value + 0.0:.2g}" for value in directions[worst])
    return (
        f"the mass is spread by {spread:.3g} m (root mean square) along {direction}, where "
        f"{_shapes_around(case, link)} and the centre of mass allow {bound:.3g} m"
    )


def _against_bounds(inertial: Inertial, extent: Extent) -> Iterator[tuple[float, float, float]]:
    """Yield each principal moment: how many times its bound it is, itself, and the bound [kg m^2]."""
    T_link_inertial = inertial.origin.matrix
    moments, axes = np.linalg.eigh(inertial.tensor)
    directions = (T_link_inertial[:3, :3] @ axes).T
    for moment, direction in zip(moments.tolist(), directions, strict=True):
        bound = inertial.mass * extent.reach_from_axis(T_link_inertial[:3, 3], direction) ** 2
        yield moment / bound if bound > 0.0 else (np.inf if moment > 0.0 else 0.0), moment, bound


_LEAST_RADIUS_OF_GYRATION = 0.01
"""Ratio to the shape's diagonal; all but 1 % of the mass is then within a tenth of it (Chebyshev)."""


class InertiaBelowGeometry(Rule):
    """DX502 inertia-below-geometry: The inertia is that of a body a hundred times smaller than the link's
    shape.

    The radius of gyration k = sqrt(I / m) of a uniform body is a fifth to a half of its size. Examples are
    l/3.5 for a rod of length l, and d/3.2 for a ball of diameter d. The rule reports a link if its largest k
    is below a hundredth of the diagonal of its shape. Usual causes:

    - The tensor has a wrong unit. It is then too small by a factor of 1e-6 or 1e-9.
    - The tensor was written with too few digits (``1e-06`` everywhere).
    - The tensor is zero, because an importer required the element.

    Engines that load such a tensor use it unchanged. Torques are too small, forward dynamics is badly
    conditioned, and simulators with a fixed time step may oscillate or diverge at such joints.

    The file does not contain the true tensor, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Export the tensor again, in kg m^2 and with enough digits."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links with mass whose largest radius of gyration is below 1 % of their own shape."""
        for link in case.model.links:
            if link.inertial is None or link.inertial.mass == 0.0:
                continue
            extent = link_extent(case.links[link.name], case.source.source)
            if extent is None or extent.empty:
                continue
            largest = max(float(np.linalg.eigvalsh(link.inertial.tensor)[-1]), 0.0)
            gyration, size = math.sqrt(largest / link.inertial.mass), extent.diagonal()
            if gyration < _LEAST_RADIUS_OF_GYRATION * size:
                message = (
                    f"the largest radius of gyration is {gyration:.2g} m in a shape of {size:.2g} m across"
                )
                yield Detection(link.name, None, link.inertial.line, message)


class CenterOfMassOutsideGeometry(Rule):
    """DX503 center-of-mass-outside-geometry: The centre of mass lies outside the bounding box of the link's
    shape.

    Mass cannot be negative, so the centre of mass of a body is inside its convex hull, and inside its
    bounding box. The rule uses the bounding box of all shapes of the link and of the links rigidly connected
    to it, along the axes of the link frame. It widens the box by a hundredth of the diagonal, because shapes
    may be slightly too small.

    Usual causes:

    - The ``<origin>`` of ``<inertial>`` is in millimetres.
    - The ``<origin>`` is in the frame of the CAD assembly or of the parent link instead of the link's frame.
    - The ``<origin>`` was mirrored for the other side of the robot with a wrong sign.
    - The ``<origin>`` of ``<visual>`` moved the mesh, but the inertial was not moved.

    All engines use the numbers unchanged: gravity torques are wrong by the same amount in all of them.

    The file does not contain the true centre of mass, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Write the origin of the inertial in metres and in the frame of its own link."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links whose centre of mass is outside, and by how much."""
        for link, extent in group_extents(case):
            assert link.inertial is not None
            low, high = extent.box()
            center = link.inertial.origin.matrix[:3, 3]
            outside = float(np.max(np.maximum(low - center, center - high)))
            if outside > _MARGIN_OF_SHAPES * extent.diagonal():
                message = (
                    f"the centre of mass is {outside:.3g} m outside the box of {extent.diagonal():.3g} m "
                    f"across that holds {_shapes_around(case, link)}"
                )
                yield Detection(link.name, None, link.inertial.line, message)


_MIN_LINKS_ALIKE = 3
"""Smallest number of links that share a tensor with equal moments."""


class PlaceholderInertia(Rule):
    """DX504 placeholder-inertia: The inertia is a placeholder: the unit matrix, or one tensor for links of
    different mass.

    The rule reports two patterns. First, the tensor is exactly the unit matrix. 1 kg m^2 about every axis is
    the inertia of a steel ball of 0.15 m radius and 111 kg, not of a usual link. Second, at least three links
    have the same tensor with three equal moments (0.001 in many tutorials), although their masses differ.

    All engines use the numbers unchanged. If a link of a few hundred grams has the unit matrix as its tensor,
    this placeholder dominates the inertia of the whole arm. Torques, and gains tuned with them, are then
    useless.

    The file does not contain the true tensor, so no edit removes the cause. A better guess is the inertia of
    the link's shapes with uniform density.
    """

    kind = "practice"
    advice = "Compute the inertia from the CAD model or from the link's shape and mass."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links with mass whose tensor is the unit matrix, or shared by links of different mass."""
        masses = defaultdict(list)
        for link in case.model.links:
            if link.inertial is not None and (moment := _equal_moments(link.inertial)):
                masses[moment].append(link.inertial.mass)
        for link in case.model.links:
            moment = None if link.inertial is None else _equal_moments(link.inertial)
            if link.inertial is None or not moment:
                continue
            if moment == 1.0:
                message = f"the inertia of {link.inertial.mass:.6g} kg is the unit matrix"
            elif len(masses[moment]) >= _MIN_LINKS_ALIKE and len(set(masses[moment])) > 1:
                message = (
                    f"the inertia is {moment:.6g} kg m^2 about every axis, as on {len(masses[moment])} links "
                    f"from {min(masses[moment]):.6g} to {max(masses[moment]):.6g} kg"
                )
            else:
                continue
            yield Detection(link.name, None, link.inertial.line, message)


def _equal_moments(inertial: Inertial) -> float | None:
    """Return the one moment of a diagonal tensor with three equal moments on a link with mass."""
    off_diagonal = (inertial.ixy, inertial.ixz, inertial.iyz)
    if inertial.mass == 0.0 or any(off_diagonal) or not inertial.ixx == inertial.iyy == inertial.izz:
        return None
    return inertial.ixx


_MAX_MASS_RATIO = 1e6


class MassRatioExtreme(Rule):
    """DX505 mass-ratio-extreme: Two bodies that a joint connects differ in mass by a factor of a million or
    more.

    Rigidly connected links count as one body. This rule does not report bodies without mass. If the masses of
    two connected bodies differ by a factor of a million, results lose six of the 16 digits of a double. The
    worst case is a light body that carries a heavy body.

    Some simulators solve joints as constraints between free bodies (ODE in Gazebo, contacts in Bullet and
    MuJoCo). They converge slowly or not at all, and joints drift apart and oscillate. Forward dynamics loses
    digits in every engine, because the condition number of the mass matrix is about as large as the ratio of
    the masses. Inverse dynamics is not affected, and engines agree on it.

    Usual causes:

    - A mass is in grams or tonnes, and other masses are in kilograms.
    - A sensor frame has ``mass value="1e-06"``, because an importer refused links without mass.

    Only the author of the file knows the right mass, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Attach frames without a body by fixed joints, and give every mass in kilograms."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield moving joints between such bodies, with the head of the lighter rigid group."""
        heads = {name: group.head for name, group in rigid_groups(case).items()}
        mass = dict.fromkeys(heads.values(), 0.0)
        for link in case.model.links:
            mass[heads[link.name]] += 0.0 if link.inertial is None else link.inertial.mass
        for joint in case.model.joints:
            light, heavy = sorted((heads[joint.parent], heads[joint.child]), key=mass.__getitem__)
            if mass[light] > 0.0 and mass[heavy] >= _MAX_MASS_RATIO * mass[light]:
                message = (
                    f"body {light} has {mass[light]:.3g} kg and its neighbour {heavy} {mass[heavy]:.3g} kg, "
                    f"{mass[heavy] / mass[light]:.1g} times as much"
                )
                yield Detection(light, joint.name, case.model.link(light).line, message)


_LEAST_DENSITY, _GREATEST_DENSITY = 1.0, 25_000.0
"""Bounds of the density [kg/m^3]."""

_THINNEST_SIDE = 0.01
"""Least side of a box, as a share of its diagonal."""


class DensityImplausible(Rule):
    """DX517 density-implausible: A body is denser than any metal, or lighter than air, for the size of its
    shape.

    Here a body is a group of rigidly connected links. The rule divides the mass of a body by two volumes.

    - The first volume is the bounding box of the body's shapes. The body is smaller than the box, so its true
      density is higher than this quotient. The rule reports a quotient above 25,000 kg/m^3 (osmium, the
      densest metal, has 22,600). Thin plates are often drawn too thin. So each side of the box counts as at
      least a hundredth of its diagonal.
    - The second volume is that of the largest single shape (a mesh counts as its convex hull). The shapes
      together are at least as large, so the true density is lower than this quotient. The rule reports a
      quotient below 1 kg/m^3 (air has 1.2).

    example-robot-data has 1,122 such bodies. Their median density is 500 kg/m^3. 98 % of them have between 20
    and 21,400 kg/m^3, and the least is 2.5 (a drone with an arm). The rule reports only the finger knuckles
    of one hand, which have 50 g in cubes of 2 mm.

    Usual causes:

    - A mass is in grams or tonnes.
    - A shape is in millimetres without ``scale="0.001 0.001 0.001"``.
    - The shape is a tiny placeholder.
    - An exporter computed the mass from a mesh in the wrong unit.

    All engines use the numbers unchanged. A heavy finger dominates every torque of the arm that carries it.

    The file does not say whether the mass or the shape is wrong, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Give the mass in kilograms and the shape in metres."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the heaviest link of each body whose mass does not fit the size of its shapes."""
        for group, extent in body_extents(case):
            masses = {name: case.model.inertial(name).mass for name in group.links}
            mass, heaviest = math.fsum(masses.values()), max(masses, key=lambda name: masses[name])
            low, high = extent.box()
            sides, least = (high - low).tolist(), _THINNEST_SIDE * extent.diagonal()
            thick = [max(side, least) for side in sides]
            if mass > _GREATEST_DENSITY * math.prod(thick):
                size = " x ".join(f"{side:.3g}" for side in thick)
                message = f"{mass:.3g} kg in a box of {size} m is {mass / math.prod(thick):.3g} kg/m^3"
            elif mass < _LEAST_DENSITY * math.prod(sides):  # Cheap, and no shape is larger than the box.
                volume = largest_volume(case, group)
                if mass >= _LEAST_DENSITY * volume * (1.0 - _ROUNDING_OF_BOUNDS):
                    continue
                message = f"{mass:.3g} kg in a shape of {volume:.3g} m^3 is {mass / volume:.3g} kg/m^3"
            else:
                continue
            yield Detection(heaviest, None, case.model.inertial(heaviest).line, message)


_MICROGRAM = 1e-9
"""One microgram [kg]."""


class MassNegligible(Rule):
    """DX518 mass-negligible: A link has a mass below a microgram, which no part of a robot has.

    A screw has a gram, and a grain of sand has a milligram. Masses such as 1e-10 or 1e-15 kg have two causes.
    Either an importer refused a link without mass. Or the mass is the rounding error of a computation whose
    exact result is zero. In example-robot-data the smallest mass that is not zero is 1e-9 kg, exactly a
    microgram.

    Engines accept small masses. Only MuJoCo 4.0.0 refuses a moving body below 1e-15 kg. If a joint carries
    only a link of such a mass, a very small torque causes an acceleration of millions of rad/s^2. So a
    simulation diverges with any time step, and forward dynamics loses digits.

    What to do: if the link is a frame, write zero and attach it by a fixed joint. Otherwise enter the mass of
    the part. The file does not say which is right, so no edit removes the cause. The rule does not report
    2e-15 kg, the mass that ``dynx doctor --fix`` gives to moving links without mass (DX110).
    """

    kind = "practice"
    advice = "Write zero and attach the frame by a fixed joint, or enter the mass of the part."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links with a mass between zero and a microgram."""
        for name, inertial in case.inertials.items():
            if inertial is not None and 0.0 < inertial.mass < _MICROGRAM and inertial.mass != LEAST_MASS:
                message = f"the mass is {inertial.mass:.3g} kg"
                yield Detection(name, None, line_of(case, name, "mass"), message)


_GREATEST_MASS_PER_CUBE = 1e7
"""Largest mass per cube of the length [kg/m^3]."""

_LEAST_SHARE, _LEAST_ROBOT = 0.02, 1e-3
"""Least length that counts, as a share of the sum of all; least sum [m] of a robot that is examined."""


class MassBeyondSize(Rule):
    """DX519 mass-beyond-size: A body without shapes is far too heavy for the distances between its joints.

    A body without shapes has no size in the file. So the rule estimates a length: the largest distance from
    the body's frame to its centres of mass and to the joints that it carries. If the length of a neighbouring
    body is larger, the rule uses the larger length. The length is at least a fiftieth of the sum of such
    distances in the whole robot.

    The rule reports a body whose mass, divided by the cube of this length, is above 1e7 kg/m^3. In
    example-robot-data no body has more than 2e4 kg/m^3 (an ankle of 0.6 kg between joints 3 cm apart), 500
    times less. If all meshes of a body are missing, it counts as a body without shapes. For bodies with
    shapes see DX517.

    Usual causes:

    - A mass is in grams, or has an extra digit.
    - An exporter computed the mass from a mesh in millimetres. A finger of 56 g then gets 56 tonnes.

    All engines use the numbers unchanged. Such a body dominates the torques of all joints before it, and
    PyBullet's inverse dynamics may refuse the robot (DX119).

    The file does not contain the true mass, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Give the mass in kilograms."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the heaviest link of each such body."""
        lengths = _lengths_of_groups(case)
        shaped = {group.head for group, _ in body_extents(case)}
        for group in dict.fromkeys(rigid_groups(case).values()):
            masses = {name: case.model.inertial(name).mass for name in group.links}
            mass, heaviest = math.fsum(masses.values()), max(masses, key=lambda name: masses[name])
            length = lengths.get(group.head, math.inf)
            if group.head not in shaped and mass > _GREATEST_MASS_PER_CUBE * length**3:
                message = f"the body has {mass:.3g} kg, and the joints around it are {length:.2g} m apart"
                yield Detection(heaviest, None, case.model.inertial(heaviest).line, message)


def _lengths_of_groups(case: Case) -> dict[str, float]:
    """Return the length [m] that tells the size of each rigid group, by its head; none for a tiny robot."""
    groups = rigid_groups(case)
    points: dict[str, list[Floats]] = {group.head: [np.zeros(3)] for group in groups.values()}
    for link in case.model.links:
        if link.inertial is not None and link.inertial.mass > 0.0:
            points[groups[link.name].head].append(_in_head(case, link.name, link.inertial.origin.xyz))
    neighbours: dict[str, list[str]] = {head: [head] for head in points}
    for joint in case.model.joints:
        parent, child = groups[joint.parent].head, groups[joint.child].head
        if parent != child:
            points[parent].append(_in_head(case, joint.parent, joint.origin.xyz))
            neighbours[parent].append(child)
            neighbours[child].append(parent)
    own = {head: _diameter(np.stack(found)) for head, found in points.items()}
    robot = math.fsum(own.values())
    if robot < _LEAST_ROBOT:
        return {}
    least = _LEAST_SHARE * robot
    return {head: max(least, *(own[each] for each in near)) for head, near in neighbours.items()}


def _in_head(case: Case, link: str, xyz: tuple[float, float, float]) -> Floats:
    """Return a point given in the frame of a link in that of the head of its rigid group (3,)."""
    R, p = rigid_groups(case)[link].poses[link]
    return np.asarray(R @ np.array(xyz) + p, dtype=np.float64)


def _diameter(points: Floats) -> float:
    """Return the diagonal of the bounding box of points (n, 3)."""
    return float(np.linalg.norm(points.max(axis=0) - points.min(axis=0)))

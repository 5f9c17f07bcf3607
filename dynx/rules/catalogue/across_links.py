"""Faults that show only where the links of one robot are compared with each other."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from statistics import median

import numpy as np

from dynx.errors import DescriptionError
from dynx.model.elements import Inertial, Joint
from dynx.model.xml.source import SourceElement
from dynx.rules import Case, Detection, Rule
from dynx.rules.attributes import number_of, vector_of
from dynx.rules.geometry import body_extents, geometry_elements, link_extent
from dynx.rules.inertia import line_of
from dynx.spatial.scalar import Floats

_LONG, _LONG_WITHOUT_MASS = 5.0, 20.0
"""Median length [m] from which a robot is examined: with masses, and without any."""

_LEAST_ROBOT_DENSITY = 1e-3
"""Least mass of a robot per cube of the sum of its joint distances [kg/m^3]."""

_LEAST_DENSITY_OF_FEW = 1e-5
"""The same per cube of the sum of all its lengths, where it has fewer than two joint distances: a hall with a
door that weighs a kilogram is not reported."""


class RobotInMillimetres(Rule):
    """DX520 robot-in-millimetres: The lengths of the robot are in millimetres, where URDF requires metres.

    A *joint distance* is the distance of a moving joint from the frame of its parent link, if it is not zero.
    The rule reports a robot under three conditions:

    - The robot has at least two joint distances.
    - Their median is 5 m or more (20 m or more if the robot has no mass).
    - The mass of the robot, divided by the cube of their sum, is below 1e-3 kg/m^3. (Air has 1.2 kg/m^3.)

    In example-robot-data and pybullet_data the largest median is 1.2 m, and the least mass per cube is 0.017
    kg/m^3.

    A wheel, a gripper or a turntable may have fewer than two joint distances. The rule then uses three kinds
    of length: joint distances, distances of centres of mass from their joints, and diagonals of the shapes of
    bodies, including meshes. It reports the robot if there are at least two lengths, the median of each kind
    is 5 m or more, and the robot is light for its size. *Light* means a mass below 1e-5 kg/m^3 times the cube
    of the sum of all lengths. If the robot has no mass, the shapes must be 20 m or more. So this rule does
    not report a robot in which only a mesh lacks its scale. For such a mesh, see DX517.

    Usual causes: a program exported the unit of the drawing, or someone copied lengths from a data sheet.

    All engines use the numbers unchanged, and agree. Poses and gravity torques are a thousand times too
    large, and inertias about the joints are a million times too large.

    The file does not say whether tensors, meshes and ranges of sliding joints are also in millimetres, so no
    edit removes the cause.
    """

    kind = "practice"
    advice = "Give every length in metres, and tensors in kg m^2."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the joint that is furthest from its parent, or else the link with the largest length, where
        the robot is in millimetres."""
        moving = [joint for joint in case.model.joints if joint.moves]
        distances = {joint: length for joint in moving if (length := math.hypot(*joint.origin.xyz)) > 0.0}
        mass = math.fsum(link.inertial.mass for link in case.model.links if link.inertial is not None)
        long = _LONG if mass > 0.0 else _LONG_WITHOUT_MASS
        if len(distances) >= 2:
            middle, total = median(distances.values()), math.fsum(distances.values())
            if middle < long or (mass > 0.0 and mass >= _LEAST_ROBOT_DENSITY * total**3):
                return
            furthest = max(distances, key=lambda joint: distances[joint])
            message = (
                f"{len(distances)} joints are {middle:.3g} m from their parents in the median, and this one "
                f"{distances[furthest]:.3g} m; the robot has {mass:.3g} kg"
            )
            yield Detection(None, furthest.name, furthest.line, message)
        elif moving:
            yield from _few_distances(case, distances, mass, long)


def _few_distances(
    case: Case, distances: Mapping[Joint, float], mass: float, long: float
) -> Iterator[Detection]:
    """Yield what is furthest in a robot in millimetres with at most one joint distance."""
    centers = {
        link.name: length
        for link in case.model.links
        if link.inertial is not None
        and link.inertial.mass > 0.0
        and (length := math.hypot(*link.inertial.origin.xyz)) > 0.0
    }
    kinds = {
        "the joint is {} m from its parent": list(distances.values()),
        "centres of mass are {} m from their joints in the median": list(centers.values()),
    }
    # Meshes are read only where nothing else speaks against it.
    if any(lengths and median(lengths) < long for lengths in kinds.values()):
        return
    sizes = _sizes_of_bodies(case) if mass > 0.0 else _sizes_of_links(case)
    kinds["shapes are {} m across in the median"] = list(sizes.values())
    found = {text: lengths for text, lengths in kinds.items() if lengths}
    total = math.fsum(map(math.fsum, found.values()))
    if sum(map(len, found.values())) < 2 or any(median(lengths) < long for lengths in found.values()):
        return
    if mass > 0.0 and mass >= _LEAST_DENSITY_OF_FEW * total**3:
        return
    texts = [text.format(f"{median(lengths):.3g}") for text, lengths in found.items()]
    message = f"{', '.join(texts)}; the robot has {mass:.3g} kg"
    if distances:
        (joint,) = distances
        yield Detection(None, joint.name, joint.line, message)
    else:
        largest = max((sizes or centers), key=lambda name: (sizes or centers)[name])
        yield Detection(largest, None, case.links[largest].line, message)


def _sizes_of_bodies(case: Case) -> dict[str, float]:
    """Return the diagonals [m] of the shapes of rigid bodies with mass, by the names of their first links."""
    return {group.head: extent.diagonal() for group, extent in body_extents(case)}


def _sizes_of_links(case: Case) -> dict[str, float]:
    """Return the diagonals [m] of the shapes of links."""
    extents = {name: link_extent(link, case.source.source) for name, link in case.links.items()}
    return {
        name: extent.diagonal() for name, extent in extents.items() if extent is not None and not extent.empty
    }


# Inertias that are a multiple of those of the link's own shape.


_ONE_FACTOR = 0.02
"""Largest relative difference of factors that count as one."""

_LEAST_FACTOR = 1.5
"""Least factor that is reported."""


class InertiaScaledUp(Rule):
    """DX522 inertia-scaled-up: The inertias of several links are the same multiple of the inertias of their
    shapes.

    Simulations with a fixed time step are more stable with larger inertias. So some authors multiply the
    tensors of light links by 10 or 100, or reduce masses without changing the tensors. The rule finds such
    tensors of links with a box or a cylinder. It divides the three principal moments of the link by those of
    the solid shape with uniform density and the link's mass. It reports the link under three conditions: the
    three ratios are equal (to 2 %), they are 1.5 or more, and another link with a different shape has the
    same ratio. A shape that is drawn too small, or a hollow part, has three different ratios. The rule leaves
    out spheres and cubes, because their ratios are always equal. The rule reports nothing in
    example-robot-data and pybullet_data.

    All engines use the numbers unchanged. Accelerations and frequencies are lower than those of the real
    robot, and gains that were tuned with this model are too large.

    The file does not say whether the tensors or the masses were changed, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Write the moments of the solid shape, and use a smaller time step."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links of each common factor."""
        factors = {
            link.name: found
            for link in case.model.links
            if link.inertial is not None
            and link.inertial.mass > 0.0
            and (found := _factor(case.links[link.name], link.inertial)) is not None
        }
        for name, (factor, sides) in factors.items():
            alike = [
                other
                for other, (another, others) in factors.items()
                if abs(another - factor) <= _ONE_FACTOR * factor
                and (other == name or not np.allclose(sides, others, rtol=_ONE_FACTOR))
            ]
            if len(alike) > 1:
                message = (
                    f"the moments are {factor:.3g} times those of the link's shape and mass, as on "
                    f"{', '.join(other for other in alike if other != name)}"
                )
                yield Detection(name, None, line_of(case, name, "inertia"), message)


def _factor(link: SourceElement, inertial: Inertial) -> tuple[float, Floats] | None:
    """Return the ratio of the moments to those of a shape of the link, and these per mass [m^2]; None where
    the three ratios differ, or are too small to be reported."""
    moments = np.linalg.eigvalsh(inertial.tensor)
    for shape in geometry_elements(link):
        solid = _moments_per_mass(shape)
        if solid is None or solid[0] <= 0.0 or solid[2] <= (1.0 + _ONE_FACTOR) * solid[0]:
            continue
        ratios = moments / (solid * inertial.mass)
        factor = float(np.mean(ratios))
        if factor >= _LEAST_FACTOR and np.ptp(ratios) <= _ONE_FACTOR * factor:
            return factor, solid
    return None


def _moments_per_mass(shape: SourceElement) -> Floats | None:
    """Return the principal moments per mass (3,) [m^2] of a uniform box or cylinder, smallest first."""
    try:
        size, radius, length = (
            vector_of(shape, "size"),
            number_of(shape, "radius"),
            number_of(shape, "length"),
        )
    except DescriptionError:
        return None
    if shape.tag == "box" and size is not None:
        xx, yy, zz = np.square(size) / 12.0
        return np.sort([yy + zz, xx + zz, xx + yy])
    if shape.tag != "cylinder" or radius is None or length is None:
        return None
    across = radius**2 / 4.0 + length**2 / 12.0
    return np.sort([across, across, radius**2 / 2.0])

"""Faults that show only where the links of one robot are compared with each other."""

from __future__ import annotations

import math
import re
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

    The evidence is the distance of each joint that moves from the frame of its parent link, where it is not
    zero. A robot is reported if there are two such joints or more, the median is 5 m or more, and the robot
    has less than 1e-3 kg per cube of the sum of these distances (air has 1.2 kg per cubic metre). Without any
    mass the median must be 20 m or more. In example-robot-data and pybullet_data the largest median is 1.2 m,
    and the least mass per cube 0.017 kg/m^3.

    A robot with a joint that moves and fewer distances, as many wheels, grippers and turntables have, is
    judged by three kinds of length: that distance, the distances of centres of mass from their joints, and
    the diagonals of the shapes of its bodies, meshes included. It is reported if it has two lengths or more,
    each kind that it has is 5 m or more in the median, and the robot has less than 1e-5 kg per cube of the
    sum of all. Without any mass the shapes must be 20 m or more. So a mesh alone that lacks its scale is not
    reported here (DX517 does).

    Usual causes: a program that exports the drawing's unit; a file written from a data sheet.

    All engines use the numbers unchanged, and agree. Poses are a thousand times too large, torques of gravity
    too, and inertias about the joints a million times.

    The file does not say whether tensors, meshes and ranges of sliding joints are in millimetres as well, so
    no edit removes the cause.
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


# Twins: the left and the right one of two links, by their names.


_RIGHT = (
    {"left": "right"}
    | {
        word: word.replace("l", "r", 1)
        for word in ("l", "fl", "hl", "bl", "ml", "lf", "lh", "lr", "lb", "lm")
    }
    | {"rl": "rr"}
)
"""Words of the left, such as those of corners (front left), and those of the right."""

_LEFT = {right: left for left, right in _RIGHT.items()}

_WORD = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|[^A-Za-z]+")

_MASSES_ALIKE = 0.1
"""Relative difference of the masses of twins from which they are reported."""

_MOMENTS_ALIKE = 0.1
"""Difference of their principal moments, in order of size, relative to the largest."""

_CENTERS_ALIKE, _LEAST_OFFSET = 0.1, 0.005
"""Difference of the distances of their centres of mass from their joints: relative, and in metres."""

_PLACES_ALIKE, _LEAST_SHIFT = 0.01, 0.001
"""Difference of the distances of their joints from their parents, up to which they are equal: relative, and
from which they are reported: in metres, too."""

_MASSES_EQUAL = 0.01
"""Relative difference of masses up to which links with unequal distances are twins."""


class TwinsDiffer(Rule):
    """DX521 twins-differ: A left and a right link differ in mass, moments, centre of mass or distance of
    the joint.

    Twins are links whose names differ in words such as ``left`` and ``right``, ``L`` and ``R``, ``FL`` and
    ``FR``, on joints of one type. Compared are numbers that neither a reflection nor another choice of link
    frames changes. Where the joints are equally far from their parents (to 1 %), these are the mass, the
    principal moments and the distance of the centre of mass from the joint. Reported are masses or moments
    that differ by more than 10 %, and distances that differ by more than 10 % and 5 mm.

    Where the joints are not equally far, links are twins if their joints rotate, their parents are one link
    or twins by name, and masses (to 1 %), moments and centres of mass are alike. Reported are distances of
    the joints that differ by more than 1 % and 1 mm. (The zero of a sliding joint may be anywhere along it.)

    Of 108 files of example-robot-data eight are reported: three in which the moments of forearms differ by 11
    to 14 %, two in which those of one leg are zero, and three in which the moments of an arm are exchanged.
    Of more than 1,000 files of pybullet_data eight are: a bracket's centre of mass is at 2 cm on the left and
    at 3 cm on the right; the upper legs of five Laikagos are 2 mm further from the hips on the left, and
    motors of two minitaurs 2 and 26 mm further from the body on one side.

    Usual causes: one side was measured or exported again and the other was not; an extra digit; moments in
    another unit; one of several signs of products of inertia was lost in reflecting the file. A sign that is
    lost alone, of a product or of the centre of mass, changes none of these numbers.

    All engines use the numbers unchanged. The robot leans to one side, and a gait that was tuned on one leg
    fails on the other. Where the parts differ (a tool in one hand), nothing is wrong.

    The file does not say which of the two is right, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Compare the two links, and reflect the right one again."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the left link of each pair of twins that differ."""
        joints = {joint.child: joint for joint in case.model.joints}
        for left, right in _twins(case):
            one, other = joints[left], joints[right]
            message = _difference_of_places(one, other)
            line, line_of_twin = one.line, other.line
            if _placed_alike(one, other):
                message = _difference_of_twins(case.model.inertial(left), case.model.inertial(right))
                line, line_of_twin = line_of(case, left, "inertia"), line_of(case, right, "inertia")
            if message:
                yield Detection(left, None, line, f"{message} on its twin {right} (line {line_of_twin})")


def _twins(case: Case) -> Iterator[tuple[str, str]]:
    """Yield the pairs of left and right links with mass, in document order."""
    joints = {joint.child: joint for joint in case.model.joints}
    by_name = {link.name.lower(): link.name for link in case.model.links}
    seen: set[str] = set()
    for link in case.model.links:
        candidates = (by_name[name] for name in _reflected_names(link.name) if name in by_name)
        twin = next(candidates, link.name)
        if twin in seen or twin == link.name or not {link.name, twin} <= joints.keys():
            continue
        one, other = joints[link.name], joints[twin]
        inertials = case.model.inertial(link.name), case.model.inertial(twin)
        if one.type != other.type or min(each.mass for each in inertials) <= 0.0:
            continue
        if _placed_alike(one, other) or (_attached_alike(one, other) and _equal_bodies(*inertials)):
            seen |= {link.name, twin}
            yield link.name, twin


def _reflected_names(name: str) -> Iterator[str]:
    """Yield the names, in lower case, that the right twin of a left link may have.

    All words of a side are exchanged (``front_leftR``), or a single one (``leg_l_hip_r``, a roll joint).
    """
    words = [word.lower() for word in _WORD.findall(name)]
    left = [number for number, word in enumerate(words) if word in _RIGHT]
    if left:
        yield "".join(_RIGHT.get(word) or _LEFT.get(word, word) for word in words)
    for number in left:
        yield "".join((*words[:number], _RIGHT[words[number]], *words[number + 1 :]))


def _placed_alike(one: Joint, other: Joint) -> bool:
    """Check whether two joints are equally far from their parents."""
    return math.isclose(*_distances(one, other), rel_tol=_PLACES_ALIKE, abs_tol=1e-6)


def _attached_alike(one: Joint, other: Joint) -> bool:
    """Check whether two joints rotate links of one parent, or of parents that are twins by name."""
    parents = one.parent.lower(), other.parent.lower()
    rotate = one.type in ("revolute", "continuous")
    return rotate and (parents[0] == parents[1] or parents[1] in _names_of_twins(one.parent))


def _names_of_twins(name: str) -> set[str]:
    """Return the names, in lower case, that the twin of a left or of a right link may have."""
    words = [word.lower() for word in _WORD.findall(name)]
    return {"".join(_RIGHT.get(word) or _LEFT.get(word, word) for word in words), *_reflected_names(name)}


def _equal_bodies(left: Inertial, right: Inertial) -> bool:
    """Check whether two links are copies of one part by their inertia."""
    alike = math.isclose(left.mass, right.mass, rel_tol=_MASSES_EQUAL)
    return alike and not _difference_of_twins(left, right)


def _distances(one: Joint, other: Joint) -> tuple[float, float]:
    return math.hypot(*one.origin.xyz), math.hypot(*other.origin.xyz)


def _difference_of_places(one: Joint, other: Joint) -> str:
    """Describe the difference of the distances of two joints; empty where it is small."""
    left, right = _distances(one, other)
    if abs(left - right) <= _LEAST_SHIFT:
        return ""
    return f"the joint is {left:.4g} m from its parent, and {right:.4g} m"


def _difference_of_twins(left: Inertial, right: Inertial) -> str:
    """Describe the difference of two inertials; empty where they are alike."""
    if abs(left.mass - right.mass) > _MASSES_ALIKE * max(left.mass, right.mass):
        return f"the mass is {left.mass:.3g} kg, and {right.mass:.3g} kg"
    offsets = math.hypot(*left.origin.xyz), math.hypot(*right.origin.xyz)
    gap = abs(offsets[0] - offsets[1])
    if gap > max(_CENTERS_ALIKE * max(offsets), _LEAST_OFFSET):
        return f"the centre of mass is {offsets[0]:.3g} m from the joint, and {offsets[1]:.3g} m"
    one, other = (np.linalg.eigvalsh(each.tensor) for each in (left, right))
    if np.max(np.abs(one - other)) > _MOMENTS_ALIKE * max(np.max(one), np.max(other)):
        written = [", ".join(f"{moment:.3g}" for moment in moments) for moments in (one, other)]
        return f"the principal moments are {written[0]} kg m^2, and {written[1]} kg m^2"
    return ""


# Inertias that are a multiple of those of the link's own shape.


_ONE_FACTOR = 0.02
"""Largest relative difference of factors that count as one."""

_LEAST_FACTOR = 1.5
"""Least factor that is reported."""


class InertiaScaledUp(Rule):
    """DX522 inertia-scaled-up: The inertias of several links are one multiple of those of their shapes.

    Simulators with a fixed step are steadier with larger inertias, so tensors of light links are multiplied
    by 10 or 100, or masses are reduced and tensors are not. The evidence: where a link has a box or a
    cylinder, its three principal moments are compared with those of the solid of uniform density and of the
    link's mass. Reported are links whose three ratios are equal to 2 %, at 1.5 or more, where another link
    with a shape of other sides has the same ratio. A shape that is merely drawn too small, or hollow, has
    three different ratios. Spheres and cubes, which have one ratio whatever their size, are no evidence.
    Nothing is reported in example-robot-data and pybullet_data.

    All engines use the numbers unchanged. Accelerations and frequencies of the robot are lower than they are,
    and gains that were tuned on it too large.

    The file does not say whether the tensors or the masses were changed, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Give the moments of the solid, and a smaller step to the simulator."

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

"""Elements of one description that differ from the other, with what would replace each of them.

The elements of `theirs` are found in this order: joints of another type, places and axes of joints, mimics,
inertias. Values are those of `ours` in the frames of `theirs`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain, combinations
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from dynx.model import Model
from dynx.model.elements import Inertial, Joint, Link, Pose, Vector
from dynx.model.mechanism import ROOT, pose_arrays
from dynx.model.stated_parts import NamedConfiguration
from dynx.model.topology import resolve_mimics
from dynx.same.decimals import decimals, fifty_digits, rounded
from dynx.same.fit import BodyFit, Fit, angle_of, drive, fit
from dynx.same.matching import MIN_TOLERANCE, UNCHANGED, BodyPair, Matching, MatchingPlan
from dynx.same.observability import observability_of
from dynx.same.placement import count_misplaced
from dynx.same.registration import principal_frames
from dynx.same.scales import inertia_ratio
from dynx.same.shapes import SHAPE_KINDS, frames_of_shapes
from dynx.same.skeleton import (
    Skeleton,
    are_alike,
    exact_skeleton,
    float_inertia,
    kind_of,
    subtract,
    transformed,
)
from dynx.same.text import inertial_text, pose_text, vector_text
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import skew

Part = Literal["type", "origin", "axis", "mimic", "inertial"]
"""Part of a joint or link that differs."""

PARTS = {part: part for part in get_args(Part)} | {"type": ""}
"""Tag of the element of URDF in which a part stands; the type is an attribute of the joint."""

SNAP = 1e-13
"""Difference [m, rad] below which a computed pose or axis is taken to be that of the other description."""

NOTHING = 1e-4
"""Share of the tolerance below which what is seen of a difference is rounding."""

MAX_TRIALS = 12
"""Largest number of fixed joints that are tried at a time."""

MAX_SUBSETS = 8
"""Largest number of inertias of which all subsets are tried for the smallest one."""


@dataclass(frozen=True)
class FieldChange:
    """Value of a field of a joint, or of the inertial of a link, by name."""

    tag: Literal["joint", "link"]
    name: str
    field: str
    value: Any


@dataclass(frozen=True)
class DifferingElement:
    """A part of a joint or link of `theirs` that differs from `ours`.

    `size` is the difference relative to its scale: the reach of the robot, 1 rad, or the body's
    own inertia. `first` and `second` are the values in the two descriptions, `changes` what replaces it.
    """

    part: Part
    tag: Literal["joint", "link"]
    ours: str | None
    theirs: str
    size: float
    message: str
    first: str
    second: str
    changes: tuple[FieldChange, ...] = field(repr=False, default=())
    unchanged: bool = False
    """True if it is written as in `ours`: what stands before it differs."""
    moved_link: tuple[str, Floats] | None = field(repr=False, default=None)
    """Link whose frame the changes move, and the pose (4, 4) of its old frame in the new one."""


@dataclass(frozen=True)
class Unseen:
    """Links whose inertias differ without effect; `size` is what is seen of the differences of all of them,
    relative to its scale: 0 where no state shows anything."""

    ours: str | None
    theirs: str
    size: float


@dataclass(frozen=True)
class Analysis:
    """Comparison of two models: how their bodies fit, what differs, and what differs without being seen."""

    fit: Fit
    elements: tuple[DifferingElement, ...]
    unseen: tuple[Unseen, ...] = ()

    @property
    def equal(self) -> bool:
        """True if nothing differs in any state."""
        return not (self.elements or self.fit.missing or self.fit.extra)

    @property
    def cost(self) -> float:
        """Number of elements and bodies that differ; an element that is written as its counterpart counts a
        little more."""
        costs = (UNCHANGED if each.unchanged else 1.0 for each in self.elements)
        return sum(costs) + 2.0 * (len(self.fit.missing) + len(self.fit.extra))


def apply(model: Model, changes: Iterable[FieldChange]) -> Model:
    """Return the model with other values of some fields."""
    joints = {joint.name: joint for joint in model.joints}
    links = {link.name: link for link in model.links}
    retyped = False
    for change in changes:
        retyped = retyped or change.field in ("type", "mimic")
        if change.tag == "joint":
            joints[change.name] = replace(joints[change.name], **{change.field: change.value})
        else:
            links[change.name] = replace(links[change.name], **{change.field: change.value})
    # Joints may follow one that has become fixed.
    ordered = resolve_mimics(list(joints.values()), [], model.source) if retyped else list(joints.values())
    changed = replace(model, joints=tuple(ordered), links=tuple(links.values()))
    other = {name for name, joint in joints.items() if kind_of(joint) != kind_of(model.joint(name))}
    return _without_data_of(changed, other) if other else changed


def _without_data_of(model: Model, joints: set[str]) -> Model:
    """Return the model without what it states of other types of some joints: positions in configurations, and
    tendons and couplings if the joint now has not one number."""

    def kept(each: NamedConfiguration) -> NamedConfiguration:
        return replace(each, positions=tuple(row for row in each.positions if row[0] not in joints))

    stated, initial = model.stated_configurations, model.stated_initial
    others = {each for each in joints if kind_of(model.joint(each)) not in ("revolute", "prismatic")}
    tendons = [each for each in model.tendons or () if others.isdisjoint(each.joints)]
    left = {each.name for each in model.tendons or ()} - {each.name for each in tendons}
    ends = {"joint": others, "tendon": left}
    equalities = [
        each for each in model.equalities or () if ends.get(each.object_type, set()).isdisjoint(each.objects)
    ]
    return replace(
        model,
        tendons=None if model.tendons is None else tuple(tendons),
        equalities=None if model.equalities is None else tuple(equalities),
        stated_configurations=None if stated is None else tuple(map(kept, stated)),
        stated_initial=None if initial is None else kept(initial),
    )


def analyse(ours: Skeleton, theirs: Model, tolerance: float) -> Analysis:
    """Compare two robots whose bases are of one kind."""
    retyped = list(_other_types(ours.model, theirs))
    return _with_fixed_joints(ours, theirs, retyped, tolerance)


def are_equal(ours: Skeleton, theirs: Model, known: Fit, tolerance: float) -> bool:
    """Check whether two robots are the same. `known` is a fit of the first one and of another robot with the
    joints of the second; its pairs are tried first, with frames that follow from the root."""
    if theirs.joint_names == known.theirs.model.joint_names:
        pairs = tuple(
            BodyPair(each.ours, each.theirs, rounded(each.D) if each.ours == ROOT else None)
            for each in known.bodies
        )
        with fifty_digits():
            found = fit(ours, Skeleton(theirs), MatchingPlan(0.0, pairs, known.missing, known.extra))
            if not any(True for _ in _of_joints(found, tolerance)):
                elements, _ = _Inertias(found, tolerance).find()
                if not (elements or found.missing or found.extra):
                    return True
    return analyse(ours, theirs, tolerance).equal


def _with_fixed_joints(
    ours: Skeleton, theirs: Model, known: list[DifferingElement], tolerance: float
) -> Analysis:
    """Compare two models with some elements replaced; find fixed joints that explain what then differs."""
    changed = apply(theirs, (change for each in known for change in each.changes))
    best = _analysed(ours, exact_skeleton(changed), known, tolerance)
    tried: set[str] = {each.theirs for each in known}
    while len(best.elements) > len(known):
        trials: list[tuple[Analysis, DifferingElement | None, Model]] = []
        # A base that itself differs may have a frame that was chosen for what is above the fixed joint.
        at_root = (
            best.fit.theirs.body_of[each.theirs] == ROOT for each in best.elements if each.tag == "link"
        )
        base = None if any(at_root) else rounded(best.fit.bodies[0].D)
        misplaced = _misplaced(best, tolerance)
        candidates = _fixed_joints(best, ours.model, tried, any_single=misplaced > 0)
        if misplaced:
            candidates = chain(candidates, _own_joints(best, tried))
        for each, other, frame in _promising(candidates, best.fit, changed, tolerance):
            elements = known if each is None else [*known, each]
            found_base = base if frame is None else frame
            trials.append((_analysed(ours, other, elements, tolerance, found_base), each, other.model))
        found = min(trials, key=lambda trial: trial[0].cost, default=None)
        if found is None or round(found[0].cost - best.cost, 6) > 0.0:
            break
        if round(found[0].cost - best.cost, 6) == 0.0:
            # What explains as much is a better explanation if more stands at its place then.
            equal = [trial for trial in trials if trial[0].cost == found[0].cost]
            counts = [_misplaced(analysis, tolerance) for analysis, _, _ in equal] if misplaced else [0]
            if min(counts) >= misplaced:
                break
            found = equal[counts.index(min(counts))]
        best, element, changed = found
        if element is not None:
            known = [*known, element]
            tried.add(element.theirs)
    return best


class _CandidatePlace(NamedTuple):
    """A place of a joint that may explain what differs, or with None another frame of a floating base. If it
    explains no fewer elements, `expected` is how its body fits then: it is better only if more stands at its
    place in that body."""

    element: DifferingElement | None
    expected: BodyFit | None


def _promising(
    candidates: Iterable[_CandidatePlace], found: Fit, changed: Model, tolerance: float
) -> Iterator[tuple[DifferingElement | None, Skeleton, Floats | None]]:
    """Yield the candidates that may be a better explanation, `MAX_TRIALS` at most, with the robot that has
    them, and with the frame (4, 4) of its floating base if that is the candidate."""
    least = max(tolerance, MIN_TOLERANCE)
    before: dict[int, int] = {}
    count = 0
    for element, expected in candidates:
        if expected is not None:
            body = expected.theirs
            if body not in before:
                before[body] = count_misplaced(found, least, body)
            if not before[body]:
                continue
        theirs = found.theirs
        if expected is not None:
            bodies = tuple(expected if each.theirs == body else each for each in found.bodies)
            if element is not None and element.theirs not in theirs.number:
                # A fixed joint moves what it carries in the body.
                theirs = exact_skeleton(apply(changed, element.changes))
            if count_misplaced(replace(found, theirs=theirs, bodies=bodies), least, body) >= before[body]:
                continue
        if element is not None and theirs is found.theirs:
            theirs = exact_skeleton(apply(changed, element.changes))
        yield element, theirs, rounded(expected.D) if element is None and expected is not None else None
        count += 1
        if count == MAX_TRIALS:
            return


def _misplaced(analysis: Analysis, tolerance: float) -> int:
    """Count what stands at another place, if an element differs that may as well be another one."""
    if not any(each.part in ("inertial", "origin") for each in analysis.elements):
        return 0
    return count_misplaced(analysis.fit, max(tolerance, MIN_TOLERANCE))


def _analysed(
    ours: Skeleton,
    other: Skeleton,
    known: list[DifferingElement],
    tolerance: float,
    base: Floats | None = None,
) -> Analysis:
    changed = other.model
    with fifty_digits():
        found = fit(ours, other, Matching(ours, other, tolerance, base).find())
        joints = [*known, *_of_joints(found, tolerance)]
        inertials, unseen = _Inertias(found, tolerance).find()
        elements = list(_in_moved_frames([*joints, *inertials], changed))
    names = [*(link.name for link in changed.links), *(joint.name for joint in changed.joints)]
    order = {name: k for k, name in enumerate(names)}
    elements = sorted(elements, key=lambda each: (_line(changed, each), order[each.theirs]))
    return Analysis(found, tuple(elements), unseen)


def _fixed_joints(
    analysis: Analysis, ours: Model, tried: set[str], *, any_single: bool
) -> Iterator[_CandidatePlace]:
    """Yield fixed joints of `theirs`, in document order, below which elements differ, each placed so that the
    first joint or the first inertia of these does not.

    With `any_single` those below which a single element differs are among them, whatever is written: then
    what else stands at its place decides.
    """
    found = analysis.fit
    fits = {each.theirs: each for each in found.bodies}
    model = found.theirs.model
    above = {joint.child: joint for joint in model.joints}
    below: dict[str, list[DifferingElement]] = {}
    in_body: dict[int, list[DifferingElement]] = {}
    for element in analysis.elements:
        if element.tag == "joint" and (element.part != "origin" or not model.joint(element.theirs).moves):
            continue
        link = element.theirs if element.tag == "link" else model.joint(element.theirs).parent
        in_body.setdefault(found.theirs.body_of[link], []).append(element)
        while link in above and not above[link].moves:
            below.setdefault(above[link].name, []).append(element)
            link = above[link].parent
    mine = {name: joint for name, joint in _named_counterparts(ours, model).items() if not joint.moves}

    def placed(
        joint: Joint, elements: list[DifferingElement], *, beside: bool, single: bool
    ) -> Iterator[_CandidatePlace]:
        here = fits[found.theirs.body_of[joint.child]]
        # The place of a joint says exactly where its parent is, whatever the frames of links.
        joints, links = ([each for each in elements if each.tag == tag] for tag in ("joint", "link"))
        for element in (*joints[:1], *links[:1]):
            with fifty_digits():
                displacements = [*_displacements(found, here, element)]
                frames = [here.D @ each if beside else here.D for each in displacements]
                if beside:
                    displacements = [inverse(each) for each in displacements]
            for displacement, D in zip(displacements, frames, strict=True):
                other = _placed(found, mine.get(joint.name), joint, displacement)
                if other is not None:
                    yield _CandidatePlace(other, replace(here, D=D) if single else None)

    written_otherwise = [
        joint
        for joint in model.joints
        if not (joint.moves or joint.name in tried)
        and not (joint.name in mine and are_alike(mine[joint.name].origin, joint.origin))
    ]
    # Where a fixed joint in a body is at fault, the joint of the body may be where it was; first the joints
    # that are written as in the other description.
    places = [each for each in analysis.elements if _is_place_that_moves(model, each)]
    for unchanged in (True, False):
        misplaced = {found.theirs.number[each.theirs] for each in places if each.unchanged == unchanged}
        for joint in written_otherwise:
            body = found.theirs.body_of[joint.child]
            if body not in misplaced:
                continue
            with fifty_digits():
                followed = _followed(found, body)
                off = inverse(followed) @ fits[body].D
                displacements = [off]
                for element in below.get(joint.name, [])[:1]:
                    displacements += _displacements(found, replace(fits[body], D=followed), element)
            for displacement in displacements:
                other = _placed(found, mine.get(joint.name), joint, displacement)
                if other is not None:
                    yield _CandidatePlace(other, None)
    for joint in [joint for joint in model.joints if joint.name in below and joint.name not in tried]:
        # What is written as in the other description is not at fault; what has no counterpart there may be
        # if several elements, or the place of a joint, depend on it.
        # A single element below it that is written otherwise is as good an explanation.
        elements = below[joint.name]
        several = len(elements) > 1
        if joint.name in mine:
            suspect = not are_alike(mine[joint.name].origin, joint.origin)
            likely = several or elements[0].unchanged
        else:
            suspect = True
            likely = several or elements[0].tag == "joint"
        if suspect and (likely or any_single):
            yield from placed(joint, elements, beside=False, single=not likely)
    # The frame of a body may be chosen for what is below a fixed joint: all else in the body differs then, as
    # may its own joint, or a floating base.
    several = sum(each.theirs not in tried for each in analysis.elements) > 1
    for joint in written_otherwise if several or any_single else []:
        elements = in_body.get(found.theirs.body_of[joint.child], [])
        if elements and joint.name not in below:
            yield from placed(joint, elements, beside=True, single=not several)


def _own_joints(analysis: Analysis, tried: set[str]) -> Iterator[_CandidatePlace]:
    """Yield the joints that move the bodies of which an inertia or the place of a joint differs, each placed
    so that it does not; of a floating base its frame."""
    found = analysis.fit
    fits = {each.theirs: each for each in found.bodies}
    differing = {each.theirs for each in analysis.elements} | tried
    for element in analysis.elements:
        if element.part not in ("inertial", "origin"):
            continue
        link = element.theirs
        if element.tag == "joint":
            if not found.theirs.model.joint(link).moves:
                continue
            link = found.theirs.model.joint(link).parent
        body = found.theirs.body_of[link]
        each = fits[body]
        with fifty_digits():
            frames = [each.D @ displacement for displacement in _displacements(found, each, element)]
            frames += _frames_of_parts(found, each)
        if body == ROOT:
            if found.theirs.model.floating:
                yield from (_CandidatePlace(None, replace(each, D=D)) for D in frames)
            continue
        joint = found.theirs.joints[body]
        # What turns on a ball joint is turned as it fits best.
        if found.theirs.kinds[body] == "ball" or joint.name in differing:
            continue
        parent = fits[found.theirs.bodies[body].parent]
        for D in frames:
            with fifty_digits():
                off = inverse(parent.D @ found.theirs.exact[body]) @ found.ours.exact[each.ours] @ D
                turn, shift = angle_of(off), float(np.linalg.norm(rounded(off[:3, 3])))
                moved = replace(each, D=D, turn=turn, shift=shift)
                placed = _origin(found, moved, parent)
            if max(turn, shift / found.ours.reach) >= SNAP:
                yield _CandidatePlace(placed, moved)


def _frames_of_parts(found: Fit, each: BodyFit) -> Iterator[Array]:
    """Yield the poses D (4, 4) of the frame of a body with which a link of it, or the first shape of one, is
    where its namesake is; call it inside `fifty_digits`."""
    ours, theirs = found.ours, found.theirs
    mine = {ours.model.links[k].name: k for k in ours.links[each.ours]}
    for k in theirs.links[each.theirs]:
        own = mine.get(theirs.model.links[k].name)
        if own is not None:
            yield ours.link_pose(own) @ inverse(theirs.link_pose(k))
    for kind in SHAPE_KINDS:
        yield from map(decimals, frames_of_shapes(kind, ours, theirs, each.ours, each.theirs))


def _is_place_that_moves(model: Model, element: DifferingElement) -> bool:
    """Check whether an element is the place of a joint that moves."""
    return element.tag == "joint" and element.part == "origin" and model.joint(element.theirs).moves


def _followed(found: Fit, body: int) -> Array:
    """Return the pose D (4, 4) that the frame of a body has if its own joint is right."""
    fits = {each.theirs: each for each in found.bodies}
    each, parent = fits[body], fits[found.theirs.bodies[body].parent]
    return inverse(found.ours.exact[each.ours]) @ parent.D @ found.theirs.exact[body]


def _displacements(found: Fit, here: BodyFit, element: DifferingElement) -> Iterator[Array]:
    """Yield the displacements (4, 4), in a body whose fit is `here`, that make an element of it right: of a
    link by its frame, and in case its frame is moved by its shapes and by its inertia."""
    ours, theirs = found.ours, found.theirs
    fits = {each.theirs: each for each in found.bodies}
    back = inverse(here.D)
    if element.tag == "joint":
        each = fits[theirs.number[element.theirs]]
        yield back @ ours.exact[each.ours] @ each.D @ inverse(theirs.exact[each.theirs])
        return
    if element.ours is None or ours.body_of.get(element.ours) != here.ours:
        return
    now, wanted = (
        skeleton.link_pose([link.name for link in skeleton.model.links].index(name))
        for skeleton, name in ((theirs, element.theirs), (ours, element.ours))
    )
    yield back @ wanted @ inverse(now)
    if element.ours == element.theirs:
        for kind in SHAPE_KINDS:
            for D in frames_of_shapes(kind, ours, theirs, here.ours, here.theirs, element.ours):
                yield back @ decimals(D)
    mine = ours.heavy_links[here.ours].get(element.ours)
    other = theirs.heavy_links[here.theirs].get(element.theirs)
    if mine is None or other is None or not (float(mine.mass) > 0.0 and float(other.mass) > 0.0):
        return
    (frame, *_), symmetric = principal_frames(mine)
    if not symmetric:
        turned = [rounded(back) @ frame @ inverse(each) for each in principal_frames(other)[0]]
        yield decimals(max(turned, key=lambda T: float(np.trace(T[:3, :3]))))


def _placed(found: Fit, mine: Joint | None, joint: Joint, displacement: Array) -> DifferingElement | None:
    """Return the element of a fixed joint, whose counterpart is `mine`, that is displaced in its body."""
    theirs = found.theirs
    names = {link.name: k for k, link in enumerate(theirs.model.links)}
    with fifty_digits():
        own = theirs.link_pose(names[joint.child])
        moved = displacement @ own
        place = inverse(theirs.link_pose(names[joint.parent])) @ moved
        off = inverse(own) @ moved
        turn, shift = angle_of(off), float(np.linalg.norm(rounded(off[:3, 3])))
    if max(turn, shift / found.ours.reach) < SNAP:
        return None
    pose = nearest_pose(place, joint.origin if mine is None else mine.origin)
    return DifferingElement(
        "origin",
        "joint",
        None if mine is None else mine.name,
        joint.name,
        max(turn, shift / found.ours.reach),
        _away("fixed joint", shift, turn),
        "none" if mine is None else pose_text(mine.origin),
        pose_text(joint.origin),
        (FieldChange("joint", joint.name, "origin", pose),),
        unchanged=mine is not None and are_alike(mine.origin, joint.origin),
    )


def _away(what: str, shift: float, turn: float) -> str:
    parts = [f"{size:.3g} {unit}" for size, unit in ((shift, "m"), (turn, "rad")) if size > SNAP]
    return f"the {what} is {' and '.join(parts) or '0 m'} away from its place"


def _line(model: Model, element: DifferingElement) -> int:
    part = model.joint(element.theirs) if element.tag == "joint" else model.link(element.theirs)
    return part.line or 0


# -- joints ---------------------------------------------------------------------------------------


def _other_types(ours: Model, theirs: Model) -> Iterator[DifferingElement]:
    """Yield the joints of one name, or with links of one name, of which one is fixed or slides and the other
    turns."""
    mine = _named_counterparts(ours, theirs)
    drivers = set(theirs.joint_names)
    for joint in theirs.joints:
        other = mine.get(joint.name)
        if other is None or kind_of(other) == kind_of(joint):
            continue
        changes = [FieldChange("joint", joint.name, "type", other.type)]
        if other.moves:
            fields = ["limits", "dynamics", "mimic"] if not joint.moves else []
            fields += [] if joint.moves else ["axis", "locked_at"]
            if joint.moves and "ball" in (joint.type, other.type):
                # The range of a ball joint is an angle about any axis.
                fields += ["limits", "axis"]
            values = {name: getattr(other, name) for name in fields}
            if values.get("mimic") is not None and values["mimic"].joint not in drivers:
                values["mimic"] = None
            changes += [FieldChange("joint", joint.name, name, value) for name, value in values.items()]
        yield DifferingElement(
            "type",
            "joint",
            other.name,
            joint.name,
            1.0,
            f"the joint is {joint.type} instead of {other.type}",
            other.type,
            joint.type,
            tuple(changes),
        )


def _named_counterparts(ours: Model, theirs: Model) -> dict[str, Joint]:
    """Return the joint of `ours` of the same name, or else with a child link of the same name, by the name of
    the joint of `theirs`: a fixed joint of MJCF has no name, and its link has.

    A fixed joint that places a link beside another joint, as readers add them, has the counterpart of its
    name at most, since the other joint holds the link too.
    """
    mine = {joint.name: joint for joint in ours.joints}
    names = {joint.name for joint in theirs.joints}
    added, their_added = (set(_added_joints(model)) for model in (ours, theirs))
    children = {joint.child: joint for joint in ours.joints if joint.name not in names | added}
    pairs = (
        (
            joint.name,
            mine.get(joint.name) or (None if joint.name in their_added else children.get(joint.child)),
        )
        for joint in theirs.joints
    )
    return {name: joint for name, joint in pairs if joint is not None}


def _added_joints(model: Model) -> Iterator[str]:
    """Yield the fixed joints that only place a link beside the joint on which it moves: they hold it on a
    link without mass that has nothing else."""
    above = {joint.child: joint for joint in model.joints}
    held = Counter(joint.parent for joint in model.joints)
    for joint in model.joints:
        mover = above.get(joint.parent)
        if joint.moves or mover is None or not mover.moves or held[joint.parent] != 1:
            continue
        inertial = model.inertial(joint.parent)
        if not (inertial.mass or inertial.tensor.any()):
            yield joint.name


def _of_joints(found: Fit, tolerance: float) -> Iterator[DifferingElement]:
    frames = {each.theirs: each for each in found.bodies}
    matched = {found.ours.joints[each.ours].name for each in found.bodies if each.ours != ROOT}
    length = found.ours.reach
    for each in found.bodies:
        if each.ours == ROOT:
            continue
        parent = frames[found.theirs.bodies[each.theirs].parent]
        if each.line / length > tolerance:
            yield _moved_axis(found, each, parent)
        elif max(each.turn, each.shift / length) > tolerance:
            yield _origin(found, each, parent)
        if each.axis > tolerance:
            yield _axis(found, each)
        mimic = found.ours.joints[each.ours].mimic
        if mimic is not None and mimic.joint not in matched:
            # That joint is named as one without a counterpart.
            continue
        if each.scale > tolerance * _unit_scale(found, each) or each.offset > tolerance * (
            1.0 if found.ours.kinds[each.ours] == "revolute" else length
        ):
            yield _mimic(found, each)


def _unit_scale(found: Fit, each: BodyFit) -> float:
    mimic = found.ours.joints[each.ours].mimic
    return 1.0 if mimic is None else abs(mimic.multiplier)


def _joints(found: Fit, each: BodyFit) -> tuple[Joint, Joint]:
    return found.ours.joints[each.ours], found.theirs.joints[each.theirs]


def _origin(found: Fit, each: BodyFit, parent: BodyFit) -> DifferingElement:
    mine, joint = _joints(found, each)
    wanted = inverse(parent.D) @ found.ours.exact[each.ours] @ each.D
    place = inverse(found.theirs.parent_pose(each.theirs)) @ wanted
    is_ball = found.ours.kinds[each.ours] == "ball"
    if is_ball:
        # Its centre alone has a place.
        place = homogeneous(decimals_of_pose(joint.origin)[:3, :3], place[:3, 3])
    pose = nearest_pose(place, mine.origin)
    if is_ball and pose is not mine.origin:
        pose = replace(joint.origin, xyz=nearest_position(place, mine.origin))
    off = inverse(decimals(joint.origin.matrix)) @ place
    axis = np.array(joint.axis)
    message = _away("joint", each.shift, each.turn)
    if not is_ball and each.shift <= 1e-12 * found.ours.reach and _about(off, axis):
        message = f"position 0 of the joint is turned by {each.turn:.3g} rad about its axis"
    return DifferingElement(
        "origin",
        "joint",
        mine.name,
        joint.name,
        max(each.turn, each.shift / found.ours.reach),
        message,
        pose_text(mine.origin),
        pose_text(joint.origin),
        (FieldChange("joint", joint.name, "origin", pose),),
        unchanged=are_alike(mine.origin, joint.origin),
    )


def _about(off: Array, axis: Floats) -> bool:
    """Check whether the rotation of a pose is about an axis."""
    R = rounded(off[:3, :3])
    return float(np.linalg.norm(R @ axis - axis)) < 1e-12 * max(1.0, float(np.linalg.norm(R - np.eye(3))))


def _moved_axis(found: Fit, each: BodyFit, parent: BodyFit) -> DifferingElement:
    """Make the element of a joint whose axis is moved parallel, while its link is where it should be, or
    where a place beside it has it."""
    mine, joint = _joints(found, each)
    origin = joint.origin.matrix
    if max(each.turn, each.shift / found.ours.reach) > SNAP:
        wanted = inverse(parent.D) @ found.ours.exact[each.ours] @ each.D
        origin = rounded(inverse(found.theirs.parent_pose(each.theirs)) @ wanted)
    D, axis = rounded(each.D), found.ours.axes[each.ours]
    is_ball = found.ours.kinds[each.ours] == "ball"
    foot = np.zeros(3) if is_ball else axis * float(axis @ D[:3, 3])
    shift = D[:3, :3].T @ (foot - D[:3, 3])
    there, back = homogeneous(np.eye(3), shift), homogeneous(np.eye(3), -shift)
    pose = nearest_pose(decimals(origin @ there), mine.origin)
    changes = [FieldChange("joint", joint.name, "origin", pose)]
    link = found.theirs.model.link(joint.child)
    if link.inertial is not None and (link.inertial.mass or link.inertial.tensor.any()):
        moved = replace(link.inertial, origin=Pose.from_matrix(back @ link.inertial.origin.matrix))
        changes.append(FieldChange("link", link.name, "inertial", moved))
    changes += [
        FieldChange("joint", other.name, "origin", Pose.from_matrix(back @ other.origin.matrix))
        for other in found.theirs.model.joints
        if other.parent == link.name
    ]
    return DifferingElement(
        "origin",
        "joint",
        mine.name,
        joint.name,
        each.line / found.ours.reach,
        f"the {'centre' if is_ball else 'axis'} is {each.line:.3g} m beside its place; its link is where it "
        "should be",
        pose_text(mine.origin),
        pose_text(joint.origin),
        tuple(changes),
        unchanged=are_alike(mine.origin, joint.origin),
        moved_link=(link.name, back),
    )


def _in_moved_frames(elements: list[DifferingElement], theirs: Model) -> Iterator[DifferingElement]:
    """Yield the elements, with the values of those that are attached to a link whose frame another element
    moves in its new frame. They alone state these values then."""
    moved = dict(each.moved_link for each in elements if each.moved_link is not None)
    if not moved:
        yield from elements
        return

    def link_of(change: FieldChange) -> str | None:
        if change.tag == "link":
            return change.name if change.field == "inertial" else None
        return theirs.joint(change.name).parent if change.field == "origin" else None

    stated = {
        (change.tag, change.name)
        for each in elements
        for change in each.changes
        if link_of(change) in moved and (each.moved_link is None or each.moved_link[0] != link_of(change))
    }
    for each in elements:
        own = None if each.moved_link is None else each.moved_link[0]
        changes = []
        for change in each.changes:
            link = link_of(change)
            if link is None or link not in moved:
                changes.append(change)
            elif link != own:
                changes.append(replace(change, value=_in_frame(moved[link], change.value)))
            elif (change.tag, change.name) not in stated:
                changes.append(change)
        yield replace(each, changes=tuple(changes))


def _in_frame(back: Floats, value: Pose | Inertial | None) -> Pose | Inertial | None:
    """Return a pose or an inertial in a frame in which its own frame has the pose `back` (4, 4)."""
    if isinstance(value, Pose):
        return Pose.from_matrix(back @ value.matrix)
    return None if value is None else replace(value, origin=Pose.from_matrix(back @ value.origin.matrix))


def _axis(found: Fit, each: BodyFit) -> DifferingElement:
    mine, joint = _joints(found, each)
    turned = each.sign * (rounded(each.D[:3, :3]).T @ found.ours.axes[each.ours])
    own = np.array(mine.axis) * each.sign
    wanted = own if float(np.max(np.abs(turned - own))) < SNAP else turned
    x, y, z = (wanted + 0.0).tolist()
    return DifferingElement(
        "axis",
        "joint",
        mine.name,
        joint.name,
        each.axis,
        f"the axis is turned by {np.arcsin(min(1.0, each.axis)):.3g} rad",
        vector_text(mine.axis),
        vector_text(joint.axis),
        (FieldChange("joint", joint.name, "axis", (x, y, z)),),
        unchanged=mine.axis == joint.axis,
    )


def _mimic(found: Fit, each: BodyFit) -> DifferingElement:
    mine, joint = _joints(found, each)
    wanted, names = mine.mimic, {}
    for other in found.bodies:
        if other.ours != ROOT:
            a, b = _joints(found, other)
            names[a.name] = (b.name, other.sign)
    if wanted is not None:
        driver, sign = names[wanted.joint]
        wanted = replace(
            wanted,
            joint=driver,
            multiplier=each.sign * sign * wanted.multiplier,
            offset=each.sign * wanted.offset + 0.0,
        )
    return DifferingElement(
        "mimic",
        "joint",
        mine.name,
        joint.name,
        min(1.0, max(each.scale / _unit_scale(found, each), each.offset)),
        f"the joint follows {drive(joint)} instead of {drive(mine)}"
        if mine.mimic and joint.mimic
        else f"the joint {drive(joint) if joint.mimic is None else 'follows ' + drive(joint)}",
        drive(mine),
        drive(joint),
        (FieldChange("joint", joint.name, "mimic", wanted),),
    )


# -- inertias -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _InertiaCandidate:
    """A link of `theirs`, by number, whose inertia differs: `difference`, ours minus theirs, in the frame of
    our body; `mine` is the number of the link of `ours` that it is compared with."""

    body: BodyFit
    link: int
    mine: int | None
    difference: RigidInertia
    single: bool
    """True if `mine` alone is what `link` should be."""


class _Inertias:
    """The fewest inertias that must be replaced."""

    def __init__(self, found: Fit, tolerance: float) -> None:
        self._fit, self._tolerance = found, tolerance
        self._whole = found.ours.whole

    def find(self) -> tuple[list[DifferingElement], tuple[Unseen, ...]]:
        """Return the elements, and the links whose differences have no effect."""
        off = [each for each in self._fit.bodies if self._ratio(each) > self._tolerance]
        if not off:
            return [], ()
        self._observability = observability_of(self._fit.ours)
        self._regrouped_sums: dict[tuple[int, ...], Mapping[int, RigidInertia]] = {}
        candidates = [candidate for each in off for candidate in self._candidates(each)]
        if not self._seen(candidates):
            return [], self._unseen(candidates)
        chosen = self._smallest(candidates)
        sizes = self._sizes(chosen)
        elements = [self._element(each, sizes) for each in chosen]
        others = [each for each in candidates if each not in chosen]
        return elements, self._unseen(others)

    def _ratio(self, each: BodyFit) -> float:
        assert each.inertia is not None
        return inertia_ratio(float_inertia(each.inertia), self._fit.ours.inertias[each.ours], self._whole)

    def _unseen(self, candidates: list[_InertiaCandidate]) -> tuple[Unseen, ...]:
        if not candidates:
            return ()
        ours, theirs = self._fit.ours.model.links, self._fit.theirs.model.links
        seen = max(self._sizes(candidates).values(), default=0.0)
        size = seen if seen > NOTHING * self._tolerance else 0.0
        return tuple(
            Unseen(None if each.mine is None else ours[each.mine].name, theirs[each.link].name, size)
            for each in candidates
        )

    def _candidates(self, each: BodyFit) -> Iterator[_InertiaCandidate]:
        """Yield the links of a body whose inertias differ; their differences add up to that of the body."""
        ours, theirs, D = self._fit.ours, self._fit.theirs, each.D
        mine = {ours.model.links[k].name: k for k in ours.links[each.ours]}
        pairs = [
            (k, mine[theirs.model.links[k].name])
            for k in theirs.links[each.theirs]
            if theirs.model.links[k].name in mine
        ]
        if len(pairs) > 1:
            # Beside others, a link with mass in one description only counts as split off or merged there.
            pairs = [(k, j) for k, j in pairs if self._heavy(theirs, k) == self._heavy(ours, j)]
        for k, _ in pairs:
            del mine[theirs.model.links[k].name]
        alone = [
            k for k in theirs.links[each.theirs] if k not in {k for k, _ in pairs} and self._heavy(theirs, k)
        ]
        rest = [k for k in mine.values() if self._heavy(ours, k)]
        if len(alone) == 1 and len(rest) == 1:
            pairs.append((alone.pop(), rest.pop()))
        if alone or rest:
            yield from self._regrouped(each, pairs, alone, rest)
            return
        for k, j in pairs:
            difference = subtract(ours.link_inertia(j), transformed(theirs.link_inertia(k), D))
            own = float_inertia(ours.link_inertia(j))
            if inertia_ratio(float_inertia(difference), own, self._whole) > self._tolerance:
                yield _InertiaCandidate(each, k, j, difference, single=True)

    def _regrouped(
        self, each: BodyFit, pairs: list[tuple[int, int]], alone: list[int], rest: list[int]
    ) -> Iterator[_InertiaCandidate]:
        """Yield the candidates of a body whose links are split otherwise in the two descriptions."""
        ours, theirs, D = self._fit.ours, self._fit.theirs, each.D
        assert each.inertia is not None
        left = each.inertia
        for k, j in pairs:
            difference = subtract(ours.link_inertia(j), transformed(theirs.link_inertia(k), D))
            own = float_inertia(ours.link_inertia(j))
            if inertia_ratio(float_inertia(difference), own, self._whole) <= self._tolerance:
                continue
            if not _near(difference, each.inertia, self._tolerance):
                continue
            # This link alone explains the difference of the whole body.
            yield _InertiaCandidate(each, k, j, difference, single=True)
            return
        heavy = [k for k in theirs.links[each.theirs] if self._heavy(theirs, k)]
        first = min(heavy or theirs.links[each.theirs])
        named = dict(pairs)
        yield _InertiaCandidate(each, first, named.get(first), left, single=False)

    @staticmethod
    def _heavy(skeleton: Skeleton, link: int) -> bool:
        inertial = skeleton.model.links[link].inertial
        return inertial is not None and bool(inertial.mass or inertial.tensor.any())

    def _seen(self, candidates: Iterable[_InertiaCandidate]) -> bool:
        return any(size > self._tolerance for size in self._sizes(candidates).values())

    def _sizes(self, candidates: Iterable[_InertiaCandidate]) -> dict[int, float]:
        """Return how much is seen of the sum of some differences, by body."""
        groups: dict[int, list[_InertiaCandidate]] = {}
        for each in candidates:
            groups.setdefault(each.body.ours, []).append(each)
        return self._observability.seen([self._sum(body, group) for body, group in groups.items()])

    def _sum(self, body: int, candidates: list[_InertiaCandidate]) -> Mapping[int, RigidInertia]:
        """Return the sum of the differences of a body, moved to the bodies at which it is seen; nothing if it
        is below the tolerance."""
        key = body, *(each.link for each in candidates)
        found = self._regrouped_sums.get(key)
        if found is None:
            total = candidates[0].difference
            for each in candidates[1:]:
                total = total + each.difference
            inertia = float_inertia(total)
            ratio = inertia_ratio(inertia, self._fit.ours.inertias[body], self._whole)
            found = self._observability.regrouped(body, inertia) if ratio > self._tolerance else {}
            self._regrouped_sums[key] = found
        return found

    def _smallest(self, candidates: list[_InertiaCandidate]) -> list[_InertiaCandidate]:
        """Return the fewest candidates without which no difference is seen, the first in document order."""
        if len(candidates) <= MAX_SUBSETS:
            for count in range(1, len(candidates)):
                for chosen in combinations(range(len(candidates)), count):
                    rest = [each for k, each in enumerate(candidates) if k not in chosen]
                    if not self._seen(rest):
                        return [candidates[k] for k in chosen]
            return candidates
        chosen_ones = list(candidates)
        for each in reversed(candidates):
            without = [other for other in chosen_ones if other is not each]
            if not self._seen([other for other in candidates if other not in without]):
                chosen_ones = without
        return chosen_ones

    def _element(self, each: _InertiaCandidate, sizes: Mapping[int, float]) -> DifferingElement:
        ours, theirs = self._fit.ours, self._fit.theirs
        link = theirs.model.links[each.link]
        mine = None if each.mine is None else ours.model.links[each.mine]
        T = theirs.link_pose(each.link)
        new = self._new_inertial(each, T, mine)
        old = link.inertial or Inertial()
        own = self._ratio(each.body)
        my_others, others = [], []
        if not each.single:
            my_others = self._beside(ours, ours.links[each.body.ours], each.mine)
            others = self._beside(theirs, theirs.links[each.body.theirs], each.link)
        message = _inertial_message(old, new)
        if my_others or others:
            without = f" without {_names_text(others)}" if others else ""
            message = f"merged body{without}: {message}"
        return DifferingElement(
            "inertial",
            "link",
            None if mine is None else mine.name,
            link.name,
            max(sizes.get(each.body.ours, 0.0), own) if each.single else own,
            message,
            _beside_text(None if mine is None else mine.inertial, my_others),
            _beside_text(link.inertial, others),
            (FieldChange("link", link.name, "inertial", new),),
            unchanged=mine is not None and are_alike(mine.inertial, link.inertial),
        )

    def _beside(self, skeleton: Skeleton, links: list[int], own: int | None) -> list[str]:
        """Return the names of the links with mass that are merged with a link."""
        return [skeleton.model.links[k].name for k in links if k != own and self._heavy(skeleton, k)]

    def _new_inertial(self, each: _InertiaCandidate, T: Array, mine: Link | None) -> Inertial | None:
        """Return the inertial of the link of `theirs` that has the inertia of `ours`."""
        theirs, D = self._fit.theirs, each.body.D
        line = theirs.model.links[each.link].line
        if each.single and mine is not None:
            assert each.mine is not None
            if mine.inertial is None:
                return None
            place = inverse(T) @ inverse(D) @ self._fit.ours.link_pose(each.mine)
            if float(np.max(np.abs(rounded(place - np.eye(4, dtype=int))))) < SNAP:
                return mine.inertial
            origin = place @ decimals_of_pose(mine.inertial.origin)
            return replace(mine.inertial, origin=nearest_pose(origin, mine.inertial.origin), line=line)
        back = inverse(T) @ inverse(D)
        inertia = theirs.mechanism.links[each.link].inertia + transformed(each.difference, back)
        return inertial_of(float_inertia(inertia))


def decimals_of_pose(pose: Pose) -> Array:
    """Return the matrix (4, 4) of a pose in 50 digits."""
    return homogeneous(*pose_arrays(pose, decimals))


def inertial_of(inertia: RigidInertia) -> Inertial:
    """Return the inertial, in the axes of its link, of an inertia about the origin of the link."""
    mass, h = float(inertia.mass), inertia.first_moment
    c = h / mass if mass else np.zeros(3)
    H = skew(h)
    tensor = inertia.rotational_inertia + (H @ H / mass if mass else 0.0)
    x, y, z = c.tolist()
    xx, xy, xz, yy, yz, zz = tensor[np.triu_indices(3)].tolist()
    return Inertial(mass, Pose((x, y, z)), xx, xy, xz, yy, yz, zz)


def _near(one: RigidInertia, other: RigidInertia, tolerance: float) -> bool:
    """Check whether two differences are equal to a relative tolerance, part by part."""
    return all(
        float(np.max(np.abs(rounded(x - y)))) <= max(tolerance, 1e-9) * float(np.max(np.abs(rounded(x))))
        for x, y in (
            (one.mass, other.mass),
            (one.first_moment, other.first_moment),
            (one.rotational_inertia, other.rotational_inertia),
        )
    )


def _inertial_message(old: Inertial, new: Inertial | None) -> str:
    if new is None:
        return "the link has an inertia instead of none"
    parts = []
    if old.mass != new.mass:
        parts.append(f"mass {old.mass:.12g} kg instead of {new.mass:.12g} kg")
    offset = float(np.linalg.norm(np.subtract(old.origin.xyz, new.origin.xyz)))
    if offset > 0.0:
        parts.append(f"centre of mass {offset:.3g} m off")
    one, other = old.link_tensor, new.link_tensor
    largest = float(np.max(np.abs(other))) or float(np.max(np.abs(one))) or 1.0
    change = float(np.max(np.abs(one - other))) / largest
    if change > 1e-15:
        parts.append(f"moments off by {change:.2g} of the largest")
    return ", ".join(parts) or "the inertia differs"


# -- text -----------------------------------------------------------------------------------------


def nearest_pose(T: Array, own: Pose) -> Pose:
    """Return `own` if it is the pose T (4, 4) to rounding, else the pose of T."""
    matrix = rounded(T)
    if float(np.max(np.abs(matrix - own.matrix))) < SNAP:
        return own
    return Pose.from_matrix(matrix)


def nearest_position(T: Array, own: Pose) -> Vector:
    """Return the position of `own` if it is that of the pose T (4, 4) to rounding, else that of T."""
    x, y, z = rounded(T[:3, 3]).tolist()
    near = all(abs(one - other) < SNAP for one, other in zip((x, y, z), own.xyz, strict=True))
    return own.xyz if near else (x, y, z)


def _names_text(names: list[str]) -> str:
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"{', '.join(names[:3])}{more}"


def _beside_text(inertial: Inertial | None, merged: list[str]) -> str:
    """Write the inertial of a link, and the links that are merged with it."""
    return inertial_text(inertial) + (f", merged with {_names_text(merged)}" if merged else "")

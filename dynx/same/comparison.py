"""`same_robot`: are two descriptions those of one robot, for every state, and if not, what differs?"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, DynxError, shown
from dynx.files.reading import printable
from dynx.model import Model
from dynx.model.loading import load, read_description, read_model
from dynx.model.mechanism import ROOT
from dynx.model.numbers import is_real
from dynx.model.package_search import StrPath
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.same.attributes import Attribute, DescriptionFreedom, attributes, frame_differences, freedoms
from dynx.same.bounds import bounds
from dynx.same.configurations import configuration_differences, joints_of_other_kinds
from dynx.same.constraints import (
    compensation_differences,
    coupled_as,
    equality_differences,
    tendon_differences,
)
from dynx.same.contacts import actuator_differences, contact_differences
from dynx.same.decimals import fifty_digits, rounded
from dynx.same.effects import ElementEffect, values, values_of_variants
from dynx.same.elements import (
    PARTS,
    Analysis,
    DifferingElement,
    FieldChange,
    analyse,
    apply,
    are_equal,
)
from dynx.same.fit import Fit
from dynx.same.mending import mended_text, with_stated_parts
from dynx.same.report import Coordinate, ElementDifference, SameReport, Unmatched
from dynx.same.sensors import sensor_differences
from dynx.same.skeleton import Skeleton, exact_skeleton, without_standing_mimics
from dynx.same.stated_parts import StatedChange, StatedParts, changed_model, effects_of
from dynx.same.text import inertial_text, pose_text, vector_text
from dynx.same.text_edits import NotMendedError
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation

Robot = StrPath | bytes | bytearray | Model

TOLERANCE = 1e-9
"""Default of the largest difference of one robot, relative to the scale of the quantity."""

MAX_EFFECTS = 64
"""Largest number of differences of which effects are measured."""


MAX_SINGLE_CHANGES = 16
"""Largest number of tendons, constraints and keyframes that are mended one by one where all at once fail."""

UNMENDED_PARTS = "tendons, constraints and keyframes are not mended"


@dataclass(frozen=True)
class _Loaded:
    """A description that was read; `data` is its text, None for a model."""

    model: Model
    name: str
    data: str | bytes | None = None

    @property
    def leaves_base_open(self) -> bool:
        """True for URDF, which does not say whether the base moves freely."""
        return self.data is not None and self.source.root.tag == "robot"

    @cached_property
    def source(self) -> XmlSource:
        """The text, to be edited."""
        assert self.data is not None
        return XmlSource(self.data, self.model.source)

    def line_of(self, element: DifferingElement, name: str) -> int | None:
        """Return the line on which an element stands, of the joint or link of that name; in URDF that of the
        part itself. The place of a joint stands at its child in MJCF and SDF."""
        if self.leaves_base_open:
            for each in self.source.root.all(element.tag):
                if each.attributes.get("name") == name:
                    part = each.first(PARTS[element.part])
                    return each.line if part is None else part.line
        if element.tag == "joint":
            joint = self.model.joint(name)
            body = self.model.link(joint.child).line if element.part == "origin" and self.data else None
            return joint.line if body is None else body
        link = self.model.link(name)
        return link.line if link.inertial is None else link.inertial.line or link.line


@checks_types
def same_robot(
    a: Robot,
    b: Robot,
    *,
    base: Base | None = None,
    tolerance: float = TOLERANCE,
    package_dirs: Iterable[StrPath] = (),
) -> SameReport:
    """Decide whether two descriptions describe the same robot, and list what differs.

        report = dynx.same_robot("arm.urdf", "arm.xml")
        assert report.same, report.differences

    `a` and `b` are arguments of `dynx.load`: files, text, names, models, in any of its formats. `base` is the
    base of both robots. By default a URDF file has the base that the other description states, or a fixed
    base.

    dynx merges links that fixed joints connect. It compares the lines of the joint axes at the zero
    positions, and the base inertial parameters of the bodies (Gautier and Khalil 1990). The frames of links,
    the signs of axes, and inertia that affects no motion may differ (`SameReport.freedoms`). The robots are
    the same if every other value differs by at most `tolerance` times its scale:

    - lengths: the reach of the robot
    - angles: 1 rad
    - inertias: the inertia of the body

    dynx computes differences in 50 digits from the decimals of the files. If the robots differ, the report
    lists the fewest elements of `b` to replace, and has `b` with these elements replaced.

    Raises the errors of `dynx.load`, and ArgumentError for a `tolerance` below 0 or not below 1.
    """
    start = time.perf_counter()
    if not (is_real(tolerance) and 0.0 <= tolerance < 1.0):
        raise ArgumentError(f"tolerance is {shown(tolerance)}; wanted a finite number from 0 to below 1")
    tolerance = float(tolerance)
    folders: list[StrPath] = [package_dirs] if isinstance(package_dirs, str) else list(package_dirs)
    first, second = _read(a, base, folders), _read(b, base, folders)
    first, second, notes, unmatched = _with_one_base(first, second)
    notes += [
        f"{each.name}, {note}; it is not compared"
        for each in (first, second)
        for note in each.model.notes
        if note.message.startswith("not read")
    ]
    notes += [*_open_parts(first, second), *_couplings(first, second), *_couplings(second, first)]
    ours, theirs = (without_standing_mimics(each.model) for each in (first, second))
    skeleton = exact_skeleton(ours)
    analysis = analyse(skeleton, theirs, tolerance)
    unmatched += _unmatched(analysis.fit)
    same = analysis.equal and not unmatched
    least = max(tolerance, 1e-15)
    with fifty_digits():
        stated = [*StatedParts(first.model, second.model, analysis.fit, least).changes()]
    changes = [each for each in stated if isinstance(each, StatedChange)]
    notes += [each for each in stated if isinstance(each, str)]
    mended, text, reason = None, None, None
    if not same:
        mended, text, reason = _mended(second, skeleton, theirs, analysis, unmatched, tolerance)
    if changes and reason is None:
        mended, text, left = _with_stated_parts(first, second, skeleton, mended, text, changes, tolerance)
        notes += left
    differences = _differences(analysis, first, second)
    with fifty_digits():
        apart = list(attributes(first.model, second.model, analysis.fit, least))
        frames = list(frame_differences(ours, theirs, analysis.fit, least))
        free = [each for each in frames if isinstance(each, DescriptionFreedom)]
        apart += [each for each in frames if isinstance(each, Attribute)]
        contacts = [*contact_differences(first.model, second.model, analysis.fit, least)]
        apart += [each for each in contacts if isinstance(each, Attribute)]
        apart += actuator_differences(first.model, second.model, analysis.fit, least)
        both = first.model, second.model, analysis.fit
        apart += sensor_differences(*both, least)
        apart += tendon_differences(*both, least)
        constraints = [*equality_differences(*both, least)]
        apart += [each for each in constraints if isinstance(each, Attribute)]
        free += [each for each in constraints if isinstance(each, DescriptionFreedom)]
        apart += compensation_differences(*both, least)
        apart += configuration_differences(*both, least)
        apart = [_with_effects(each, changes, second.model) for each in apart]
        free += [each for each in contacts if isinstance(each, DescriptionFreedom)]
        free += [*freedoms(analysis.fit, tolerance), *_unseen(analysis)]
        limits = bounds(analysis.fit, _unseen_bodies(analysis)) if same else None
    root = analysis.fit.bodies[0].D
    return SameReport(
        first=first.name,
        second=second.name,
        first_source=first.model.source,
        second_source=second.model.source,
        same=same,
        tolerance=tolerance,
        differences=differences,
        unmatched=tuple(unmatched),
        attributes=tuple(apart),
        freedoms=tuple(free),
        coordinates=_coordinates(ours, theirs, analysis.fit),
        bounds=limits,
        T_first_second=rounded(root) if first.model.floating else None,
        notes=tuple(notes),
        seconds=round(time.perf_counter() - start, 4),
        not_mended=reason,
        mended=mended,
        mended_text=text,
    )


def _read(x: Robot, base: Base | None, folders: list[StrPath]) -> _Loaded:
    if isinstance(x, Model):
        model = load(x, base=base)
        return _Loaded(model, model.name)
    data, source, name = read_description(x, folders)
    model = read_model(data, source, name, base=base, package_dirs=folders)
    if name is None:
        return _Loaded(model, model.name, data)
    return _Loaded(model, printable(x if isinstance(x, str) else source), data)


def _with_one_base(first: _Loaded, second: _Loaded) -> tuple[_Loaded, _Loaded, list[str], list[Unmatched]]:
    """Return both descriptions with a base of one kind, what was assumed for it, and what differs by it."""
    kinds = first.model.base, second.model.base
    if kinds[0] == kinds[1]:
        return first, second, [], []
    for number, each in enumerate((first, second)):
        if each.leaves_base_open:
            kind = kinds[1 - number]
            changed = replace(each, model=each.model.with_base(kind))
            note = f"{each.name} does not state its base; it is read as {kind}, as the other is"
            return (changed, second, [note], []) if number == 0 else (first, changed, [note], [])
    message = (
        f"the base is {kinds[1]} instead of {kinds[0]}, and neither description leaves it open; in Python, "
        f"dynx.load(...).with_base({kinds[0]!r}) makes the second robot {kinds[0]}"
    )
    lines = first.model.links[0].line, second.model.links[0].line
    found = Unmatched("base", first.model.root, second.model.root, *lines, message)
    return first, replace(second, model=second.model.with_base(kinds[0])), [], [found]


def _open_parts(first: _Loaded, second: _Loaded) -> Iterator[str]:
    """Yield notes on what only one description states, which therefore is not compared."""
    for one, other in ((first, second), (second, first)):
        if other.model.actuators is None and one.model.actuators:
            yield f"{other.name} states no actuators; those of {one.name} are not compared"
        if other.model.sensors is None and one.model.sensors:
            yield f"{other.name} states no sensors; those of {one.name} are not compared"
        for what, field in (
            ("tendons", "tendons"),
            ("equality constraints", "equalities"),
            ("gravity compensation", "gravity_compensation"),
            ("named configurations", "stated_configurations"),
        ):
            if getattr(other.model, field) is None and getattr(one.model, field):
                yield f"{other.name} states no {what}; what {one.name} states is not compared"
        stated = one.model.contact_filter
        if other.model.contact_filter is None and stated is not None and stated.restricts:
            yield f"{other.name} leaves open which shapes touch; what {one.name} states is not compared"


def _couplings(first: _Loaded, second: _Loaded) -> Iterator[str]:
    """Yield notes on mimic joints of one description that the other couples by an equality constraint."""
    mimics = {each.name for each in first.model.joints if each.mimic is not None}
    for equality in second.model.equalities or ():
        coupling = coupled_as(equality)
        if coupling is None or coupling[0] not in mimics:
            continue
        joint, driver, multiplier, offset = coupling
        if second.model.joint(joint).mimic is None:
            yield (
                f"{second.name} couples joint {joint} by an equality constraint ({multiplier:.9g} * {driver} "
                f"+ {offset:.9g}), which is data; it is a mimic joint of {first.name}"
            )


# -- what differs -----------------------------------------------------------------------------------


def _unmatched(found: Fit) -> list[Unmatched]:
    missing = {found.ours.joints[k].name: k for k in found.missing}
    extra = {found.theirs.joints[k].name: k for k in found.extra}
    entries = []
    for name, k in missing.items():
        joint = found.ours.joints[k]
        if name in extra:
            other = found.theirs.joints[extra.pop(name)]
            was, now = (f"{each.type} below {each.parent}" for each in (joint, other))
            message = f"joint {name} is {now} instead of {was}"
            entries.append(Unmatched("moved", name, name, joint.line, other.line, message))
        else:
            message = f"joint {name} below {joint.parent} has no counterpart in the second robot"
            entries.append(Unmatched("missing", name, None, joint.line, None, message))
    for name, k in extra.items():
        joint = found.theirs.joints[k]
        message = f"joint {name} below {joint.parent} has no counterpart in the first robot"
        entries.append(Unmatched("extra", None, name, None, joint.line, message))
    return entries


def _differences(analysis: Analysis, first: _Loaded, second: _Loaded) -> tuple[ElementDifference, ...]:
    effects = _effects(analysis, second.model)
    found = []
    for element, effect in zip(analysis.elements, effects, strict=True):
        found.append(
            ElementDifference(
                part=element.part,
                tag=element.tag,
                ours=element.ours,
                theirs=element.theirs,
                first=element.first,
                second=element.second,
                wanted=_value_text(element.changes[0]),
                first_line=None if element.ours is None else first.line_of(element, element.ours),
                second_line=second.line_of(element, element.theirs),
                size=element.size,
                message=element.message,
                effect=effect,
            )
        )
    return tuple(found)


def _value_text(change: FieldChange) -> str:
    value = change.value
    if change.field == "origin":
        return pose_text(value)
    if change.field == "axis":
        return vector_text(value)
    if change.field == "inertial":
        return inertial_text(value)
    if change.field == "mimic":
        return (
            "follows no joint"
            if value is None
            else f"{value.multiplier!r} * {value.joint} + {value.offset!r}"
        )
    return str(value)


def _effects(analysis: Analysis, theirs: Model) -> list[ElementEffect | None]:
    """Put each element back alone, as it is in `theirs`, into the robot with all of them replaced."""
    elements = analysis.elements
    effects: list[ElementEffect | None] = [None] * len(elements)
    if not elements:
        return effects
    mended = apply(theirs, (change for each in elements for change in each.changes))
    variants = {k: _put_back(mended, theirs, each) for k, each in enumerate(elements[:MAX_EFFECTS])}
    together = [k for k in variants if elements[k].part in ("origin", "axis", "inertial")]
    try:
        right, *others = values_of_variants([mended, *(variants[k] for k in together)], mended)
        found = dict(zip(together, others, strict=True))
        for k, variant in variants.items():
            effects[k] = right.effect_of(found[k] if k in found else values(variant, mended))
    except DynxError:  # a robot that no backend can evaluate, such as one without links that move
        return [None] * len(elements)
    return effects


def _put_back(mended: Model, theirs: Model, element: DifferingElement) -> Model:
    changes = []
    for change in element.changes:
        part = theirs.joint(change.name) if change.tag == "joint" else theirs.link(change.name)
        changes.append(replace(change, value=getattr(part, change.field)))
    return apply(mended, changes)


def _unseen(analysis: Analysis) -> list[DescriptionFreedom]:
    found = []
    for each in analysis.unseen:
        why = "no state shows it" if each.size == 0.0 else f"{each.size:.2g} of what is seen of it"
        found.append(
            DescriptionFreedom("inertia", each.ours, each.theirs, f"inertia of {each.theirs} differs; {why}")
        )
    return found


def _unseen_bodies(analysis: Analysis) -> frozenset[int]:
    body_of = analysis.fit.theirs.body_of
    numbers = {body_of[each.theirs] for each in analysis.unseen}
    return frozenset(each.ours for each in analysis.fit.bodies if each.theirs in numbers)


def _coordinates(ours: Model, theirs: Model, found: Fit) -> tuple[Coordinate, ...]:
    """Return the coordinates that correspond; those of joints whose types differ do not."""
    mine = set(ours.joint_names)
    other = set(theirs.joint_names) - joints_of_other_kinds(ours, theirs, found).keys()
    rows = []
    for each in found.bodies:
        if each.ours == ROOT:
            continue
        a, b = found.ours.joints[each.ours].name, found.theirs.joints[each.theirs].name
        if a in mine and b in other:
            before, after = (None, None) if each.before is None else map(_quaternion, each.turns)
            rows.append(
                Coordinate(
                    a,
                    b,
                    ours.position_index(a),
                    theirs.position_index(b),
                    each.sign,
                    ours.coordinate_index(a),
                    theirs.coordinate_index(b),
                    before,
                    after,
                )
            )
    return tuple(sorted(rows, key=lambda row: row.first_index))


def _quaternion(R: Floats) -> tuple[float, float, float, float]:
    x, y, z, w = (quat_from_rotation(R) + 0.0).tolist()
    return x, y, z, w


# -- the mended description -------------------------------------------------------------------------


def _mended(
    second: _Loaded,
    ours: Skeleton,
    theirs: Model,
    analysis: Analysis,
    unmatched: list[Unmatched],
    tolerance: float,
) -> tuple[Model | None, bytes | None, str | None]:
    """Return the second robot with its elements replaced, its text, and why there is none."""
    if any(each.kind != "base" for each in unmatched):
        return None, None, "joints without counterpart are not mended by replacing elements"
    if unmatched:
        return None, None, "the kind of the base is not mended by replacing elements"
    changes = [change for each in analysis.elements for change in each.changes]
    mended = apply(second.model, changes)
    if not are_equal(ours, without_standing_mimics(mended), analysis.fit, tolerance):
        return None, None, "the replaced elements do not make the robots the same"
    if second.data is None:
        # URDF has no ball joints.
        text = mended.to_mjcf() if mended.ball_joints else mended.to_urdf()
        return mended, text.encode(), None
    try:
        source = mended_text(second.source, second.model, mended)
        again = read_model(source.to_bytes(), second.model.source, None, base=None)
    except (NotMendedError, DynxError) as error:
        return mended, None, str(error)
    again = without_standing_mimics(again.with_base(theirs.base))
    if not are_equal(ours, again, analysis.fit, tolerance):
        return mended, None, "the mended text is not read as the same robot"
    return mended, source.to_bytes(), None


def _with_stated_parts(
    first: _Loaded,
    second: _Loaded,
    ours: Skeleton,
    mended: Model | None,
    text: bytes | None,
    changes: list[StatedChange],
    tolerance: float,
) -> tuple[Model | None, bytes | None, list[str]]:
    """Return the second robot and its text with the tendons, constraints and keyframes of the first, and
    notes on those that are not mended."""
    model = changed_model(second.model if mended is None else mended, changes)
    if second.data is None:
        return model, model.to_mjcf().encode(), []
    left: list[str] = []
    while changes:
        try:
            # The lines are those of the file: its elements are replaced last.
            source = with_stated_parts(second.source, second.model, model, changes)
            if mended is not None:
                source = mended_text(source, second.model, mended)
            again = read_model(source.to_bytes(), second.model.source, None, base=None)
        except (NotMendedError, DynxError) as error:
            if len(changes) == 1:
                return mended, text, [*left, f"{changes[0].words} is not mended: {error}"]
            if len(changes) > MAX_SINGLE_CHANGES:
                return mended, text, [*left, f"{UNMENDED_PARTS}: {error}"]
            failed = [
                _with_stated_parts(first, second, ours, mended, text, [each], tolerance)[2]
                for each in changes
            ]
            left += [note for notes in failed for note in notes]
            remaining = [each for each, notes in zip(changes, failed, strict=True) if not notes]
            if len(remaining) == len(changes):
                return mended, text, [*left, f"{UNMENDED_PARTS}: {error}"]
            changes = remaining
            model = changed_model(second.model if mended is None else mended, changes)
            continue
        again = again.with_base(second.model.base)
        found = analyse(ours, without_standing_mimics(again), tolerance)
        with fifty_digits():
            rest = StatedParts(first.model, again, found.fit, max(tolerance, 1e-15)).changes()
            names = {each.words for each in rest if isinstance(each, StatedChange)}
        wrong = [each for each in changes if each.words in names]
        if not wrong and found.equal:
            return model, source.to_bytes(), left
        if not wrong:
            return (
                mended,
                text,
                [*left, "tendons, constraints and keyframes are not mended: they change the robot"],
            )
        left += [f"{each.words} is not mended: its text is not read as that of the first" for each in wrong]
        changes = [each for each in changes if each not in wrong]
        model = changed_model(second.model if mended is None else mended, changes)
    return mended, text, left


def _with_effects(attribute: Attribute, changes: list[StatedChange], theirs: Model) -> Attribute:
    """Return an attribute with the effects of its part of the second robot."""
    if attribute.ours is None or attribute.theirs is None:
        return attribute
    sections = {"tendon": "tendon", "equality": "equality", "configuration": "keyframe"}
    for each in changes:
        old = each.old
        if old is None or sections.get(attribute.kind) != each.section or old.line != attribute.second_line:
            continue
        if old.name in ("", attribute.theirs):
            return replace(attribute, effects=effects_of(each, theirs))
    return attribute

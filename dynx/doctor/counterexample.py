"""Search for the smallest counterexample for a difference that no rule explains, for use in a bug report.

The robot is reduced while the difference stays: shapes and simulators' elements are removed, then links,
then moving joints become fixed; then elements, attributes and digits. Between these the state is simplified.
All of it is repeated until nothing more can be removed or the budget is spent. The reductions edit the text
in place, so that a difference caused by the text itself is not lost.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from random import Random
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from dynx.doctor.examination import (
    Examiner,
    States,
    draw_states,
    model_without_mimics,
    reference_values,
)
from dynx.doctor.mending import Place, detections, place_of
from dynx.doctor.report import Counterexample
from dynx.errors import DescriptionError, DynxError
from dynx.model import Model
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.model.xml.text import quoteattr
from dynx.rules import Case, all_rules
from dynx.rules.case import end_of
from dynx.rules.numbers_in_text import is_number
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy


# Delta debugging: search for as many changes as possible while a condition holds.
#
# The minimising algorithm of Zeller and Hildebrandt, "Simplifying and isolating failure-inducing input"
# (IEEE Transactions on Software Engineering 28, 2002, section 3), without the complements. Those save
# trials if few changes can be made, but most of a robot that shows a difference can be removed.


Change = TypeVar("Change")


def maximal_changes(changes: Sequence[Change], holds: Callable[[Sequence[Change]], bool]) -> list[Change]:
    """Find changes that can be made together with `holds` staying true, to which no other single one of
    `changes` can be added; they keep their order.

    `holds` is called with sets of changes, large sets first; neighbours in the list are tried together.
    """
    made: set[int] = set()
    size = len(changes)
    while size:
        found = _try_chunks(changes, holds, made, size)
        # A change may become possible only by another one, so single ones are tried until none is.
        if not (size == 1 and found):
            size //= 2
    return _select(changes, made)


def _try_chunks(
    changes: Sequence[Change], holds: Callable[[Sequence[Change]], bool], made: set[int], size: int
) -> bool:
    """Try the changes not made yet in chunks of `size`; return whether any could be made."""
    waiting = [k for k in range(len(changes)) if k not in made]
    found = False
    for start in range(0, len(waiting), size):
        chunk = waiting[start : start + size]
        if holds(_select(changes, made.union(chunk))):
            made.update(chunk)
            found = True
    return found


def _select(changes: Sequence[Change], numbers: set[int]) -> list[Change]:
    return [changes[k] for k in sorted(numbers)]


# Reductions of the tree of a robot: links merged into their neighbours, moving joints fixed.
#
# The document stays a tree, and nothing else is preserved: the purpose is a smaller robot that still shows
# a difference, not the same robot.


@dataclass(frozen=True)
class Reductions:
    """Changes to one document, and the function that makes some of them together."""

    changes: Sequence[Any]
    apply: Callable[[Sequence[Any]], XmlSource]


def fewer_links(source: XmlSource) -> Reductions:
    """Remove links with their parent joints; their children are connected to the nearest remaining link
    towards the root. The links of a limb follow each other in the list, so that whole limbs can be removed
    at once."""
    return Reductions(
        _LinkTree(source).below_root(), lambda chosen: _LinkTree(source).without_children(chosen)
    )


def higher_links(source: XmlSource) -> Reductions:
    """Remove links, including the root, with one of their child joints, whose child replaces them."""
    return Reductions(
        _LinkTree(source).below_root(), lambda chosen: _LinkTree(source).without_parents(chosen)
    )


def fewer_moving_joints(source: XmlSource) -> Reductions:
    """Make joints fixed."""
    moving = [joint for joint in source.root.all("joint") if joint.attributes.get("type") != "fixed"]
    return Reductions(
        moving,
        lambda chosen: source.apply(*(source.attribute_edit(joint, "type", "fixed") for joint in chosen)),
    )


class _LinkTree:
    """The joints of a document with their ends, which reductions change."""

    def __init__(self, source: XmlSource) -> None:
        self._source = source
        self._joints = source.root.all("joint")
        self._ends = [[end_of(joint, "parent"), end_of(joint, "child")] for joint in self._joints]
        self._gone_joints: set[int] = set()
        self._gone_links: set[str] = set()

    def below_root(self) -> list[int]:
        """List the joints depth first: joint k stands for its child link."""
        children_of: dict[str, list[int]] = {}
        for k, (parent, _) in enumerate(self._ends):
            children_of.setdefault(parent, []).append(k)
        child_links = {child for _, child in self._ends}
        order: list[int] = []
        waiting = [k for root in children_of if root not in child_links for k in reversed(children_of[root])]
        while waiting:
            k = waiting.pop()
            order.append(k)
            waiting += reversed(children_of.get(self._ends[k][1], []))
        return order

    def without_children(self, joints: Sequence[int]) -> XmlSource:
        for k in joints:
            parent, child = self._ends[k]
            self._drop(k, child, parent)
        return self._document()

    def without_parents(self, joints: Sequence[int]) -> XmlSource:
        for k in joints:
            parent, child = self._ends[k]
            self._drop(k, parent, child)
        return self._document()

    def _drop(self, k: int, link: str, other: str) -> None:
        self._gone_joints.add(k)
        self._gone_links.add(link)
        self._ends = [[other if end == link else end for end in ends] for ends in self._ends]

    def _document(self) -> XmlSource:
        source = self._source
        edits: list[Edit] = []
        for k, joint in enumerate(self._joints):
            if k in self._gone_joints:
                edits.append(source.removal(joint))
                continue
            for role, name in zip(("parent", "child"), self._ends[k], strict=True):
                if name != end_of(joint, role):
                    element = joint.first(role)
                    assert element is not None
                    edits.append(source.attribute_edit(element, "link", name))
        links = source.root.all("link")
        gone = [link for link in links if link.attributes.get("name") in self._gone_links]
        return source.apply(*edits, *(source.removal(link) for link in gone))


# Reductions of the details of a small robot: elements and attributes removed, numbers rounded.


DIGITS = (1, 2, 3)
"""Numbers of significant digits that are tried."""

_DYNAMIC = {
    "link": {"inertial"},
    "joint": {"origin", "parent", "child", "axis", "limit", "dynamics", "mimic"},
}
_NAMING = frozenset(["name", "type", "link", "joint", "filename"])

Simpler = Callable[[SourceElement, str, str], str]
"""Function of an element, the name of an attribute and a number in it as text; it returns a simpler
number."""


def fewer_extras(source: XmlSource) -> Reductions:
    """Remove elements that do not affect dynamics: shapes, materials, transmissions, elements of
    simulators."""
    extras = [element for element in source.root.children if element.tag not in _DYNAMIC]
    for tag, dynamic in _DYNAMIC.items():
        for part in source.root.all(tag):
            extras += [element for element in part.children if element.tag not in dynamic]
    return Reductions(extras, lambda chosen: source.apply(*_removals(source, chosen)))


def fewer_elements(source: XmlSource) -> Reductions:
    """Remove elements inside links and joints, except ``<parent>`` and ``<child>``."""
    parts = [part for tag in _DYNAMIC for part in source.root.all(tag)]
    inside = [element for part in parts for element in part.walk() if element is not part]
    droppable = [element for element in inside if element.tag not in ("parent", "child")]
    return Reductions(droppable, lambda chosen: source.apply(*_removals(source, chosen)))


def fewer_attributes(source: XmlSource) -> Reductions:
    """Remove attributes, except names and references."""
    found = [
        (element, attribute)
        for element in source.root.walk()
        for attribute in element.places
        if attribute not in _NAMING
    ]
    return Reductions(
        found,
        lambda chosen: source.apply(*(source.attribute_removal(*each) for each in chosen)),
    )


@dataclass(frozen=True, eq=False)
class _Rounding:
    """New numbers, as text, at some positions of an attribute."""

    element: SourceElement
    attribute: str
    words: dict[int, str]


def frame_axes(source: XmlSource) -> Reductions:
    """Replace the axis of a joint by the nearest axis of its frame."""
    changes = []
    for element, attribute, words in _numbers(source):
        largest = max(range(len(words)), key=lambda k: abs(float(words[k])))
        nearest = {k: "0" if k != largest else _unit(word) for k, word in enumerate(words)}
        changed = any(complexity(new) < complexity(words[k]) for k, new in nearest.items())
        if element.tag == "axis" and changed:
            changes.append(_Rounding(element, attribute, nearest))
    return Reductions(changes, lambda chosen: source.apply(*_rewrites(source, chosen)))


def plain_numbers(source: XmlSource) -> Reductions:
    """Replace a number by 0; a mass, a moment of inertia and a limit by 1, a lower limit by -1."""
    return _roundings(source, _plain)


def unit_numbers(source: XmlSource) -> Reductions:
    """Replace a number by 1 or -1."""
    return _roundings(source, lambda element, attribute, word: _unit(word))


def round_numbers(source: XmlSource, digits: int) -> Reductions:
    """Round numbers to `digits` significant digits."""
    return _roundings(source, lambda element, attribute, word: shortest(f"{float(word):.{digits}g}"))


def complexity(word: str) -> int:
    """Return the complexity of a number: 0 for zero, 1 for one, else 1 plus its significant digits."""
    value = abs(float(word))
    if value in (0.0, 1.0):
        return int(value)
    return 1 + len(f"{value:.16e}".partition("e")[0].replace(".", "").rstrip("0"))


def shortest(word: str) -> str:
    """Write a number in the fewest characters that read back the same; return other text as it is."""
    if not is_number(word):
        return word
    value = float(word)
    return repr(int(value)) if value == int(value) and abs(value) < 1e6 else repr(value)


def format_document(source: XmlSource, *, numbers: bool) -> str:
    """Format the document with two blanks of indentation and without comments, one element to a line, with
    numbers as short as possible if `numbers`."""
    return "\n".join(_lines(source.root, "", numbers)) + "\n"


def _lines(element: SourceElement, indent: str, numbers: bool) -> Iterator[str]:
    written = "".join(
        f" {name}={quoteattr(_format_value(value) if numbers and name not in _NAMING else value)}"
        for name, value in element.attributes.items()
    )
    if not element.children:
        yield f"{indent}<{element.tag}{written}/>"
        return
    yield f"{indent}<{element.tag}{written}>"
    for child in element.children:
        yield from _lines(child, indent + "  ", numbers)
    yield f"{indent}</{element.tag}>"


def _format_value(value: str) -> str:
    return " ".join(shortest(word) for word in value.split(" "))


def _removals(source: XmlSource, chosen: Sequence[SourceElement]) -> Iterator[Edit]:
    """Remove elements; an element inside another removed one needs no edit."""
    removed = {id(element) for element in chosen}
    for element in chosen:
        above = element.parent
        while above is not None and id(above) not in removed:
            above = above.parent
        if above is None:
            yield source.removal(element)


def _roundings(source: XmlSource, simpler: Simpler) -> Reductions:
    """Change single numbers of attributes to simpler ones; the numbers of an axis are changed together."""
    changes = []
    for element, attribute, words in _numbers(source):
        found = {k: simpler(element, attribute, word) for k, word in enumerate(words)}
        found = {k: new for k, new in found.items() if complexity(new) < complexity(words[k])}
        if element.tag != "axis":
            changes += [_Rounding(element, attribute, {k: new}) for k, new in found.items()]
    return Reductions(changes, lambda chosen: source.apply(*_rewrites(source, chosen)))


def _numbers(source: XmlSource) -> Iterator[tuple[SourceElement, str, list[str]]]:
    """Yield the attributes that hold finite numbers and nothing else, with these numbers as text."""
    for element in source.root.walk():
        for attribute in element.places:
            words = element.attributes[attribute].split()
            if attribute not in _NAMING and words and all(map(is_number, words)):
                yield element, attribute, words


def _rewrites(source: XmlSource, chosen: Sequence[_Rounding]) -> Iterator[Edit]:
    together: dict[tuple[int, str], list[_Rounding]] = {}
    for change in chosen:
        together.setdefault((id(change.element), change.attribute), []).append(change)
    for (_, attribute), changes in together.items():
        element = changes[0].element
        words = element.attributes[attribute].split()
        for change in changes:
            for k, word in change.words.items():
                words[k] = word
        yield source.attribute_edit(element, attribute, " ".join(words))


def _unit(word: str) -> str:
    return "-1" if float(word) < 0.0 else "1"


def _plain(element: SourceElement, attribute: str, word: str) -> str:
    if element.tag == "limit":
        return "-1" if attribute == "lower" else "1"
    return "1" if element.tag == "mass" or attribute in ("ixx", "iyy", "izz") else "0"


# Search for the simplest state with a difference: most parts at rest, the others round numbers.
#
# The parts of a state are identified by the names of joints, so that it can be used for a robot from which
# joints were removed. The reduction has two steps. The greedy one starts from a state that shows the
# difference, sets as many parts as possible to rest, then rounds the others one by one; it always ends with
# a state that shows the difference. Hypothesis (the extra ``testing``) then searches all combinations of
# simple values of the parts that are left: it also finds simplifications in which two parts change
# together. It comes second, because it cannot start from a given state and all coordinates have too many
# combinations. Without Hypothesis the greedy result is used.


Slot = tuple[str, int]
"""A part of a state: the joint, or "" for the base, and the number of the part."""

Value = tuple[float, ...]
"""One number, or the four numbers of an attitude."""

ATTITUDE: Slot = ("", 3)
UPRIGHT: Value = (0.0, 0.0, 0.0, 1.0)

MAX_EXAMPLES = 60
"""Largest number of combinations that Hypothesis tries."""

ROUND_VALUES = (1.0, -1.0, 0.5, -0.5, 2.0, -2.0)
_HALF = 0.5**0.5
QUARTER_TURNS: tuple[Value, ...] = tuple(
    tuple(_HALF if k in (axis, 3) else 0.0 for k in range(4)) for axis in range(3)
)
"""Quarter turns about the axes of the world."""


@dataclass(frozen=True)
class ReducibleState:
    """The parts of a state that are not zero.

    A joint has the parts 0 (position), 1 (velocity) and 2 (acceleration). A floating base has its
    position in 0-2, its attitude (quaternion xyzw) in 3, its velocity in 4-9, its acceleration in 10-15.
    """

    parts: Mapping[Slot, Value]

    @classmethod
    def of(cls, model: Model, q: Floats, v: Floats, a: Floats) -> ReducibleState:
        """Make the state from q (nq,), v (nv,), a (nv,) of `model`."""
        parts: dict[Slot, Value] = {}
        nb = 6 if model.floating else 0
        if model.floating:
            base = [*q[:3], None, *v[:6], *a[:6]]
            parts = {("", k): (float(x),) for k, x in enumerate(base) if x is not None}
            parts[ATTITUDE] = tuple(float(x) for x in q[3:7])
        for k, name in enumerate(model.joint_names):
            values = (q[k + model.nq - len(model.joint_names)], v[nb + k], a[nb + k])
            parts.update({(name, number): (float(x),) for number, x in enumerate(values)})
        return cls({}).with_parts(parts)

    def on(self, model: Model) -> tuple[Floats, Floats, Floats]:
        """Return (q, v, a) of `model`. Parts that the model does not have are left out, and parts that are
        missing here are at rest."""
        nb = 6 if model.floating else 0
        q, v, a = model.neutral(), np.zeros(model.nv), np.zeros(model.nv)
        if model.floating:
            q[3:7] = self.parts.get(ATTITUDE, UPRIGHT)
            flat = [self.parts.get(("", k), (0.0,))[0] for k in range(16) if k != ATTITUDE[1]]
            q[:3], v[:6], a[:6] = flat[:3], flat[3:9], flat[9:]
        for k, name in enumerate(model.joint_names):
            values = [self.parts.get((name, number), (0.0,))[0] for number in range(3)]
            q[nb + k + (1 if nb else 0)], v[nb + k], a[nb + k] = values
        return q, v, a

    def within(self, model: Model) -> ReducibleState:
        """Keep the parts that `model` has."""
        known = {*model.joint_names, *([""] if model.floating else [])}
        return ReducibleState({slot: value for slot, value in self.parts.items() if slot[0] in known})

    def with_parts(self, changed: Mapping[Slot, Value]) -> ReducibleState:
        """Change some parts; parts at rest are removed."""
        parts = {**self.parts, **changed}
        return ReducibleState({slot: value for slot, value in parts.items() if value != rest(slot)})

    @property
    def key(self) -> tuple[tuple[Slot, Value], ...]:
        """Hashable form, equal for equal states."""
        return tuple(sorted(self.parts.items()))

    @property
    def complexity(self) -> tuple[int, int, int]:
        """Measure of complexity: number of parts, digits of their numbers, and number of negative numbers."""
        numbers = [number for value in self.parts.values() for number in value]
        digits = sum(complexity(repr(number)) for number in numbers)
        return len(self.parts), digits, sum(number < 0.0 for number in numbers)


Holds = Callable[[ReducibleState], bool]


def rest(slot: Slot) -> Value:
    """Return the value of a part at rest at zero."""
    return UPRIGHT if slot == ATTITUDE else (0.0,)


def simplest_state(state: ReducibleState, holds: Holds, seed: int) -> ReducibleState:
    """Find the simplest state for which `holds` is true, starting from `state`, for which it is; no part
    is added."""
    return _search(_reduce_greedily(state, holds), holds, seed)


def _reduce_greedily(state: ReducibleState, holds: Holds) -> ReducibleState:
    slots = sorted(state.parts)
    resting = maximal_changes(
        slots, lambda chosen: holds(state.with_parts({slot: rest(slot) for slot in chosen}))
    )
    state = state.with_parts({slot: rest(slot) for slot in resting})
    for slot in sorted(state.parts):
        for value in _simpler_values(slot, state.parts[slot]):
            simpler = state.with_parts({slot: value})
            if holds(simpler):
                state = simpler
                break
    return state


def _search(state: ReducibleState, holds: Holds, seed: int) -> ReducibleState:
    """Let Hypothesis search for a simpler state; `state` itself where it finds none."""
    try:
        from hypothesis import HealthCheck, Phase, currently_in_test_context, find, settings
        from hypothesis.errors import NoSuchExample, Unsatisfiable
        from hypothesis.strategies import fixed_dictionaries, sampled_from
    except ImportError:
        return state
    # Hypothesis refuses to run inside one of its own tests.
    if not state.parts or currently_in_test_context():
        return state
    ladders: dict[Slot, SearchStrategy[Value]] = {
        slot: sampled_from([rest(slot), *_simpler_values(slot, value), value])
        for slot, value in sorted(state.parts.items())
    }
    profile = settings(
        database=None,
        deadline=None,
        derandomize=False,
        max_examples=MAX_EXAMPLES,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    try:
        parts = find(
            fixed_dictionaries(ladders),
            lambda parts: holds(state.with_parts(parts)),
            settings=profile,
            random=Random(seed),
        )
    except (NoSuchExample, Unsatisfiable):
        return state
    return min(state, state.with_parts(parts), key=lambda each: each.complexity)


def _simpler_values(slot: Slot, value: Value) -> list[Value]:
    """List values simpler than `value`, the simplest first, without the value at rest."""
    if slot == ATTITUDE:
        return [] if value in QUARTER_TURNS else list(QUARTER_TURNS)
    number = value[0]
    rounded = [*ROUND_VALUES, *(float(f"{number:.{digits}g}") for digits in DIGITS)]
    order = list(dict.fromkeys(rounded))
    end = ROUND_VALUES.index(number) if number in ROUND_VALUES else len(order)
    return [(each,) for each in order[:end] if each != number]


# Trials of smaller robots at simpler states: whether each still shows a difference, within a budget.


Difference = Callable[[Case, Model, Floats, Floats, Floats], float]
"""Function of (case, model, q, v, a) that returns the relative error of the engine in question; 0 where it
cannot be evaluated."""

MAX_TRIALS = 1500
"""Largest number of trials; each loads an engine, which takes 5 to 50 ms."""


class ReductionTrials:
    """Evaluator of `difference` that stores its values and stops when the budget [s] is spent.

    A robot is tried only if it has no cause of the catalogue that the `original` does not have: a link
    without ``<inertial>``, for example, would show that difference instead. A state is tried only within the
    limits of the joints, outside which some engines apply a force; an exception are joints of the original
    whose limits leave no range.
    """

    def __init__(self, difference: Difference, original: Case, budget: float | None) -> None:
        self._difference = difference
        self._known_causes = _causes(original)
        self._until = math.inf if budget is None else perf_counter() + budget
        self._errors: dict[tuple[bytes, object], float] = {}
        self._cause_free: dict[bytes, bool] = {}
        self._last_model: tuple[bytes, Model | None] = (b"", None)
        self._count = 0
        self.threshold = 0.0
        model = self.model(original)
        self._without_range = frozenset() if model is None else _joints_without_range(model)

    @property
    def spent(self) -> bool:
        """True if the budget is spent."""
        return self._count >= MAX_TRIALS or perf_counter() >= self._until

    def holds(self, case: Case, state: ReducibleState) -> bool:
        """Check that the error is above the threshold; False if it was not tried within the budget."""
        return self.error(case, state) > self.threshold and self._adds_no_cause(case)

    def error(self, case: Case, state: ReducibleState) -> float:
        """Return the relative error, infinite for NaN; 0 where nothing was tried."""
        model = self.model(case)
        if model is None:
            return 0.0
        key = (_digest(case), state.within(model).key)
        if key not in self._errors:
            q, v, a = state.on(model)
            if self.spent or not self._is_within_limits(model, q):
                return 0.0
            self._count += 1
            found = float(self._difference(case, model, q, v, a))
            self._errors[key] = math.inf if math.isnan(found) else found
        return self._errors[key]

    def model(self, case: Case) -> Model | None:
        """Return the robot in the coordinates of all its moving joints; None where dynx refuses the text."""
        text = _digest(case)
        if self._last_model[0] != text:
            try:
                self._last_model = text, model_without_mimics(case.source, case.base)
            except DynxError:
                self._last_model = text, None
        return self._last_model[1]

    def _is_within_limits(self, model: Model, q: Floats) -> bool:
        joints = model.coordinate_joints
        fine = (model.lower <= q) & (q <= model.upper)
        inside = fine[len(q) - len(joints) :]
        outside = {joint.name for joint, fits in zip(joints, inside, strict=True) if not fits}
        return outside <= self._without_range

    def _adds_no_cause(self, case: Case) -> bool:
        text = _digest(case)
        if text not in self._cause_free:
            self._cause_free[text] = _causes(case) <= self._known_causes
        return self._cause_free[text]


def _digest(case: Case) -> bytes:
    return hashlib.blake2b(case.source.data, digest_size=16).digest()


def _causes(case: Case) -> frozenset[Place]:
    causes = [rule for rule in all_rules() if rule.kind == "difference"]
    return frozenset(place_of(rule, each) for rule, each in detections(case, causes))


def _joints_without_range(model: Model) -> frozenset[str]:
    return frozenset(
        joint.name for joint in model.coordinate_joints if joint.limits.lower >= joint.limits.upper
    )


def difference_of(examiner: Examiner, engine: str, quantity: str) -> Difference:
    """Return the relative error of `engine` in `quantity` when it loads the text of a case."""

    def difference(case: Case, model: Model, q: Floats, v: Floats, a: Floats) -> float:
        try:
            free = model_without_mimics(case.source, case.base)
            if (free.nq, free.nv) != (len(q), len(v)):
                return 0.0
            rows = [np.asarray(row, dtype=np.float64)[None] for row in (q, v, a)]
            states = States(rows[0], rows[1], rows[2], np.zeros_like(rows[2]))
            examination = examiner.examine(case, [engine], reference=reference_values(free, states))
        except DynxError:
            return 0.0
        output = examination.outputs[engine]
        if output.no_results is not None or quantity in output.failed:
            return 0.0
        return examination.error(engine, quantity)

    return difference


INITIAL_STATES = 8
"""Number of random states at which the difference is measured. The search starts from the one with the
largest difference."""

MAX_ROUNDS = 4
"""Largest number of repetitions of all reductions; later ones remove little."""

TREE_REDUCTIONS: tuple[Callable[[XmlSource], Reductions], ...] = (
    fewer_extras,
    fewer_links,
    higher_links,
    fewer_moving_joints,
)
DETAIL_REDUCTIONS: tuple[Callable[[XmlSource], Reductions], ...] = (
    fewer_elements,
    fewer_attributes,
    frame_axes,
    plain_numbers,
    unit_numbers,
    *(partial(round_numbers, digits=digits) for digits in DIGITS),
)


def smallest_counterexample(
    case: Case, difference: Difference, *, tolerance: float, seed: int, budget: float | None
) -> Counterexample | None:
    """Find the smallest robot and the simplest state at which the difference is still there.

    `difference(case, model, q, v, a)` is the relative error of an engine on the text of a case, at a state in
    the coordinates of `model` (that text without mimic joints); 0 where it cannot be evaluated. The result
    has no more links and moving joints than `case` and adds no cause of the catalogue. Its error is above
    `tolerance`, and at least the geometric mean of the tolerance and the error found first (or 1, if that is
    smaller), so that a real difference is not reduced to noise.

    `budget` is the time [s] after which no new robot is tried; with None only `trials.MAX_TRIALS` limits the
    search. Equal arguments give equal results unless the time runs out.

    Returns None where dynx cannot read the case, or `INITIAL_STATES` random states, which follow from
    `seed`, show no error above `tolerance`.
    """
    trials = ReductionTrials(difference, case, budget)
    state = _first_state(case, trials, tolerance, seed)
    if state is None:
        return None
    for _ in range(MAX_ROUNDS):
        before = case.source.data, state.key
        case = _reduce(case, state, trials, TREE_REDUCTIONS)
        if trials.spent:
            break
        state = simplest_state(state, partial(trials.holds, case), seed)
        case = _reduce(case, state, trials, DETAIL_REDUCTIONS)
        if (case.source.data, state.key) == before or trials.spent:
            break
    return _result(_format_case(case, state, trials), state, trials)


def _first_state(case: Case, trials: ReductionTrials, tolerance: float, seed: int) -> ReducibleState | None:
    """Find the state of the largest error, and set the threshold of the trials by it."""
    model = trials.model(case)
    if model is None:
        return None
    drawn = draw_states(model, INITIAL_STATES, seed)
    states = [ReducibleState.of(model, *each) for each in zip(drawn.q, drawn.v, drawn.a, strict=True)]
    errors = [trials.error(case, state) for state in states]
    largest = max(errors)
    if largest <= tolerance:
        return None
    trials.threshold = max(tolerance, math.sqrt(tolerance * min(largest, 1.0)))
    return states[errors.index(largest)]


def _reduce(
    case: Case,
    state: ReducibleState,
    trials: ReductionTrials,
    kinds: Sequence[Callable[[XmlSource], Reductions]],
) -> Case:
    for kind in kinds:
        reductions = kind(case.source)

        def still_holds(
            changes: Sequence[Any], reductions: Reductions = reductions, case: Case = case
        ) -> bool:
            if trials.spent:
                return False
            try:
                smaller = case.with_source(reductions.apply(changes))
            except DescriptionError:
                return False  # For example, the text is not XML after removal of a namespace.
            return trials.holds(smaller, state)

        made = maximal_changes(reductions.changes, still_holds)
        if made:
            case = case.with_source(reductions.apply(made))
    return case


def _format_case(case: Case, state: ReducibleState, trials: ReductionTrials) -> Case:
    """Format the text of the case, if the formatted text shows the difference too."""
    for numbers in (True, False):
        text = format_document(case.source, numbers=numbers)
        candidate = case.with_source(XmlSource(text, case.source.source))
        if trials.holds(candidate, state):
            return candidate
    return case


def _result(case: Case, state: ReducibleState, trials: ReductionTrials) -> Counterexample:
    model = trials.model(case)
    assert model is not None
    q, v, a = (tuple(row.tolist()) for row in state.on(model))
    return Counterexample(case.source.text, q, v, a, len(model.joint_names), trials.error(case, state))

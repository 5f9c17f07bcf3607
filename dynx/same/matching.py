"""Matching of the bodies of two robots, and the pose of each body's frame in that of its counterpart.

If the robots are the same, these poses D follow from the root to the tips: with T the pose of a joint in the
body of its parent, ``T_ours D = D_parent T_theirs``. What then differs is the axis of the joint, or the
inertia. Where a joint is placed otherwise, D is the pose that leaves the fewest elements to replace; it is
among the candidates of `dynx.same.registration`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import chain, islice
from typing import Any

import numpy as np

from dynx.model.mechanism import ROOT
from dynx.same.limits import limit_differences
from dynx.same.registration import MAX_STATED, candidates, candidates_of_other_pairings
from dynx.same.scales import extent, inertia_ratio
from dynx.same.shapes import SHAPE_KINDS, matched_shapes
from dynx.same.skeleton import Skeleton, are_alike, is_of_reader, subtract, transformed
from dynx.same.stated_poses import StatedPoses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import cross, rotation_about

MAX_PLANS = 1_500
"""Largest number of placements of bodies that are tried."""

NEARLY = 0.1
"""Difference of inertias and places, relative to their magnitudes, up to which frames count as unmoved."""

FRAMES_PER_JOINT = 12
"""Number of calls inside one another, at most, for each joint between the root and a tip."""

MAX_CANDIDATES = 100
"""Largest number of candidates for the frame of one body."""

MAX_TURNED = 40
"""Number of candidates among which a frame is looked for that is slightly turned."""

MAX_BASES = 3
"""Largest number of frames of a floating base below which all others are tried."""

ROUNDING = 1e-6
"""Difference of two distances of joints, relative to the size of the robot, that may be rounding."""

MIN_TOLERANCE = 1e-11
"""Smallest relative difference that counts while bodies are matched in float64."""

UNCHANGED = 1.001
"""Cost of replacing an element that is written as its counterpart is: another one differs, if one can."""

SLACK = 1.0
"""Number of elements by which a frame may fit worse than another one and is still tried."""

MARGIN = 1e-6
"""Share of a limit by which a difference exceeds it for certain, whatever the rounding."""

HALF = 0.5
"""Cost of a frame in which all bodies fit, but their exchanged inertias do not add up to the root's."""

KEY_DIGITS = 2
"""Decimals of a pose, beyond those of the tolerance, by which poses have one plan."""

SAME_FRAME = 1e-12
"""Difference of two poses (m, or an entry of the rotation) that are the same frame."""

Key = tuple[int, int, bytes]


@dataclass(frozen=True)
class BodyPair:
    """Body `ours` and its counterpart `theirs`; `chosen` is the pose D (4, 4) where it does not follow from
    the parent's, and where the bodies are roots."""

    ours: int
    theirs: int
    chosen: Floats | None = None


@dataclass(frozen=True)
class MatchingPlan:
    """Pairs of a subtree, the bodies of both robots without counterpart, the number of elements that differ,
    and that of joints whose axes are opposite."""

    cost: float
    pairs: tuple[BodyPair, ...] = ()
    missing: tuple[int, ...] = ()
    extra: tuple[int, ...] = ()
    opposite: int = 0

    @property
    def rank(self) -> tuple[float, int]:
        """Order of preference, the lowest first: fewer elements, then fewer opposite axes."""
        return round(self.cost, 6), self.opposite


class _Distinct:
    """Arrays of an iterator, each once, however often they are iterated."""

    def __init__(self, source: Iterator[Floats]) -> None:
        self._source = source
        self._found: list[Floats] = []

    def __iter__(self) -> Iterator[Floats]:
        number = 0
        while number < len(self._found) or self._find():
            yield self._found[number]
            number += 1

    def _find(self) -> bool:
        """Find one more; False if there is none."""
        for each in self._source:
            if not any(float(np.max(np.abs(each - other))) < SAME_FRAME for other in self._found):
                self._found.append(each)
                return True
        return False


@dataclass
class Matching:
    """Search for the plan with the fewest differing elements."""

    ours: Skeleton
    theirs: Skeleton
    tolerance: float
    base: Floats | None = None
    """Pose (4, 4) of the frame of a floating base in its counterpart, if known."""
    _plans: dict[Key, MatchingPlan] = field(default_factory=dict)
    _sizes: dict[int, float] = field(default_factory=dict)
    _equal_inertials: dict[tuple[int, int], bool] = field(default_factory=dict)
    _counts: dict[Key, tuple[float, bool]] = field(default_factory=dict)
    _named: dict[tuple[int, int], tuple[list[tuple[int, int]], list[int], list[int]]] = field(
        default_factory=dict
    )
    _turned_counts: dict[tuple[int, int], float] = field(default_factory=dict)
    _own_costs: dict[Key, float] = field(default_factory=dict)
    _unmoved: dict[tuple[int, int], bool] = field(default_factory=dict)
    _turned_fits: dict[tuple[int, int], bool] = field(default_factory=dict)
    _candidates: dict[tuple[int, int], _Distinct] = field(default_factory=dict)
    _turns: dict[tuple[int, int], _Distinct] = field(default_factory=dict)
    _misplaced_counts: dict[Key, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.tolerance = max(self.tolerance, MIN_TOLERANCE)
        self.length = max(self.ours.reach, self.theirs.reach)
        self._digits = KEY_DIGITS - int(np.floor(np.log10(self.tolerance)))
        self._per_length = np.array([[1.0, 1.0, 1.0, 1.0 / self.length]] * 3)
        self._stated = StatedPoses(self.ours, self.theirs)

    def find(self) -> MatchingPlan:
        """Return the best plan of the whole robots. The frame of a floating base may be anywhere in it."""
        before = sys.getrecursionlimit()
        sys.setrecursionlimit(before + FRAMES_PER_JOINT * self.ours.depth)
        try:
            return self._best()
        finally:
            sys.setrecursionlimit(before)

    def _best(self) -> MatchingPlan:
        if not (self.ours.model.floating and self.theirs.model.floating):
            return self._chosen(ROOT, ROOT, np.eye(4), 0.0)
        if self.base is not None:
            return self._chosen(ROOT, ROOT, self.base, 0.0)
        found: list[tuple[float, int, int, Floats]] = []
        # A root without mass looks the same in any frame.
        unmoved = float(self.ours.inertias[ROOT].mass) > 0.0 and self._is_unmoved(ROOT, ROOT)
        unmoved = unmoved and not self._fits_turned(ROOT, ROOT)
        bases = [np.eye(4)] if unmoved else self._candidates_of(ROOT, ROOT)
        for number, D in enumerate(bases):
            limit = found[MAX_BASES - 1][0] if len(found) >= MAX_BASES else np.inf
            count = self._followed(ROOT, ROOT, D, limit + HALF)
            if count == 0.0 and not self._has_same_total(D):
                # Each body fits but for what may belong to its parent; the root has not got it.
                count = HALF
            # Of bases that explain as much, those in which more shapes and configurations are as they were.
            others = self._misplaced(ROOT, ROOT, D) if count <= limit else 0
            found = sorted([*found, (count, others, number, D)], key=_first_three)
            # The frame as it is stays in the choice, and the first in which the base itself fits: below a
            # misplaced joint all differs, in any frame.
            kept = [entry for entry in found[MAX_BASES:] if entry[2] == 0]
            fitting = (entry for entry in found if self._own_cost(ROOT, ROOT, entry[3]) == 0.0)
            kept += [entry for entry in islice(fitting, 1) if entry[2] and entry not in found[:MAX_BASES]]
            found = [*found[:MAX_BASES], *kept]
            if found[0][:2] == (0.0, 0):
                break
        if found[0][0] <= HALF or found[0][2] == 0:
            found = found[:1]
        best = self._chosen(ROOT, ROOT, found[0][3], 0.0)
        others = self._misplaced(ROOT, ROOT, found[0][3]) if len(found) > 1 else 0
        for _, _, _, D in found[1:]:
            bound = round(self._bound(ROOT, ROOT, D), 6)
            if (bound, 0, 0) < _preference(best, others):
                plan, other = self._chosen(ROOT, ROOT, D, 0.0), self._misplaced(ROOT, ROOT, D)
                if _preference(plan, other) < _preference(best, others):
                    best, others = plan, other
        return best

    def _has_same_total(self, D: Floats) -> bool:
        """Check whether the roots with the frames D have the same inertia with all that may be theirs."""
        mine, other = self.ours.grouped[ROOT], self.theirs.grouped[ROOT]
        whole = self.ours.whole
        return inertia_ratio(subtract(mine, transformed(other, D)), mine, whole) <= self.tolerance

    def _misplaced(self, a: int, b: int, D: Floats, followed: Floats | None = None) -> int:
        """Count the shapes of two bodies with the frames D that have no equal, and the configurations in
        which their floating bases or ball joints differ. Of a ball joint `followed` follows from the parent.
        """
        shapes = self._misplaced_shapes(a, b, D)
        if followed is None:
            return shapes + self._stated.count_misplaced_bases(D, self.tolerance)
        if not self.ours.heavy_links[a]:
            # A link without mass between two joints has no shapes; that on the other joint has.
            for i, j in self._by_name(a, b, D):
                at = inverse(self.ours.placements[i]) @ D @ self.theirs.placements[j]
                shapes += self._misplaced_shapes(i, j, at)
        turns = followed[:3, :3], D[:3, :3]
        return shapes + self._stated.count_turned_balls(a, b, *turns, self.tolerance)

    def _misplaced_shapes(self, a: int, b: int, D: Floats) -> int:
        """Count the shapes of two bodies with the frames D that have no equal."""
        key = self._key(a, b, D)
        count = self._misplaced_counts.get(key)
        if count is None:
            found = (
                matched_shapes(kind, self.ours, self.theirs, a, b, D, self.tolerance) for kind in SHAPE_KINDS
            )
            count = self._misplaced_counts[key] = sum(len(each.first) + len(each.second) for each in found)
        return count

    def _bound(self, a: int, b: int, D: Floats) -> float:
        """Return a lower bound on the cost of two bodies with the frames D: a child that fits none of the
        other's children where it follows costs 1 at least."""
        cost = self._own_cost(a, b, D)
        for i in self.ours.children[a]:
            back = inverse(self.ours.placements[i]) @ D
            if self.ours.kinds[i] == "ball":
                continue
            cost += not any(
                self._alike(i, j) and self._own_cost(i, j, back @ self.theirs.placements[j]) == 0.0
                for j in self.theirs.children[b]
            )
        return cost

    def _followed(self, a: int, b: int, D: Floats, limit: float) -> float:
        """Return how many elements differ if every frame follows from D, or any number from `limit` on."""
        key = self._key(a, b, D)
        known = self._counts.get(key)
        if known is not None and (known[1] or known[0] >= limit):
            return known[0]
        cost = self._own_cost(a, b, D)
        matched = self._by_name(a, b, D)
        lost = len(self.ours.children[a]) + len(self.theirs.children[b]) - 2 * len(matched)
        cost += 2.0 * lost
        complete = True
        for i, j in matched:
            if cost >= limit:
                complete = False
                break
            followed = inverse(self.ours.placements[i]) @ D @ self.theirs.placements[j]
            cost += self._fewest(i, j, followed, limit - cost)
        self._counts[key] = cost, complete and cost < limit
        return cost

    def _fewest(self, a: int, b: int, D: Floats, limit: float) -> float:
        """Return the least of the numbers `_followed` of the frames that a body has where D follows from its
        parent, or any number from `limit` on."""
        count = self._followed(a, b, D, limit)
        if count == 0.0 or self.ours.kinds[a] != "ball":
            return count
        # What is below a ball joint does not depend on what is above it, but for the centre.
        off = float(np.linalg.norm(D[:3, 3])) > self.tolerance * self.length
        turned = self._turned_counts.get((a, b))
        if turned is None:
            turned = np.inf
            for R in self._turns_of(a, b):
                turned = min(turned, self._followed(a, b, homogeneous(R, np.zeros(3)), turned))
                if turned == 0.0:
                    break
            self._turned_counts[a, b] = turned
        return min(count, off + turned)

    def _free_frames(self, a: int, b: int, followed: Floats) -> Iterator[Floats]:
        """Yield the frames that cost nothing where `followed` follows from the parent: a body on a ball joint
        may be turned about the centre."""
        yield followed
        if a == ROOT or self.ours.kinds[a] != "ball":
            return
        for D in self._turns_of(a, b):
            if float(np.max(np.abs(D - followed[:3, :3]))) > SAME_FRAME:
                yield homogeneous(D, followed[:3, 3])

    def _turns_of(self, a: int, b: int) -> _Distinct:
        """Return the rotations (3, 3) of the candidates, each once."""
        found = self._turns.get((a, b))
        if found is None:
            found = self._turns[a, b] = _Distinct(D[:3, :3] for D in self._candidates_of(a, b))
        return found

    def _turned(self, a: int, b: int, followed: Floats) -> MatchingPlan:
        """Return the best plan of two bodies on ball joints: their frames may be turned about the centre, and
        where the centre is elsewhere, the joint or what is attached to its link is moved."""
        places = [(followed[:3, 3], 0.0)]
        if float(np.linalg.norm(followed[:3, 3])) > self.tolerance * self.length:
            places.append((np.zeros(3), _cost(self._has_equal_origins(a, b))))
        best: tuple[MatchingPlan, int] | None = None
        for p, extra in places:
            found: list[tuple[float, int, int, Floats]] = []
            at = homogeneous(followed[:3, :3], p)
            stated = islice(self._stated.turns_of_ball(a, b, followed[:3, :3]), MAX_STATED)
            frames = chain(self._free_frames(a, b, at), (homogeneous(R, p) for R in stated))
            for number, D in enumerate(frames):
                limit = found[MAX_BASES - 1][0] if len(found) >= MAX_BASES else np.inf
                count = self._followed(a, b, D, limit + HALF)
                # Of frames that explain as much, those in which more shapes and configurations are as they
                # were.
                fits = self._own_cost(a, b, D) == 0.0
                others = self._misplaced(a, b, D, followed) if fits or count <= limit else 0
                found = sorted([*found, (count, others, number, D)], key=_first_three)
                # The first of these in which the body itself fits stays in the choice: below a misplaced
                # joint all differs.
                fitting = (entry for entry in found[MAX_BASES:] if entry[1] < found[0][1])
                fitting = (entry for entry in fitting if self._own_cost(a, b, entry[3]) == 0.0)
                found = [*found[:MAX_BASES], *islice(fitting, 1)]
                if found[0][:2] == (0.0, 0):
                    break
            for count, others, number, D in found:
                if best is not None and len(self._plans) > MAX_PLANS:
                    break
                if number == 0 and extra == 0.0:
                    plan = self._subtree(a, b, D)
                else:
                    plan = self._chosen(a, b, D, extra)
                if best is None or _preference(plan, others) < _preference(*best):
                    best = plan, others
                if count == 0.0:
                    break
        assert best is not None
        return best[0]

    def _chosen(self, a: int, b: int, D: Floats, extra: float) -> MatchingPlan:
        plan = self._subtree(a, b, D)
        return replace(plan, cost=plan.cost + extra, pairs=(BodyPair(a, b, D), *plan.pairs[1:]))

    def _joined(self, a: int, b: int, D_parent: Floats) -> MatchingPlan:
        """Return the best plan of two bodies whose parents have the frames D_parent."""
        ours, theirs = self.ours.placements[a], self.theirs.placements[b]
        followed = inverse(ours) @ D_parent @ theirs
        if self.ours.kinds[a] == "ball":
            return self._turned(a, b, followed)
        unmoved = self._is_unmoved(a, b)
        # A joint of MJCF that is moved in its body is one element; the body is where it should be.
        elsewhere = self._axis_cost(a, b, followed) > 0.0 and self._own_cost(a, b, followed) > UNCHANGED
        as_they_are = unmoved and not _is_identity(followed) and elsewhere
        if not as_they_are:
            best = self._subtree(a, b, followed)
            # Another frame is one element at least.
            if best.rank <= (1.0, 0):
                return best
        if unmoved:
            plan = self._chosen(a, b, np.eye(4), _cost(self._has_equal_origins(a, b)))
            if as_they_are or plan.rank < best.rank:
                best = plan
            if best.rank <= (UNCHANGED, 0) or not self._fits_turned(a, b):
                return best
        for D, cost in self._ordered_frames(a, b, followed, best.rank[0]):
            if len(self._plans) > MAX_PLANS:
                break
            if unmoved and not self._is_near(D):
                continue
            replaced = self._place_cost(a, b, D)
            if (round(replaced + cost, 6), 0) >= best.rank:
                continue
            if (round(replaced + self._bound(a, b, D), 6), 0) >= best.rank:
                continue
            plan = self._chosen(a, b, D, replaced)
            if plan.rank < best.rank:
                best = plan
            if best.rank <= (1.0, 0):
                break
        return best

    def _ordered_frames(
        self, a: int, b: int, followed: Floats, limit: float
    ) -> Iterator[tuple[Floats, float]]:
        """Yield the frames that body b may have in body a, but `followed`, with the number of elements that
        differ of the bodies themselves; with the place of the joint it is below `limit`.

        Those are first below which the fewest elements differ if all frames follow, and of these the ones in
        which the body has the inertia of its counterpart: what may belong to its parent need not be there.
        Those with `SLACK` more than the first are left out, unless the bodies themselves fit: below a right
        frame a misplaced joint is one element, but nothing fits that follows from it.
        """
        own = self._own_cost(a, b, followed)
        found: list[tuple[float, bool, int, Floats, float]] = []
        fewest = np.inf
        for D in chain([np.eye(4)], self._aligned(a, b, followed), self._candidates_of(a, b)):
            # A frame in which the body itself fits worse than before is not that of the body.
            cost = self._own_cost(a, b, D)
            if cost > own or self._place_cost(a, b, D) + cost >= limit:
                continue
            if float(np.max(np.abs(D - followed))) <= SAME_FRAME:
                continue
            count = self._followed(a, b, D, fewest + SLACK)
            exchanged = not self._has_whole_inertia(a, b, D)
            if count == 0.0 and not exchanged:
                yield D, cost
                return
            if count <= fewest + SLACK or cost == 0.0:
                found.append((count, exchanged, len(found), D, cost))
                fewest = min(fewest, count)
        for count, _, _, D, cost in sorted(found, key=_first_three):
            if count <= fewest + SLACK or cost == 0.0:
                yield D, cost

    def _aligned(self, a: int, b: int, D: Floats) -> Iterator[Floats]:
        """Yield the frames nearest to D in which the axes and the centres of mass of two bodies coincide, as
        far as they can; they are the only ones where a body is symmetric about its axis."""
        axis, other = self.ours.axes[a], D[:3, :3] @ self.theirs.axes[b]
        mine, theirs = self.ours.inertias[a], self.theirs.inertias[b]
        # The nearest of both first: a slide turned by half a turn fits but for what its parent may have.
        near = 1.0 if float(other @ axis) >= 0.0 else -1.0
        for sign in (near, -near):
            normal = cross(sign * other, axis)
            sine, cosine = float(np.linalg.norm(normal)), float(sign * other @ axis)
            R = D[:3, :3]
            if sine > 0.0:
                R = rotation_about(normal / sine, np.asarray(np.arctan2(sine, cosine))) @ R
            elif cosine < 0.0:
                continue
            p = axis * float(axis @ D[:3, 3])
            if float(mine.mass) > 0.0 and float(theirs.mass) > 0.0:
                at = mine.first_moment / mine.mass - R @ (theirs.first_moment / theirs.mass)
                p = axis * float(axis @ at) if self.ours.kinds[a] == "revolute" else at
            yield homogeneous(R, p)

    def _candidates_of(self, a: int, b: int) -> _Distinct:
        """Return the candidates, each once."""
        found = self._candidates.get((a, b))
        if found is None:
            first = islice(candidates(self.ours, self.theirs, a, b), MAX_CANDIDATES)
            others = candidates_of_other_pairings(self.ours, self.theirs, a, b)
            found = self._candidates[a, b] = _Distinct(chain(first, others))
        return found

    def _subtree(self, a: int, b: int, D: Floats) -> MatchingPlan:
        """Return the best plan of two bodies with the frames D, and of all below them."""
        key = self._key(a, b, D)
        plan = self._plans.get(key)
        if plan is None:
            plan = self._plans[key] = self._evaluated(a, b, D)
        return plan

    def _evaluated(self, a: int, b: int, D: Floats) -> MatchingPlan:
        own = self._own_cost(a, b, D)
        plans = [self._children(a, b, D, self._by_name)]
        if plans[0].cost >= 2.0 or plans[0].missing:
            plans.append(self._children(a, b, D, self._by_place))
        # What is written differently is a reason to choose an element, and none to match other joints.
        best = min(plans, key=lambda plan: (round(plan.cost), plan.opposite))
        opposite = best.opposite + (a != ROOT and self._cosine(a, b, D) < 0.0)
        return replace(best, cost=own + best.cost, pairs=(BodyPair(a, b), *best.pairs), opposite=opposite)

    def _children(
        self, a: int, b: int, D: Floats, match: Callable[[int, int, Floats], list[tuple[int, int]]]
    ) -> MatchingPlan:
        matched = match(a, b, D)
        plans = [self._joined(i, j, D) for i, j in matched]
        missing = [i for i in self.ours.children[a] if i not in {i for i, _ in matched}]
        extra = [j for j in self.theirs.children[b] if j not in {j for _, j in matched}]
        lost = sum(_lost(self.ours, self.theirs, i) for i in missing)
        lost += sum(_lost(self.theirs, self.ours, j) for j in extra)
        return MatchingPlan(
            sum(plan.cost for plan in plans) + lost,
            tuple(pair for plan in plans for pair in plan.pairs),
            (*missing, *(i for plan in plans for i in plan.missing)),
            (*extra, *(j for plan in plans for j in plan.extra)),
            sum(plan.opposite for plan in plans),
        )

    # -- children ---------------------------------------------------------------------------------

    def _by_name(self, a: int, b: int, D: Floats) -> list[tuple[int, int]]:
        """Match joints of the same name, then those whose links have the same name, then by place."""
        known = self._named.get((a, b))
        if known is None:
            known = self._named[a, b] = self._matched_names(a, b)
        matched, left, right = known
        return sorted(matched + self._nearest(left, right, D)) if left and right else matched

    def _matched_names(self, a: int, b: int) -> tuple[list[tuple[int, int]], list[int], list[int]]:
        matched: list[tuple[int, int]] = []
        left, right = list(self.ours.children[a]), list(self.theirs.children[b])
        both = self.ours, self.theirs
        for ours, theirs in (
            ([joint.name for joint in each.joints] for each in both),
            ([joint.child for joint in each.joints] for each in both),
            (each.carried_links for each in both),
        ):
            names = {theirs[j]: j for j in right}
            for i in list(left):
                j = names.get(ours[i])
                if j is not None and self._alike(i, j):
                    matched.append((i, j))
                    left.remove(i)
                    right.remove(j)
        return sorted(matched), left, right

    def _by_place(self, a: int, b: int, D: Floats) -> list[tuple[int, int]]:
        return sorted(self._nearest(self.ours.children[a], self.theirs.children[b], D))

    def _nearest(self, left: list[int], right: list[int], D: Floats) -> list[tuple[int, int]]:
        """Match joints that are nearest; among those equally near, the ones whose axes have the same sign,
        then those with the same limits, then the first in document order."""
        same = min(max(10.0 * self.tolerance, ROUNDING), NEARLY)
        pairs = sorted(
            # Symmetric fingers are equally near to both of their kind, but for rounding.
            (round(self._distance(i, j, D) / same), *self._apart(i, j, D), i, j)
            for i in left
            for j in right
            if self._alike(i, j)
        )
        matched: dict[int, int] = {}
        for *_, i, j in pairs:
            if i not in matched and j not in matched.values():
                matched[i] = j
        return list(matched.items())

    def _apart(self, i: int, j: int, D: Floats) -> tuple[bool, int]:
        """Return whether the axes of two joints are opposite, and how many of their limits differ then."""
        followed = inverse(self.ours.placements[i]) @ D @ self.theirs.placements[j]
        opposite = self._cosine(i, j, followed) < 0.0
        limits = self.ours.joints[i].limits, self.theirs.joints[j].limits
        return opposite, len(list(limit_differences(*limits, -1 if opposite else 1, self.tolerance)))

    def _alike(self, i: int, j: int) -> bool:
        return self.ours.kinds[i] == self.theirs.kinds[j]

    def _distance(self, i: int, j: int, D: Floats) -> float:
        """Return how far apart two joints of matched parents are, relative to the size of the robot."""
        T, axis = D @ self.theirs.placements[j], self.theirs.axes[j]
        mine, my_axis = self.ours.placements[i], self.ours.axes[i]
        direction, mine_direction = T[:3, :3] @ axis, mine[:3, :3] @ my_axis
        offset = T[:3, 3] - mine[:3, 3]
        kind = self.ours.kinds[i]
        if kind == "revolute":
            offset = cross(offset, mine_direction)
        sizes = abs(self.ours.sizes[i] - self.theirs.sizes[j])
        sine = 0.0 if kind == "ball" else float(np.linalg.norm(cross(direction, mine_direction)))
        mass = abs(float(self.ours.inertias[i].mass - self.theirs.inertias[j].mass))
        total = abs(float(self.ours.inertias[i].mass)) + abs(float(self.theirs.inertias[j].mass)) or 1.0
        roles = (self.ours.joints[i].mimic is None) != (self.theirs.joints[j].mimic is None)
        followed = inverse(mine) @ T
        own = min(self._own_cost(i, j, D) for D in self._free_frames(i, j, followed))
        apart = float(np.linalg.norm(offset)) / self.length + sine
        return apart + sizes + 0.1 * mass / total + 0.5 * roles + 0.2 * own

    def _cosine(self, a: int, b: int, D: Floats) -> float:
        """Return the cosine of the angle between the axes of two bodies; 1 for ball joints."""
        if self.ours.kinds[a] == "ball":
            return 1.0
        return float(D[:3, :3] @ self.theirs.axes[b] @ self.ours.axes[a])

    def _key(self, a: int, b: int, D: Floats) -> Key:
        """Return what names two bodies with the frames D; frames of one name differ by less than counts."""
        return a, b, np.round(D[:3] * self._per_length, self._digits).tobytes()

    # -- elements ---------------------------------------------------------------------------------

    def _own_cost(self, a: int, b: int, D: Floats) -> float:
        """Return how many elements must be replaced for the axes and inertias of two bodies to coincide."""
        key = self._key(a, b, D)
        cost = self._own_costs.get(key)
        if cost is None:
            cost = 0.0 if a == ROOT else self._axis_cost(a, b, D)
            if self._observes(a) and not self._has_same_inertia(a, b, D):
                cost += self._inertia_cost(a, b, D)
            self._own_costs[key] = cost
        return cost

    def _inertia_cost(self, a: int, b: int, D: Floats) -> float:
        """Return how many inertias of links must be replaced for those of two bodies to coincide."""
        one = _cost(self._has_equal_inertials(a, b))
        mine, other = self.ours.heavy_links[a], self.theirs.heavy_links[b]
        if len(mine) == 1 or mine.keys() != other.keys():
            # What is split otherwise is replaced as a whole.
            return one
        differing = 0
        for name, inertia in mine.items():
            difference = subtract(inertia, transformed(other[name], D))
            differing += inertia_ratio(difference, inertia, self.ours.whole) > self.tolerance
        return max(differing, 1) * one

    def _axis_cost(self, a: int, b: int, D: Floats) -> float:
        """Return how many elements must be replaced for the joint axes of two bodies to coincide."""
        if self.ours.kinds[a] == "ball":
            # Where the centre is elsewhere, the joint is moved and what is attached to its link moved back.
            away = float(np.linalg.norm(D[:3, 3])) > self.tolerance * self.length
            return 1.0 + attachments(self.theirs, b) if away else 0.0
        axis, mine = D[:3, :3] @ self.theirs.axes[b], self.ours.axes[a]
        cost = 0.0
        if float(np.linalg.norm(cross(axis, mine))) > self.tolerance:
            cost = _cost(self.ours.joints[a].axis == self.theirs.joints[b].axis)
        if self._is_beside(a, b, D):
            # The joint must be moved and what is attached to its link moved back.
            cost += _cost(self._has_equal_origins(a, b)) + attachments(self.theirs, b)
        return cost

    def _is_beside(self, a: int, b: int, D: Floats) -> bool:
        """Check whether the axis of body b on a revolute joint passes beside that of body a."""
        if self.ours.kinds[a] != "revolute":
            return False
        off = float(np.linalg.norm(cross(D[:3, 3], self.ours.axes[a])))
        return off > self.tolerance * self.length

    def _place_cost(self, a: int, b: int, D: Floats) -> float:
        """Return the cost of a joint's place for the frames D, unless it has that of its axis already."""
        return 0.0 if self._is_beside(a, b, D) else _cost(self._has_equal_origins(a, b))

    def _observes(self, a: int) -> bool:
        return a != ROOT or self.ours.model.floating

    def _is_unmoved(self, a: int, b: int) -> bool:
        """Check whether two bodies are nearly the same in the frames as they are: these are then the frames,
        and what differs is rounding of a file or a difference."""
        known = self._unmoved.get((a, b))
        if known is None:
            mine, other = self.ours.inertias[a], self.theirs.inertias[b]
            known = inertia_ratio(subtract(mine, other), mine, self.ours.whole) < NEARLY
            if a != ROOT:
                turned = np.abs(self.ours.axes[a] - self.theirs.axes[b])
                known = known and self._are_placed_alike(a, b) and float(np.max(turned)) < NEARLY
            else:
                # A body of nearly equal moments looks the same in any frame; its joints do not.
                children = self.theirs.children[b]
                known = known and all(
                    any(self._alike(i, j) and self._are_placed_alike(i, j, axes=True) for j in children)
                    for i in self.ours.children[a]
                )
            self._unmoved[a, b] = known
        return known

    def _are_placed_alike(self, i: int, j: int, *, axes: bool = False) -> bool:
        """Check whether two joints have nearly the same place in their parents; or, with `axes`, the same
        axis, which may be opposite, or the same centre."""
        T, S = self.ours.placements[i], self.theirs.placements[j]
        if not axes:
            return float(np.max(np.abs((T - S)[:3] * self._per_length))) < NEARLY
        offset, sine, kind = (S - T)[:3, 3] / self.length, 0.0, self.ours.kinds[i]
        if kind != "ball":
            direction, other = T[:3, :3] @ self.ours.axes[i], S[:3, :3] @ self.theirs.axes[j]
            sine = float(np.linalg.norm(cross(direction, other)))
            offset = cross(offset, direction) if kind == "revolute" else np.zeros(3)
        return max(float(np.linalg.norm(offset)), sine) < NEARLY

    def _fits_turned(self, a: int, b: int) -> bool:
        """Check whether two bodies that are nearly the same in the frames as they are fit in other frames, in
        which more of their joints fit too: these are then the frames, slightly turned or moved."""
        known = self._turned_fits.get((a, b))
        if known is None:
            least = self._bound(a, b, np.eye(4))
            known = least > 0.0 and any(
                self._is_near(D) and self._own_cost(a, b, D) == 0.0 and self._bound(a, b, D) <= least - 1.0
                for D in islice(self._candidates_of(a, b), MAX_TURNED)
            )
            self._turned_fits[a, b] = known
        return known

    def _is_near(self, D: Floats) -> bool:
        """Check whether a frame is slightly turned or moved."""
        return float(np.max(np.abs((D - np.eye(4))[:3] * self._per_length))) <= NEARLY

    def _has_equal_origins(self, a: int, b: int) -> bool:
        return are_alike(self.ours.joints[a].origin, self.theirs.joints[b].origin)

    def _has_equal_inertials(self, a: int, b: int) -> bool:
        """Check whether the links of two bodies are written with the same inertials."""
        known = self._equal_inertials.get((a, b))
        if known is None:
            mine, other = (
                {each.model.links[k].name: each.model.links[k].inertial for k in each.links[body]}
                for each, body in ((self.ours, a), (self.theirs, b))
            )
            known = self._equal_inertials[a, b] = mine.keys() == other.keys() and all(
                are_alike(inertial, other[name]) for name, inertial in mine.items()
            )
        return known

    def _has_same_inertia(self, a: int, b: int, D: Floats) -> bool:
        """Check whether two bodies have the same inertia but for what may belong to their parents."""
        mine = self.ours.inertias[a]
        if self._has_other_center(a, b, D):
            return False
        if self._has_whole_inertia(a, b, D):
            return True
        if a == ROOT or self._has_equal_inertials(a, b):
            # What is written alike and differs here is in another frame.
            return False
        difference = subtract(mine, transformed(self.theirs.inertias[b], D))
        unshared = self.ours.unshared(a, difference)
        return inertia_ratio(unshared, mine, self.ours.whole) <= self.tolerance

    def _has_whole_inertia(self, a: int, b: int, D: Floats) -> bool:
        """Check whether two bodies have the same inertia."""
        mine = self.ours.inertias[a]
        difference = subtract(mine, transformed(self.theirs.inertias[b], D))
        return inertia_ratio(difference, mine, self.ours.whole) <= self.tolerance

    def _has_other_center(self, a: int, b: int, D: Floats) -> bool:
        """Check whether mass or first moment differ already, which takes a tenth of the time of all."""
        mine, other = self.ours.inertias[a], self.theirs.inertias[b]
        mass = float(mine.mass)
        if mass == 0.0:
            return False
        size = self._sizes.get(a)
        if size is None:
            size = self._sizes[a] = extent(mine, self.ours.whole)
        limit = self.tolerance * abs(mass) * size
        offset = mine.first_moment - D[:3, :3] @ other.first_moment - other.mass * D[:3, 3]
        kind = None if a == ROOT or self._has_equal_inertials(a, b) else self.ours.kinds[a]
        if kind == "ball":
            # The mass may belong to the parent.
            return bool(np.linalg.norm(offset) > (1.0 + MARGIN) * limit)
        if kind == "revolute":
            # The mass, and what it has along the axis, may belong to the parent.
            axis = self.ours.axes[a]
            return bool(np.linalg.norm(offset - axis * (axis @ offset)) > (1.0 + MARGIN) * limit)
        excess = mass - float(other.mass)
        if abs(excess) > (1.0 + MARGIN) * self.tolerance * abs(mass):
            return True
        offset = offset - excess * (mine.first_moment / mass)
        return bool(np.linalg.norm(offset) > (1.0 + MARGIN) * limit)


def _first_two(entry: tuple[Any, ...]) -> tuple[float, int]:
    return entry[0], entry[1]


def _first_three(entry: tuple[Any, ...]) -> tuple[float, int, int]:
    return entry[0], entry[1], entry[2]


def _preference(plan: MatchingPlan, misplaced: int) -> tuple[float, int, int]:
    """Return the order of preference of plans with other frames of a free body, the lowest first: fewer
    elements, then less that is misplaced, then fewer opposite axes."""
    cost, opposite = plan.rank
    return cost, misplaced, opposite


def _is_identity(T: Floats) -> bool:
    return float(np.max(np.abs(T - np.eye(4)))) < 1e-12


def _lost(skeleton: Skeleton, other: Skeleton, body: int) -> float:
    """Return the cost of a body without counterpart and of all below it. If the other robot has a joint of
    that name, both are one subtree at another place, whose halves cost 1 each."""
    known = other.number.get(skeleton.joints[body].name)
    if known is not None and skeleton.kinds[body] == other.kinds[known]:
        return 1.0
    return 2.0 * skeleton.sizes[body]


def _cost(unchanged: bool) -> float:
    return UNCHANGED if unchanged else 1.0


def attachments(skeleton: Skeleton, body: int) -> int:
    """Count what is attached to the child link of a body's joint: its inertia, and joints.

    A link without mass on a joint beside a fixed one has nothing but that joint, which moves with the joint.
    One that a reader makes has nothing: MJCF states points of joints in the body.
    """
    joint = skeleton.joints[body]
    joints = [each for each in skeleton.model.joints if each.parent == joint.child]
    inertial = skeleton.model.inertial(joint.child)
    heavy = bool(inertial.mass or inertial.tensor.any())
    if not heavy and len(joints) == 1 and not joints[0].moves:
        return 0
    return 0 if is_of_reader(skeleton.model, joint) else heavy + len(joints)

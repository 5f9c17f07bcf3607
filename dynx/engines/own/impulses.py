"""Impulses of contacts, constraints, joint limits and dry friction on parts that touch, in one step.

An *island* is a set of robots and bodies that contacts and constraints connect; each has a problem of its own
(`dynx.rbd.constraints`). A contact has a normal row, two tangents, and rows of torsional and rolling
friction where its coefficients are above zero. All rows act at the middle of the two points, so that forces
on both bodies are opposite.

**Points.** Of two faces with many vertices four contact points are chosen (`dynx.distance.contact_points`).
Where a load leans beyond them, the step is solved again with the spare points that would overlap.

**Gaps.** A contact whose gap phi may close in the step has the normal velocity w >= -phi / h: bodies touch at
the end of the step, not beyond. Where they overlap, w >= 0. A displacement without velocity takes back a part
of each overlap, and each error of a constraint (`dynx.rbd.constraints`).

**Impacts.** A contact with restitution that closes in the step meets at the fraction s of it, with the
velocity that the free motion has then. Its coefficient of restitution is reduced to the ratio of this
velocity to that of the end of the step: a body at rest has 0, needs no threshold, and remains at rest; one
that bounces gains no energy from the gravity of the rest of the step. The impact acts on velocities; the
displacement of the step ends where the gap closes.

**Motors** whose law holds at the end of the step add inertia and torque to their joints
(`dynx.engines.own.end_motors`). Where the velocities at the end need more than the largest torque of a motor,
or less at its limit, the step is solved again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.engines.own.parts import OwnRobot
from dynx.engines.own.touching import MARGIN, REACH, PossibleContact
from dynx.rbd.constraints import (
    ATTEMPTS,
    COMPLIANCES,
    MAX_CORRECTION_SPEED,
    MAX_DISPLACEMENT_SPEED,
    NEGLIGIBLE,
    TOLERANCE,
    VIOLATED_COMPLIANCE,
    ConstraintSets,
    Disk,
    Solution,
    displacement_velocity,
    opening_velocity,
    rebound,
    solve,
)
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, quat_from_rotation, quat_log, skew
from dynx.steppers.layout import ConstraintLayout, Owner

NEGLIGIBLE_CLOSING = 1e-10
"""Speed [m/s] against a spare contact point up to which the others bear the load without it."""

NEGLIGIBLE_REBOUND = 1e-9
"""Speed after an impact [m/s] that counts as none."""

MAX_RESIDUAL = 1e-6
"""Residual of the impulses [m/s or rad/s] above which a step counts as not solved."""

UNMET = 0.1
"""Share of the wanted change of an error from which what remains of it is noted."""

STUCK = 1e-9
"""Velocity [rad/s or m/s] of a joint that sticks by dry friction, which is rounding."""

Key = tuple[int, int, int, int, int]
"""Origin of an impulse: its kind, then two shapes and their features, or part, joint and side, or the number
of the constraint, and zeros."""

CONTACT, LIMIT, DRY, CONSTRAINT = range(4)
"""Kinds of keys."""

WarmStart = dict[Key, Floats]
"""Impulses (8,) of the step before: of a contact the normal impulse, friction (3,), torsion and rolling
moment (3,) in axes of the world; of others their rows, then zeros."""

NO_ROWS = np.zeros(0)


class TouchImpulse(NamedTuple):
    """Impulses of one contact in a step, on its first body, in axes of the world."""

    contact: PossibleContact
    normal: float
    """Along the normal [N s]."""
    friction: Floats
    """Perpendicular to it (3,) [N s]."""


@lru_cache(maxsize=256)
def _sets(kinds: tuple[tuple[bool, bool, bool], ...], limits: int, dry: int, free: int) -> ConstraintSets:
    """Return the sets of contacts, with or without friction, torsional and rolling friction, and of further
    rows."""
    unilateral: list[int] = []
    disks: list[Disk] = []
    row = 0
    for kind in kinds:
        normal = row
        unilateral.append(normal)
        row += 1
        for present, size in zip(kind, (2, 1, 2), strict=True):
            if present:
                disks.append(Disk(tuple(range(row, row + size)), normal))
                row += size
    unilateral += range(row, row + limits)
    row += limits
    disks += [Disk((k,)) for k in range(row, row + dry)]
    row += dry
    return ConstraintSets(row + free, tuple(unilateral), tuple(disks), tuple(range(row, row + free)))


class Island:
    """Parts that contacts and constraints connect, in one step of length `h` [s].

    `parts` are robots and bodies by number, `part_of` the number of the part of each owner that moves;
    `poses` (4, 4) and `jacobians` (6, nv) are those of the owners.
    """

    def __init__(
        self,
        h: float,
        parts: Mapping[int, OwnRobot],
        part_of: Mapping[Owner, int],
        contacts: Sequence[PossibleContact],
        constraints: Mapping[int, ConstraintLayout],
        poses: Mapping[Owner, Floats],
        jacobians: Mapping[Owner, Floats],
    ) -> None:
        self._h, self._part_of = h, part_of
        self.parts = parts
        self._pairs = [each.pair for each in contacts]
        self._constraints = constraints
        self.contacts = contacts
        """Points that may touch in the step, and later those at which impulses act."""
        self._poses, self._jacobians = poses, jacobians
        self._columns: dict[int, slice] = {}
        first = 0
        for number, part in parts.items():
            self._columns[number] = slice(first, first + part.nv)
            first += part.nv
        self._nv = first
        self.residual = 0.0
        """Largest residual of the impulses [m/s or rad/s]."""
        self.contradiction: tuple[Key, ...] = ()
        """Contacts, joint limits and constraints whose overlaps and errors contradict each other, one or two
        of them; empty if the step takes them back."""

    # -- rows ---------------------------------------------------------------------------------

    def _contact_rows(self) -> tuple[Floats, Floats]:
        """Return J (n, 6, nv) of the contacts: normal, two tangents, and rotation about each of these; and
        these directions (n, 3, 3)."""
        contacts = self.contacts
        points = np.array([0.5 * (each.point_a + each.point_b) for each in contacts])
        D = directions(np.array([each.normal for each in contacts]))
        J = np.zeros((len(contacts), 6, self._nv))
        sides: dict[Owner, list[tuple[int, float]]] = {}
        for k, pair in enumerate(self._pairs):
            sides.setdefault(pair.owner_a, []).append((k, 1.0))
            sides.setdefault(pair.owner_b, []).append((k, -1.0))
        for owner, chosen in sides.items():
            if owner not in self._part_of:
                continue
            columns, rates = self._columns[self._part_of[owner]], self._jacobians[owner]
            rows = [k for k, _ in chosen]
            signs = np.array([sign for _, sign in chosen])[:, None, None]
            axes = D[rows] * signs
            levers = points[rows] - self._poses[owner][:3, 3]
            J[rows, :3, columns] += axes @ rates[:3] + cross(levers[:, None, :], axes) @ rates[3:]
            J[rows, 3:, columns] += axes @ rates[3:]
        return J, D

    def _limit_rows(self) -> tuple[list[tuple[int, int, int]], Floats]:
        """Return part, coordinate and side (1 at the lower limit, -1 at the upper one) of each joint limit
        that may be reached in the step, and its gap [rad or m]; 0 for a joint beyond it."""
        rows: list[tuple[int, int, int]] = []
        gaps: list[float] = []
        for number, part in self.parts.items():
            if part.limits is None:
                continue
            n = len(part.limits[0])
            positions, base = part.q[len(part.q) - n :], part.nv - n
            ways = REACH * self._h * (np.abs(part.free[base:]) + np.abs(part.v[base:])) + MARGIN
            for side, limit in ((1, part.limits[0]), (-1, part.limits[1])):
                gap = side * (positions - limit)
                for joint in np.flatnonzero(gap <= ways).tolist():
                    rows.append((number, base + joint, side))
                    gaps.append(max(float(gap[joint]), 0.0))
        return rows, np.array(gaps)

    def _passes_limit(self) -> bool:
        """Check whether the free motion carries a joint beyond a limit, or further beyond it."""
        rows, gaps = self._limit_rows()
        return any(
            side * self.parts[number].free[joint] < -opening_velocity(gap, self._h)
            for (number, joint, side), gap in zip(rows, gaps.tolist(), strict=True)
        )

    def _constraint_rows(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return J (m, nv), biases (m,) [m/s or rad/s], errors (m,) [m or rad] and compliances (m,) of welds
        and points: 6 and 3 rows in axes of the world.

        The bias is the change of J in half a step times the velocity. A step whose velocity v obeys J v plus
        bias = 0 ends where the constraint holds, to the third order in its length. Its impulses are those of
        SHAKE (Ryckaert, Ciccotti and Berendsen, 1977), which is symplectic. With J v = 0 they would take
        energy from every motion along a curve.

        A constraint whose error one step does not take back has no bias, since it does not hold at the end of
        the step either, and is compliant. A contact that contradicts it makes its impulses large, and with
        them a bias would do work.
        """
        blocks, biases, errors = [np.zeros((0, self._nv))], [NO_ROWS], [NO_ROWS]
        compliances = [NO_ROWS]
        v = self._velocity("v")
        for constraint in self._constraints.values():
            size = 3 if constraint.kind == "point" else 6
            first, middle, ends = np.zeros((6, self._nv)), np.zeros((6, self._nv)), []
            for anchor, sign in ((constraint.a, 1.0), (constraint.b, -1.0)):
                owner, pose = anchor.owner, self._poses[anchor.owner]
                ends.append(pose @ anchor.T)
                if owner not in self._part_of:
                    continue
                number = self._part_of[owner]
                part, columns = self.parts[number], self._columns[number]
                first[:, columns] += sign * _anchor_rates(self._jacobians[owner], pose, anchor.T)
                middle[:, columns] += sign * _anchor_rates(
                    part.midpoint_jacobian(owner.body), part.midpoint_pose(owner.body), anchor.T
                )
            turned = quat_log(quat_from_rotation(ends[0][:3, :3] @ ends[1][:3, :3].T))
            error = np.concatenate([ends[0][:3, 3] - ends[1][:3, 3], turned])[:size]
            violated = bool((np.abs(error) > MAX_CORRECTION_SPEED * self._h).any())
            blocks.append(first[:size])
            biases.append(np.zeros(size) if violated else (middle - first)[:size] @ v)
            errors.append(error)
            compliances.append(np.full(size, VIOLATED_COMPLIANCE if violated else 0.0))
        rows = np.concatenate(blocks), np.concatenate(biases)
        return *rows, np.concatenate(errors), np.concatenate(compliances)

    def _velocity(self, of: str) -> Floats:
        """Return the velocities of all parts (nv,): `free` or `v`."""
        return np.concatenate([getattr(part, of) for part in self.parts.values()])

    # -- the step -----------------------------------------------------------------------------

    def step(self, warm: WarmStart) -> tuple[list[TouchImpulse], WarmStart]:
        """Take the step of the parts; return the impulses of the contacts, and those for the next step.

        Where no contact closes or overlaps, no joint passes a limit and nothing is constrained, each part
        completes its free motion.
        """
        h, n = self._h, len(self.contacts)
        rows, D = self._contact_rows() if n else (np.zeros((0, 6, self._nv)), np.zeros((0, 3, 3)))
        gaps = np.array([each.gap for each in self.contacts])
        free = self._velocity("free")
        closes = bool((rows[:, 0] @ free < -np.maximum(gaps, 0.0) / h).any())
        # Overlaps are taken back even where nothing presses the parts together.
        closes |= bool((gaps < -NEGLIGIBLE).any())
        closes = closes or self._passes_limit()
        if not closes and not self._constraints:
            for part in self.parts.values():
                part.finish()
            return [TouchImpulse(each, 0.0, np.zeros(3)) for each in self.contacts if not each.spare], {}
        for part in self.parts.values():
            part.release_dry_friction()
        # Spares that bore a load in the step before are likely to do so again.
        borne = [k for k, each in enumerate(self.contacts) if not each.spare or _bears(warm, each)]
        return self._step_on(borne, self.contacts, rows, D, gaps, warm)

    def _step_on(
        self,
        borne: Sequence[int],
        every: Sequence[PossibleContact],
        all_rows: Floats,
        directions_of_all: Floats,
        all_gaps: Floats,
        warm: WarmStart,
    ) -> tuple[list[TouchImpulse], WarmStart]:
        """Take the step with impulses at some contacts of `every`, by number, and at each other one that
        would close beyond its gap without."""
        h, n = self._h, len(borne)
        self.contacts = [every[k] for k in borne]
        self._pairs = [each.pair for each in self.contacts]
        rows, D, gaps = all_rows[borne], directions_of_all[borne], all_gaps[borne]
        free = self._velocity("free")
        present = np.array([_present(pair.friction) for pair in self._pairs], dtype=np.bool_).reshape(n, 6)
        limits, limit_gaps = self._limit_rows()
        dry = [(k, j) for k, part in self.parts.items() for j in part.dry_joints.tolist()]
        bilateral, biases, errors, compliances = self._constraint_rows()
        units = np.zeros((len(limits) + len(dry), self._nv))
        for row, (number, joint, side) in enumerate(limits):
            units[row, self._columns[number].start + joint] = side
        for row, (number, joint) in enumerate(dry, len(limits)):
            units[row, self._columns[number].start + joint] = 1.0
        J = np.concatenate([rows[present], units, bilateral])
        kinds = tuple((bool(row[1]), bool(row[3]), bool(row[4])) for row in present)
        sets = _sets(kinds, len(limits), len(dry), len(bilateral))
        X = np.concatenate(
            [part.response(J[:, self._columns[number]]) for number, part in self.parts.items()]
        )
        G = J @ X
        G = 0.5 * (G + G.T)
        compliant = _with_compliance(G, sets.free, compliances)
        radii = [
            coefficient for pair in self._pairs for coefficient in pair.friction if coefficient > 0.0
        ] + [h * float(self.parts[number].dry[joint]) for number, joint in dry]
        numbers = np.array(radii)
        keys = self._keys(limits, dry)
        start = self._start(warm, keys, present, D, len(J))
        normals = np.array(sets.unilateral[:n], dtype=np.intp)
        opening = np.zeros(len(J))
        ways = [*gaps.tolist(), *limit_gaps.tolist()]
        opening[list(sets.unilateral)] = [opening_velocity(gap, h) for gap in ways]
        opening[list(sets.free)] = biases
        c = J @ free
        first = solve(sets, compliant, c + opening, numbers, start=start)
        u = free + X @ first.impulses
        if n < len(every):
            short = all_rows[:, 0] @ u < -np.maximum(all_gaps, 0.0) / h - NEGLIGIBLE_CLOSING
            short[borne] = False
            if short.any():
                more = sorted([*borne, *np.flatnonzero(short).tolist()])
                return self._step_on(more, every, all_rows, directions_of_all, all_gaps, warm)
        last = self._impacts(sets, compliant, c, opening, numbers, first, normals, J)
        w = u if last is first else free + X @ last.impulses
        corrected = [part.correct_motors(w[self._columns[number]]) for number, part in self.parts.items()]
        if any(corrected):
            return self._step_on(borne, every, all_rows, directions_of_all, all_gaps, warm)
        self.residual = float(max(first.residuals.largest, last.residuals.largest))
        velocities = first.velocities - opening
        correction = self._correction(sets, G, X, velocities, gaps, limit_gaps, errors, normals, keys)
        displaced = u if correction is None else u + correction
        for number, part in self.parts.items():
            columns = self._columns[number]
            part.finish_at(displaced[columns], self._at_rest(number, w[columns], dry, sets, last, numbers))
        return self._results(last.impulses, keys, present, D)

    def _impacts(
        self,
        sets: ConstraintSets,
        G: Floats,
        c: Floats,
        opening: Floats,
        radii: Floats,
        first: Solution,
        normals: NDArray[np.intp],
        J: Floats,
    ) -> Solution:
        """Return the impulses that determine the velocities at the end: those of `first` without impacts
        that rebound."""
        if not any(pair.restitution > 0.0 for pair in self._pairs):
            return first
        free, begin = c[normals], J[normals] @ self._velocity("v")
        e = np.array([pair.restitution for pair in self._pairs])
        hits = (first.impulses[normals] > 0.0) & (free < 0.0)
        approach = np.where(hits, free, -1.0)
        moment = np.minimum(-opening[normals] / approach, 1.0)
        share = np.clip((begin + moment * (free - begin)) / approach, 0.0, 1.0)
        e = np.where(hits, e * share, 0.0)
        if not (e * np.abs(approach) > NEGLIGIBLE_REBOUND).any():
            return first
        # The impact happens where the gaps are closed.
        closed = opening.copy()
        closed[normals[hits]] = 0.0
        plastic = solve(sets, G, c + closed, radii, start=first.impulses)
        restitution = np.zeros(sets.size)
        restitution[normals] = e
        return rebound(sets, G, c + closed, radii, plastic, restitution)

    def _correction(
        self,
        sets: ConstraintSets,
        G: Floats,
        X: Floats,
        velocities: Floats,
        gaps: Floats,
        limit_gaps: Floats,
        errors: Floats,
        normals: NDArray[np.intp],
        keys: Sequence[Key],
    ) -> Floats | None:
        """Return the velocity (nv,) of the displacement that takes back a part of overlaps and errors of
        constraints, and keep what contradicts them; None where there are none."""
        h = self._h
        overlaps = bool((gaps < -NEGLIGIBLE).any())
        if not overlaps and not (np.abs(errors) > NEGLIGIBLE).any():
            return None
        wanted = np.zeros(sets.size)
        pairs = zip(gaps.tolist(), velocities[normals].tolist(), strict=True)
        wanted[normals] = [displacement_velocity(gap, w, h) for gap, w in pairs]
        rows = list(sets.unilateral[len(normals) :])
        wanted[rows] = np.maximum(limit_gaps / h + velocities[rows], 0.0)
        wanted[list(sets.free)] = np.clip(errors / h, -MAX_CORRECTION_SPEED, MAX_CORRECTION_SPEED)
        # Without friction its rows have no impulses, and most of the problem is gone.
        part = [*sets.unilateral, *sets.free]
        count = len(sets.unilateral)
        smaller = ConstraintSets(len(part), tuple(range(count)), free=tuple(range(count, len(part))))
        tolerance = max(TOLERANCE, 0.1 * NEGLIGIBLE / h)
        found = solve(
            smaller, G[np.ix_(part, part)], wanted[part], NO_ROWS, tolerance=tolerance, attempts=ATTEMPTS[:3]
        )
        displacement: Floats = X[:, part] @ found.impulses
        # Overlaps alone are taken back as in compiled steps (`dynx.rbd.contact_step`), however fast.
        fast = bool(self._constraints) and self._is_fast(displacement)
        if float(found.residuals.largest) <= MAX_RESIDUAL and not fast:
            return displacement
        # Overlaps may not grow by the displacement, but need not be taken back.
        deep = np.flatnonzero(wanted[part[:count]] < 0.0)
        hard = wanted[part[:count]]
        hard[deep] = np.maximum(velocities[np.array(part, dtype=np.intp)[deep]], 0.0)
        rows = [*part[:count], *np.array(part, dtype=np.intp)[deep].tolist(), *sets.free]
        lower = np.concatenate([hard, wanted[rows[count:]]])
        unilateral = count + len(deep)
        larger = ConstraintSets(len(rows), tuple(range(unilateral)), free=tuple(range(unilateral, len(rows))))
        for compliance in COMPLIANCES:
            soft = np.full(len(rows) - count, compliance)
            matrix = _with_compliance(G[np.ix_(rows, rows)], range(count, len(rows)), soft)
            found = solve(larger, matrix, lower, NO_ROWS, tolerance=tolerance, attempts=ATTEMPTS[:3])
            displacement = X[:, rows] @ found.impulses
            if not self._is_fast(displacement):
                break
        taken = np.zeros(sets.size)
        np.add.at(taken, rows, found.impulses)
        names: list[Key] = [self._group(keys[k]) for k in range(count)]
        for key in keys[len(keys) - len(self._constraints) :]:
            names += [key] * self._rows_of(key[1])
        self._keep_contradiction(G[np.ix_(part, part)], taken[part], wanted[part], names, deep)
        return displacement

    def _keep_contradiction(
        self, G: Floats, impulses: Floats, wanted: Floats, names: Sequence[Key], deep: NDArray[np.intp]
    ) -> None:
        """Keep what opposes most the overlap or error of which most remains, in a displacement by impulses
        (m,) on rows (m,) that `names` belong to."""
        remaining = wanted + G @ impulses
        rows: dict[Key, list[int]] = {}
        for row, name in enumerate(names):
            rows.setdefault(name, []).append(row)
        errors = [*deep.tolist(), *(row for row, name in enumerate(names) if name[0] == CONSTRAINT)]
        worst: tuple[float, Key] | None = None
        for name, group in rows.items():
            chosen = [row for row in group if row in errors]
            unmet = float(np.linalg.norm(remaining[chosen]))
            if unmet > UNMET * float(np.linalg.norm(wanted[chosen])) and (worst is None or unmet > worst[0]):
                worst = unmet, name
        if worst is None:
            return
        own = [row for row in rows[worst[1]] if row in errors]
        opposing = {
            name: float(remaining[own] @ G[np.ix_(own, group)] @ impulses[group])
            for name, group in rows.items()
            if name != worst[1]
        }
        strongest = max(opposing, key=opposing.__getitem__, default=None)
        if strongest is not None and opposing[strongest] > 0.0:
            self.contradiction = worst[1], strongest

    def _is_fast(self, displacement: Floats) -> bool:
        """Check whether a displacement at the velocity (nv,) moves any part faster than one may."""
        speeds = (part.mean_speeds(displacement[self._columns[k]]) for k, part in self.parts.items())
        return not all(bool((each <= MAX_DISPLACEMENT_SPEED).all()) for each in speeds)

    def _at_rest(
        self,
        number: int,
        w: Floats,
        dry: Sequence[tuple[int, int]],
        sets: ConstraintSets,
        found: Solution,
        radii: Floats,
    ) -> Floats:
        """Return the velocity of a part, in which joints that stick by dry friction have none."""
        held = [
            joint
            for (part, joint), disk, radius in zip(
                dry, sets.disks[len(sets.disks) - len(dry) :], radii[len(radii) - len(dry) :], strict=True
            )
            if part == number and abs(found.impulses[disk.rows[0]]) < radius and abs(w[joint]) < STUCK
        ]
        if held:
            w = w.copy()
            w[held] = 0.0
        return w

    # -- warm start ---------------------------------------------------------------------------

    def _keys(self, limits: Sequence[tuple[int, int, int]], dry: Sequence[tuple[int, int]]) -> list[Key]:
        keys: list[Key] = [(CONTACT, each.pair.a, each.pair.b, *each.feature) for each in self.contacts]
        keys += [(LIMIT, *each, 0) for each in limits]
        keys += [(DRY, *each, 0, 0) for each in dry]
        return keys + [(CONSTRAINT, number, 0, 0, 0) for number in self._constraints]

    def _start(
        self, warm: WarmStart, keys: Sequence[Key], present: NDArray[np.bool_], D: Floats, size: int
    ) -> Floats:
        """Return the impulses (m,) of the step before, zero where there is none."""
        n, values = len(D), np.zeros((len(keys), 8))
        for k, key in enumerate(keys):
            if key in warm:
                values[k] = warm[key]
        of_contacts = np.zeros((n, 6))
        of_contacts[:, 0], of_contacts[:, 3] = values[:n, 0], values[:n, 4]
        of_contacts[:, 1:3] = np.einsum("kij,kj->ki", D[:, 1:], values[:n, 1:4])
        of_contacts[:, 4:6] = np.einsum("kij,kj->ki", D[:, 1:], values[:n, 5:8])
        single = len(keys) - len(self._constraints)
        others = [values[k, : self._rows_of(number)] for k, number in enumerate(self._constraints, single)]
        start = np.concatenate([of_contacts[present], values[n:single, 0], *others])
        assert len(start) == size
        return start

    def _group(self, key: Key) -> Key:
        """Return one key for all contact points of two shapes, and the key itself for anything else."""
        return (*key[:3], 0, 0) if key[0] == CONTACT else key

    def _rows_of(self, constraint: int) -> int:
        return 3 if self._constraints[constraint].kind == "point" else 6

    def _results(
        self, impulses: Floats, keys: Sequence[Key], present: NDArray[np.bool_], D: Floats
    ) -> tuple[list[TouchImpulse], WarmStart]:
        n, taken = len(D), int(present.sum())
        values = np.zeros((len(keys), 8))
        of_contacts = np.zeros((n, 6))
        of_contacts[present] = impulses[:taken]
        values[:n, 0], values[:n, 4] = of_contacts[:, 0], of_contacts[:, 3]
        values[:n, 1:4] = np.einsum("kij,ki->kj", D[:, 1:], of_contacts[:, 1:3])
        values[:n, 5:8] = np.einsum("kij,ki->kj", D[:, 1:], of_contacts[:, 4:6])
        single = len(keys) - len(self._constraints)
        values[n:single, 0] = impulses[taken : taken + single - n]
        row = taken + single - n
        for k, number in enumerate(self._constraints, single):
            size = self._rows_of(number)
            values[k, :size] = impulses[row : row + size]
            row += size
        touches = [
            TouchImpulse(contact, float(values[k, 0]), values[k, 1:4])
            for k, contact in enumerate(self.contacts)
        ]
        return touches, dict(zip(keys, values, strict=True))


def _with_compliance(G: Floats, rows: Sequence[int], compliances: Floats) -> Floats:
    """Return G (m, m) with compliances of some rows, in multiples of their entries on the diagonal."""
    if not compliances.any():
        return G
    matrix: Floats = G.copy()
    matrix[rows, rows] *= 1.0 + compliances
    return matrix


def _bears(warm: WarmStart, contact: PossibleContact) -> bool:
    """Check whether a contact had a normal impulse in the step before."""
    found = warm.get((CONTACT, contact.pair.a, contact.pair.b, *contact.feature))
    return found is not None and bool(found[0] > 0.0)


def _present(friction: tuple[float, float, float]) -> list[bool]:
    """Return which rows a contact has: normal, two tangents, rotation about the normal and the tangents."""
    sliding, torsion, rolling = (each > 0.0 for each in friction)
    return [True, sliding, sliding, torsion, rolling, rolling]


def directions(normals: Floats) -> Floats:
    """Return unit vectors (n, 3, 3): each normal, and two tangents that complete it."""
    axes = np.zeros_like(normals)
    across = np.abs(normals[:, 0]) > 0.6
    axes[:, 0], axes[:, 1] = ~across, across
    first = cross(normals, axes)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([normals, first, cross(normals, first)], axis=1)


def _anchor_rates(jacobian: Floats, pose: Floats, anchor: Floats) -> Floats:
    """Return J (6, nv) of a frame (4, 4) of a body, from the Jacobian of the body's origin and its pose."""
    lever = pose[:3, :3] @ anchor[:3, 3]
    return np.concatenate([jacobian[:3] - skew(lever) @ jacobian[3:], jacobian[3:]])

"""Impulses of contacts, joint limits, dry friction and bilateral constraints in one step, for any scalar.

The constraints of a step are m *rows*, each a velocity w of the step's end that an impulse x changes:
w = c + G x, with the velocities c (m,) without impulses and the Delassus matrix G = J A^-1 J' (m, m), which
is symmetric and positive semidefinite. Every row belongs to one of three kinds of sets.

- *Unilateral*: x >= l, w >= 0, (x - l) w = 0. The normal of a contact and a joint limit have l = 0.
- *Disk*: one or two rows with |x| <= r. Where |x| < r they stick, w = 0; else w = -s x with s >= 0, which is
  the largest dissipation. The radius r is constant (dry friction of a joint), or a coefficient times the
  impulse of a unilateral row: a circular Coulomb cone, torsional friction, rolling friction.
- *Free*: w = 0 for any x: welds, points, joint couplings.

This is the nonlinear complementarity problem of Signorini and Coulomb, without relaxation: contacts that
slide do not separate (Le Lidec et al., Contact models in robotics: a comparative analysis, 2023). A
speculative contact, whose gap phi may close in the step of length h, has c + phi / h in place of c.

**Overlaps** are taken back by a displacement without velocity, so that errors of positions make no kinetic
energy: parts that overlap may not close further, and the displacement of the step is that of the velocities
plus that of further impulses, without friction, which end a part of each overlap (`displacement_velocity`).

**Contradictions.** A weld may pull a body into the part that it touches. Near such places the displacement
that meets all rows is long: the whole robot turns for millimetres of one error. Beyond them there is none.
Where it would be faster than `MAX_DISPLACEMENT_SPEED` in an island with constraints, or does not exist,
errors are *compliant*: a row of a compliance s has w + s g x = 0 in place of w = 0. Then the displacement
minimises its kinetic energy plus that of what remains of the errors, and where errors and contacts balance it
is zero.

**Sweeps** (projected Gauss-Seidel) visit one set after the other: x becomes the point of the set closest to
x - w / g, with the largest eigenvalue g of the set's block of G. A fixed point is a solution. One sweep is
text for any scalar; kernels have sweeps of their own (`dynx.rbd.block_sweeps`), with the same law.
Sweeps converge linearly, and slowly where a heavy body rests on a light one.

**Newton's method** ends what sweeps begin, on floats: the conditions above are equations F(x) = 0 with
F = g (x - projection of x - w / g) in m/s, which are piecewise smooth (Alart and Curnier, A mixed formulation
for frictional contact problems prone to Newton like solution methods, 1991). Redundant contacts make its
matrix singular; a small multiple of g on its diagonal, which falls with F (Levenberg and Marquardt), selects
the impulses closest to the ones before, as proximal methods do (Carpentier, Le Lidec and Montaut, From
compliant to rigid contact simulation: a unified and efficient approach, 2024).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from dynx.spatial.scalar import FLOAT64_EPS, Array, Floats, less, maximum, minimum, select, sqrt

TINY = 1e-300
"""Term that keeps quotients finite where both numbers are zero."""

CORRECTION = 0.2
"""Part of an overlap that one step takes back; of an error of a constraint it takes back all."""

MAX_CORRECTION_SPEED = 1.0
"""Largest speed [m/s or rad/s] at which a step takes back an overlap or an error of a constraint."""

MAX_DISPLACEMENT_SPEED = 2.0
"""Largest root of the mean square speed [m/s] of what a coordinate moves in a displacement that takes back
errors. It is above that of a body whose errors along three axes have `MAX_CORRECTION_SPEED`."""

COMPLIANCES = (1e-2, 1e-1, 1.0, 10.0, 100.0)
"""Compliances of errors that contradict others, of which the first that makes no displacement too fast is
taken."""

VIOLATED_COMPLIANCE = 1e-3
"""Compliance of the velocities of a constraint whose error takes several steps to take back. It is a damper,
so that impulses have a bound where a contact contradicts the constraint, and take energy."""

NEGLIGIBLE = 1e-10
"""Overlap and error of a constraint [m or rad] that count as none."""


def opening_velocity(gap: Any, h: float) -> Any:
    """Return the velocity [m/s or rad/s] that a gap [m or rad] adds to a unilateral row, for any scalar.

    Gaps of parts that touch are rounding. With them the points of a face would have no common solution, and
    the impulses would jump from three points to others in every step.
    """
    return select(less(NEGLIGIBLE, gap), gap / h, 0.0)


def displacement_velocity(gap: Any, w: Any, h: float) -> Any:
    """Return the velocity of a unilateral row that the displacement of a step makes at least 0.

    `w` is the velocity of the row at the end of the step, without the part of its gap, for any scalar. Where
    parts overlap, the step moves apart by `CORRECTION` of the overlap beside that; elsewhere it may close the
    gap and no more.
    """
    back = maximum(gap * (CORRECTION / h), -MAX_CORRECTION_SPEED) + maximum(w, 0.0)
    return select(less(gap, 0.0), back, gap / h + w)


class Disk(NamedTuple):
    """One or two rows of friction."""

    rows: tuple[int, ...]
    normal: int | None = None
    """Unilateral row whose impulse is multiplied by the limit; None where the limit is the radius itself."""


@dataclass(frozen=True)
class ConstraintSets:
    """Sets to which the m rows of a step belong, each row to one.

    Numbers that may differ from step to step are arguments beside it: `limits` has an entry for each disk, a
    coefficient of friction or a radius.
    """

    size: int
    """Number m of rows."""
    unilateral: tuple[int, ...] = ()
    disks: tuple[Disk, ...] = ()
    free: tuple[int, ...] = ()

    @cached_property
    def visits(self) -> tuple[tuple[str, int], ...]:
        """Kind and number of each set in the order of a sweep: free rows and disks of constant radius, then
        each unilateral row with its disks."""
        first = [("free", row) for row in self.free]
        first += [("disk", k) for k, disk in enumerate(self.disks) if disk.normal is None]
        for row in self.unilateral:
            first.append(("unilateral", row))
            first += [("disk", k) for k, disk in enumerate(self.disks) if disk.normal == row]
        return tuple(first)


class Residuals(NamedTuple):
    """Largest violation of each condition by impulses and the velocities that belong to them [m/s, or rad/s
    for a row of rotation]."""

    gap: Any
    """Velocity against a unilateral row: of a contact that still closes beyond its gap."""
    complementarity: Any
    """Smaller of velocity and impulse of a unilateral row, the latter times its entry of G."""
    friction: Any
    """Distance of a disk's impulse from the one of largest dissipation, times its part of G."""
    cone: Any
    """Impulse outside of its disk, times its part of G."""
    free: Any
    """Velocity of a free row."""

    @property
    def largest(self) -> Any:
        """Largest of them."""
        most = self[0]
        for each in self[1:]:
            most = maximum(most, each)
        return most


class Solution(NamedTuple):
    """Impulses of a step."""

    impulses: Array
    """x (m,) [N s or N m s]."""
    velocities: Array
    """w = c + G x (m,) [m/s or rad/s]."""
    residuals: Residuals
    iterations: int
    """Number of sweeps and of Newton's steps together."""


def scales(sets: ConstraintSets, G: Array) -> list[Any]:
    """Return for each row the largest eigenvalue of its set's block of G, for any scalar."""
    found: list[Any] = [G[i, i] + TINY for i in range(sets.size)]
    for disk in sets.disks:
        if len(disk.rows) == 2:
            i, j = disk.rows
            found[i] = found[j] = largest_eigenvalue(G[i, i], G[j, j], G[i, j]) + TINY
    return found


def largest_eigenvalue(a: Any, b: Any, c: Any) -> Any:
    """Return the largest eigenvalue of the symmetric matrix with the diagonal a, b and the entry c, for any
    scalar."""
    half = 0.5 * (a - b)
    return 0.5 * (a + b) + root(half * half + c * c)


def sweep(
    sets: ConstraintSets,
    G: Array,
    g: Sequence[Any],
    limits: Sequence[Any] | Array,
    floors: Sequence[Any] | Array,
    impulses: Array,
    velocities: Array,
) -> tuple[Array, Array, Any]:
    """Visit every set once; return impulses (m,), velocities (m,) and the largest change [m/s], for any
    scalar.

    `g` are the `scales`, `limits` the numbers of the disks, and `floors` (m,) the least impulses of the
    unilateral rows, which other rows ignore. The change is that of an impulse times its scale.
    """
    x: list[Any] = list(impulses)
    w, change = velocities, 0.0

    def apply(row: int, new: Any) -> None:
        nonlocal w, change
        step = new - x[row]
        x[row] = new
        w = w + G[:, row] * step
        change = maximum(change, abs(step) * g[row])

    for kind, number in sets.visits:
        if kind == "free":
            apply(number, x[number] - w[number] / g[number])
        elif kind == "unilateral":
            apply(number, maximum(floors[number], x[number] - w[number] / g[number]))
        else:
            rows = sets.disks[number].rows
            wanted = [x[row] - w[row] / g[row] for row in rows]
            share = disk_share(_radius(sets.disks[number], limits[number], x), wanted)
            for row, each in zip(rows, wanted, strict=True):
                apply(row, share * each)
    return np.array(x, dtype=w.dtype), w, change


def residuals(
    sets: ConstraintSets,
    g: Sequence[Any],
    limits: Sequence[Any] | Array,
    floors: Sequence[Any] | Array,
    impulses: Array,
    velocities: Array,
) -> Residuals:
    """Return the violation of each condition, for any scalar."""
    gap: Any = 0.0
    complementarity: Any = 0.0
    friction: Any = 0.0
    cone: Any = 0.0
    free: Any = 0.0
    for row in sets.unilateral:
        w = velocities[row]
        gap = maximum(gap, -w)
        least = minimum(w, g[row] * (impulses[row] - floors[row]))
        complementarity = maximum(complementarity, abs(least))
    for number, disk in enumerate(sets.disks):
        rows, scale = disk.rows, g[disk.rows[0]]
        radius = _radius(disk, limits[number], impulses)
        held = [impulses[row] for row in rows]
        wanted = [x - velocities[row] / scale for x, row in zip(held, rows, strict=True)]
        share = disk_share(radius, wanted)
        missed = [x - share * y for x, y in zip(held, wanted, strict=True)]
        friction = maximum(friction, scale * norm(missed))
        cone = maximum(cone, scale * (norm(held) - radius))
    for row in sets.free:
        free = maximum(free, abs(velocities[row]))
    return Residuals(gap, complementarity, friction, cone, free)


def _radius(disk: Disk, limit: Any, x: Sequence[Any] | Array) -> Any:
    return limit if disk.normal is None else limit * maximum(x[disk.normal], 0.0)


def disk_share(radius: Any, wanted: Sequence[Any]) -> Any:
    """Return the factor by which a vector is shortened to at most `radius`, for any scalar."""
    if len(wanted) == 1:
        return minimum(1.0, radius / (abs(wanted[0]) + TINY))
    x, y = wanted
    return minimum(1.0, radius / root(x * x + y * y + TINY))


def inverse_length(least: Any, vector: Sequence[Any]) -> Any:
    """Return 1 / the length of a vector of two components, or 1 / `least` where that is longer, for any
    scalar."""
    x, y = vector
    return 1.0 / root(maximum(least * least, x * x + y * y) + TINY)


def norm(vector: Sequence[Any]) -> Any:
    """Return the length of a vector of one or two components, for any scalar."""
    if len(vector) == 1:
        return abs(vector[0])
    return root(vector[0] * vector[0] + vector[1] * vector[1])


def root(x: Any) -> Any:
    """Return the square root of a number, for any scalar."""
    # NumPy takes ten times as long for a float.
    return math.sqrt(x) if isinstance(x, float) else sqrt(x)[()]


# -- floats -----------------------------------------------------------------------------------


TOLERANCE = 1e-12
"""Largest residual [m/s or rad/s] at which impulses on floats count as solved."""

SUFFICIENT = 1e-10
"""Largest residual [m/s or rad/s] after an attempt that ends the search, if `tolerance` is smaller. Redundant
contacts may leave a little more than `TOLERANCE`, and further attempts do not improve it."""

EXACT = 1e-13
"""Residual relative to the largest velocity without impulses, above which one more of Newton's steps follows
below `tolerance`. Without it a body that has come to rest rises or sinks with that residual, since the
impulses are those of the next steps too, and gains or loses energy."""

ROUNDING = 16.0 * FLOAT64_EPS
"""Residual relative to the largest sum of |G| |x| that is rounding."""

MOST_PROXIMAL = 1e-3
"""Largest part of g on the diagonal of Newton's matrix. Far from the solution large steps lead to wrong
modes."""

TIE = TOLERANCE
"""Velocity [m/s or rad/s] up to which Newton's matrix takes a row at the boundary of its set as inside, where
w = 0. At rest w and x - l may both be rounding. Rows that left their sets by rounding would carry nothing,
and the impulses of redundant contacts would jump to the others."""

NEWTON_STEPS = 40
"""Number of Newton's steps from one start."""

CAUTIOUS_FROM = 10
"""Step from which on every third has the largest part, which ends cycles between sets of modes."""


class Attempt(NamedTuple):
    """An attempt of Newton's method, which fails where modes cycle or steps are too short."""

    sweeps: int
    """Number of sweeps before it."""
    factor: float
    """Factor of g in its projections, which changes no solution, but the modes on the way."""
    proximal: float
    """Part of g on the diagonal, times the largest entry of F relative to that of c."""
    least: float
    """Least part of g on the diagonal. Redundant contacts make the matrix singular: a small part lets their
    impulses jump from modes to others, a large one is slow where a heavy body rests on a light one."""


ATTEMPTS = (
    Attempt(0, 1.0, 1e-3, 1e-9),
    Attempt(0, 1.0, 0.0, 1e-7),
    Attempt(10, 0.3, 1e-3, 1e-7),
    Attempt(10, 3.0, 0.0, 1e-9),
    Attempt(20, 1.0, 1e-3, 1e-6),
    Attempt(40, 0.3, 0.0, 1e-9),
    Attempt(40, 3.0, 1e-3, 1e-7),
    Attempt(80, 1.0, 0.0, 1e-9),
    Attempt(80, 0.3, 1e-3, 1e-7),
    # Where modes still cycle, smaller steps end them.
    Attempt(80, 1.0, 0.0, 1e-5),
    Attempt(80, 1.0, 0.0, 1e-4),
    Attempt(80, 0.3, 0.0, 1e-5),
)


def solve(
    sets: ConstraintSets,
    G: Floats,
    c: Floats,
    limits: Floats,
    *,
    floors: Floats | None = None,
    start: Floats | None = None,
    tolerance: float = TOLERANCE,
    attempts: Sequence[Attempt] = ATTEMPTS,
) -> Solution:
    """Return the impulses of a step on floats, from a warm start (m,) or zero.

    Newton's method begins at the start; where it does not converge in a few steps, sweeps improve the start,
    and it begins again, at most once for each of the `attempts`, each with at most `NEWTON_STEPS`. The
    residuals tell how well the best attempt did. Results depend on the arguments alone.
    """
    floors = np.zeros(sets.size) if floors is None else floors
    at: Floats = np.zeros(sets.size) if start is None else start
    numbers = scales(sets, G)
    newton = _Newton(sets, G, c, np.array(numbers, dtype=np.float64), limits, floors)
    rounding = ROUNDING * np.abs(G)
    best, least, taken = at, math.inf, 0
    for attempt in attempts:
        w: Floats = c + G @ at
        for _ in range(attempt.sweeps):
            at, w, _ = sweep(sets, G, numbers, limits, floors, at, w)
        x, last = at, False
        for count in range(NEWTON_STEPS):
            cautious = count >= CAUTIOUS_FROM and count % 3 == 0
            error, F, J = newton.equations(x, attempt, cautious=cautious)
            if error < least:
                best, least = x, error
            if error <= tolerance:
                if last or count == 0 or error <= EXACT * newton.speed:
                    break
                last = True
            elif last:
                break
            step = _finite_solution(J, -F)
            if step is None:
                break
            x = x + step
        taken += attempt.sweeps + count
        if least <= max(tolerance, SUFFICIENT, float((rounding @ np.abs(best)).max(initial=0.0))):
            break
    w = c + G @ best
    return Solution(best, w, residuals(sets, numbers, limits, floors, best, w), taken)


def rebound(
    sets: ConstraintSets,
    G: Floats,
    c: Floats,
    limits: Floats,
    plastic: Solution,
    restitution: Floats,
    *,
    tolerance: float = TOLERANCE,
) -> Solution:
    """Return the impulses of impacts that restore a part of the impulses of compression, on floats.

    `plastic` is the solution without restitution, whose unilateral impulses are those of compression. By
    Poisson's hypothesis a unilateral row has at least 1 + e times its impulse of compression, with e in
    `restitution` (m,); friction is within the cone of the whole impulse. For central impacts that is Newton's
    law. Without friction the work x . (c + w) / 2 of the impulses is at most zero for any e: with the
    impulses d of restitution, d' G d = sum of e x w over the rows that touch, at most x' G d, and by
    Cauchy-Schwarz at most x' G x.
    """
    floors = np.zeros(sets.size)
    rows = list(sets.unilateral)
    floors[rows] = (1.0 + restitution[rows]) * np.maximum(plastic.impulses[rows], 0.0)
    return solve(sets, G, c, limits, floors=floors, start=plastic.impulses, tolerance=tolerance)


class _Newton:
    """Newton's method for F(x) = 0, with F in m/s or rad/s."""

    def __init__(
        self, sets: ConstraintSets, G: Floats, c: Floats, g: Floats, limits: Floats, floors: Floats
    ) -> None:
        self._G, self._c, self._g = G, c, g
        self.speed = float(np.abs(c).max(initial=0.0)) + TINY
        """Largest velocity without impulses [m/s or rad/s]."""
        self._unilateral = np.array(sets.unilateral, dtype=np.intp)
        self._floors = floors[self._unilateral]
        self._disks = [disks for rows in (1, 2) if (disks := _Disks(sets, limits, rows)).count]

    def equations(self, x: Floats, attempt: Attempt, *, cautious: bool) -> tuple[float, Floats, Floats]:
        """Return the largest entry of F at x (m,), F (m,) and Newton's matrix (m, m)."""
        factor = attempt.factor
        G, g = self._G, factor * self._g
        w = self._c + G @ x
        wanted = x - w / g
        F, J = w.copy(), G.copy()
        # Impulses of unilateral rows by projection, and 1 where they follow from the others.
        projected, follows = np.zeros(len(x)), np.zeros(len(x))
        rows = self._unilateral
        held = np.maximum(wanted[rows], self._floors)
        inactive = rows[wanted[rows] <= self._floors - TIE / g[rows]]
        projected[rows], follows[rows], follows[inactive] = held, 1.0, 0.0
        F[rows] = g[rows] * (x[rows] - held)
        J[inactive] = 0.0
        J[inactive, inactive] = g[inactive]
        for disks in self._disks:
            disks.add(F, J, x, wanted, projected, follows, G, g)
        error = float(np.abs(F).max(initial=0.0)) / min(factor, 1.0)
        part = MOST_PROXIMAL
        if not cautious:
            part = min(max(attempt.proximal * error / self.speed, attempt.least), MOST_PROXIMAL)
        J.flat[:: len(x) + 1] += part * self._g
        return error, F, J


def _finite_solution(A: Floats, b: Floats) -> Floats | None:
    """Return x with A x = b; None where there is no finite one."""
    try:
        x = np.asarray(np.linalg.solve(A, b), dtype=np.float64)
    except np.linalg.LinAlgError:
        return None
    return x if np.isfinite(x).all() else None


class _Disks:
    """Disks with the same number of rows, as arrays."""

    def __init__(self, sets: ConstraintSets, limits: Floats, rows: int) -> None:
        chosen = [k for k, disk in enumerate(sets.disks) if len(disk.rows) == rows]
        self.count = len(chosen)
        self._rows = np.array([sets.disks[k].rows for k in chosen], dtype=np.intp).reshape(-1, rows)
        normals = [sets.disks[k].normal for k in chosen]
        self._coupled = np.array([each is not None for each in normals], dtype=np.float64)
        self._normals = np.array([0 if each is None else each for each in normals], dtype=np.intp)
        self._limits = np.asarray(limits, dtype=np.float64)[chosen]

    def add(
        self,
        F: Floats,
        J: Floats,
        x: Floats,
        wanted: Floats,
        projected: Floats,
        follows: Floats,
        G: Floats,
        g: Floats,
    ) -> None:
        """Write the entries of F (m,) and the rows of J (m, m) of disks that slip; those of disks that stick
        are there."""
        y = wanted[self._rows]
        norm = np.sqrt((y * y).sum(axis=1))
        radius = np.where(self._coupled > 0.0, projected[self._normals], 1.0) * self._limits
        slips = norm > radius
        if not slips.any():
            return
        rows, y, norm, radius = self._rows[slips], y[slips], norm[slips], radius[slips]
        normals = self._normals[slips]
        u, scale = y / norm[:, None], g[rows[:, 0]]
        F[rows] = scale[:, None] * (x[rows] - radius[:, None] * u)
        moves = norm > radius + TIE / scale
        if not moves.any():
            return
        rows, y, norm, radius = rows[moves], y[moves], norm[moves], radius[moves]
        normals, u, scale = normals[moves], u[moves], scale[moves]
        chosen = np.flatnonzero(slips)[moves]
        # The radius changes with the impulse of the normal row.
        dr = np.zeros((len(rows), len(x)))
        grows = self._limits[chosen] * self._coupled[chosen] * follows[normals]
        each = np.arange(len(rows))
        dr[each, normals] = grows
        dr -= (grows / g[normals])[:, None] * G[normals]
        dy = -G[rows] / scale[:, None, None]
        dy[each[:, None], np.arange(rows.shape[1]), rows] += 1.0
        turned = dy - u[:, :, None] * np.einsum("ki,kij->kj", u, dy)[:, None, :]
        derivative = -u[:, :, None] * dr[:, None, :] - (radius / norm)[:, None, None] * turned
        derivative[each[:, None], np.arange(rows.shape[1]), rows] += 1.0
        J[rows] = scale[:, None, None] * derivative

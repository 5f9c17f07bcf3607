"""Sweeps over contacts and joints on the factors of a tree, without a Delassus matrix, for any scalar.

A *block* is a contact, with a normal row and two tangents, or a joint, with the row of its coordinate. Its
velocity is w = c + Y u, and its impulses x change u by D^-1 Y' x (`dynx.rbd.eliminated_rows`). A visit solves
the block for given others and changes u. Entries of u that no other block has are not kept: they are a
product with the block's own impulses. So a visit takes operations for the joints that two blocks have in
common, and rows of many blocks take far fewer than the Delassus matrix of all.

The laws are those of `dynx.rbd.constraints`. Without its own impulses a contact has the velocity f, with them
w = f + G x. It sticks where x = -G^-1 f is in the cone. Where it slides, its impulses are x = n (1, mu d)
with a direction d of length 1. Of G, a is the entry of the normal, b are those beside it, and T is the block
of the tangents. From w_n = 0 follows n = -f_n / (a + mu b . d). The direction d is opposite to w_t, that is
to

    p(d) = (a + mu b . d) f_t - f_n (b + mu T d),

which is affine in d. A visit takes one step of Newton's method for the angle of d: d + t e with e normal to
d and t = -(e . p) / (e . p' e - d . p), which is parallel to (e . p' e) d - p. Where that vector is shorter
than e . p' e, the visit divides it by e . p' e, not by its length. So a visit changes nothing where the laws
are obeyed, and only there.

Of several contacts on a body such visits lead around a solution, in cycles where points stick and slide in
turn. A visit of a redundant contact projects x - w / g on the cone instead, with the scales g.

A joint with dry friction r and stops may have the velocities
low <= w <= high in the step, where low <= 0 <= high. Its impulse is at most r against the motion between
them, and any at a stop that exceeds r against it. That is a maximal monotone graph, of which a visit finds
the one point on the line w = z + g x.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from dynx.rbd.constraints import TINY, disk_share, inverse_length, largest_eigenvalue, norm, root
from dynx.rbd.eliminated_rows import EliminatedRows
from dynx.spatial.scalar import Array, less, less_equal, maximum, minimum, select

IMMOVABLE = 1e-9
"""Inverse of an effective mass [1/kg or 1/(kg m^2)] up to which an impulse moves nothing, and is none. The
tip of a fixed arm that cannot move along the normal of the ground has such a row."""

SINGULAR = 1e-6
"""Inverse of a normal's effective mass while its tangents stick, relative to that of one without friction, up
to which it counts as none."""

LEAST_SHARE = 0.1
"""Least effective mass of a contact that slides, relative to that of one without friction, by which a visit
divides. The mass is smaller, or negative, where friction presses a contact to the ground until it jams."""

INFINITE = 1e300
"""Inverse of an effective mass by which no impulse changes."""

PROXIMAL = 1e-8
"""Part of the scales that a visit adds to the diagonal of a contact's block of the Delassus matrix, together
with a velocity that balances it at the impulses before the visit. A fixed point is the same. Tangents may
depend on each other, as those of a robot that moves in a plane, and the sum is regular."""

INNER = 2
"""Projections of normal and tangents one after the other in a visit of a redundant contact. Two of them in a
visit reduce the residual as much as two visits, because the rows of a point are coupled more than two
points."""

MOST_OF_SLOPE = 1.5
"""Largest step of a normal in a projection, as a multiple of the one after which a contact that slides does
not move along its normal. The normal velocity changes by a + mu b . d with a normal impulse of 1 and the
friction mu d, and steps of 2 / (a + mu |b|) would repeat the same two impulses for ever."""

LEAST_IMPULSE = 1e-20
"""Largest friction [N s] of a contact before a visit that counts as none."""

Vector = list[Any]
Velocities = dict[int, Any]
"""Entries of u by their place in the order of elimination."""


class JointBounds(NamedTuple):
    """Law of a joint in a step."""

    friction: Any
    """Largest impulse of dry friction [N m s or N s]."""
    low: Any
    """Smallest velocity [rad/s or m/s], at most 0; minus infinity without a stop."""
    high: Any
    """Largest velocity [rad/s or m/s], at least 0; infinity without a stop."""


@dataclass
class Block:
    """Rows of a contact (3) or of a joint (1)."""

    rows: list[int]
    places: set[int]
    """Places of all entries of the rows."""
    Y: list[Velocities]
    """Entries of the rows that other blocks have too."""
    pivots: Velocities
    """1 / D of these entries. A product Y D^-1 for each row would take as much memory as Y."""
    own: list[Vector]
    """Part of the block of the Delassus matrix from entries that no other block has."""
    removed: list[Vector]
    """`own` - `G`; empty for a joint and for a redundant contact."""
    G: list[Vector]
    """Block of the Delassus matrix; of a contact that is not redundant with the proximal term."""
    scales: Vector
    """Largest eigenvalue of G for the normal and for the tangents, or of a joint's row."""
    inverse: Vector
    """1 / scales; 0 where nothing can move."""
    sticking: list[Vector]
    """-`G`^-1 of a contact, 0 where its normal depends on its tangents; empty for a
    joint and for a redundant contact."""
    least_curvature: Any
    """Least e . p' e of a contact that slides, divided by -f_n mu."""
    least_slope: Any
    """Least effective mass by which a visit of a contact that slides divides; `INFINITE` where the normal
    cannot move."""


def blocks_of(
    eliminated: EliminatedRows, pivots: Sequence[Any], contacts: int, joints: int, *, redundant: bool
) -> list[Block]:
    """Return the blocks of rows: 3 for each contact, then one for each joint.

    `pivots` are 1 / D. Contacts are `redundant` where a body has several.
    """
    rows = [[3 * k, 3 * k + 1, 3 * k + 2] for k in range(contacts)]
    rows += [[3 * contacts + k] for k in range(joints)]
    count: dict[int, int] = {}
    for each in rows:
        for place in {place for row in each for place in eliminated.Y[row]}:
            count[place] = count.get(place, 0) + 1
    shared = {place for place, n in count.items() if n > 1}
    return [_block(eliminated, pivots, each, shared, redundant) for each in rows]


def _block(
    eliminated: EliminatedRows, pivots: Sequence[Any], rows: list[int], shared: set[int], redundant: bool
) -> Block:
    def shared_part(row: Velocities) -> Velocities:
        return {place: entry for place, entry in row.items() if place in shared}

    G = [[0.0] * len(rows) for _ in rows]
    own = [[0.0] * len(rows) for _ in rows]
    for a, i in enumerate(rows):
        for b, j in enumerate(rows[: a + 1]):
            common: Any = 0.0
            alone: Any = 0.0
            for place, entry in eliminated.Z[i].items():
                if place in eliminated.Y[j]:
                    product = entry * eliminated.Y[j][place]
                    if place in shared:
                        common = common + product
                    else:
                        alone = alone + product
            own[a][b] = own[b][a] = alone
            G[a][b] = G[b][a] = common + alone
    scales = [G[0][0]]
    if len(rows) == 3:
        scales.append(largest_eigenvalue(G[1][1], G[2][2], G[1][2]))
    inverse = [select(less(IMMOVABLE, each), 1.0 / (each + TINY), 0.0) for each in scales]
    sticking: list[Vector] = []
    removed: list[Vector] = []
    moves: Any = 1.0
    if len(rows) == 3 and not redundant:
        for k, scale in enumerate((scales[0], scales[1], scales[1])):
            G[k][k] = G[k][k] + PROXIMAL * scale
        sticking, moves = _sticking(G)
        removed = [[a - b for a, b in zip(*each, strict=True)] for each in zip(own, G, strict=True)]
    least_curvature = select(moves, 0.0, scales[-1])
    least_slope = select(less(IMMOVABLE, scales[0]), LEAST_SHARE * scales[0], INFINITE)
    Y = [shared_part(eliminated.Y[row]) for row in rows]
    places = {place for row in Y for place in row}
    support = {place for row in rows for place in eliminated.Y[row]}
    pivots_of_places = {place: pivots[place] for place in places}
    return Block(
        rows,
        support,
        Y,
        pivots_of_places,
        own,
        removed,
        G,
        scales,
        inverse,
        sticking,
        least_curvature,
        least_slope,
    )


def _sticking(G: list[Vector]) -> tuple[list[Vector], Any]:
    """Return -G^-1 of a contact, and whether its normal moves while its tangents stick.

    Where it does not, a contact that closes a gap cannot stick, and the matrix is 0.
    """
    (a, b, c), (_, d, e), (_, _, f) = G
    share = 1.0 / (d * f - e * e + TINY)
    ss, st, tt = share * f, share * e, share * d
    s, t = ss * b - st * c, tt * c - st * b
    schur = a - b * s - c * t
    moves = less(maximum(SINGULAR * a, IMMOVABLE), schur)
    n = select(moves, 1.0 / (schur + TINY), 0.0)
    ns, nt, kept = n * s, n * t, select(moves, 1.0, 0.0)
    st = kept * st - ns * t
    return [[-n, ns, nt], [ns, -kept * ss - ns * s, st], [nt, st, -kept * tt - nt * t]], moves


def impulse_velocities(blocks: Sequence[Block], x: Vector) -> Velocities:
    """Return the entries of u that blocks have in common, for impulses x (m,)."""
    u: Velocities = {}
    for block in blocks:
        _add(u, block, [x[row] for row in block.rows])
    return u


def _add(u: Velocities, block: Block, steps: Sequence[Any]) -> None:
    """Add the effect of impulses on the first rows of a block to u."""
    pushed: Velocities = {}
    for row, step in zip(block.Y, steps, strict=False):
        for place, entry in row.items():
            pushed[place] = pushed[place] + entry * step if place in pushed else entry * step
    for place, each in pushed.items():
        u[place] = u.get(place, 0.0) + block.pivots[place] * each


def block_velocity(block: Block, c: Vector, u: Velocities, x: Vector, *, free: bool = False) -> Vector:
    """Return the velocities of a block's rows, for impulses x (m,) and the entries of u that belong to
    them; if `free`, without the impulses of the block."""
    found = []
    for row, entries, own in zip(block.rows, block.Y, block.removed if free else block.own, strict=True):
        # Two sums, of which each waits for half of the additions.
        first, second = c[row], 0.0
        for other, entry in zip(block.rows, own, strict=True):
            first = first + entry * x[other]
        for number, (place, entry) in enumerate(entries.items()):
            if number % 2:
                first = first + entry * u[place]
            else:
                second = second + entry * u[place]
        found.append(first + second)
    return found


def block_sweep(
    blocks: Sequence[Block],
    c: Vector,
    friction: Sequence[Any],
    bounds: Sequence[JointBounds],
    u: Velocities,
    x: Vector,
) -> tuple[Velocities, Vector, Any]:
    """Visit every block once; return the entries of u, the impulses (m,) and the largest change [m/s].

    `friction` has a coefficient for each contact, `bounds` the law of each joint. The change is that of an
    impulse times the scale of its row.
    """
    u, x = dict(u), list(x)
    change: Any = 0.0
    for group in visits(blocks):
        done: list[Vector] = []
        for number in group:
            block = blocks[number]
            held = [x[row] for row in block.rows]
            w = block_velocity(block, c, u, x, free=bool(block.sticking))
            if block.sticking:
                new = _contact_impulses(block, friction[number], held, w)
            elif len(held) == 3:
                new = _projected_impulses(block, friction[number], held, w)
            else:
                new = [_joint_impulse(block, bounds[number - len(friction)], held[0], w[0])]
            steps = [a - b for a, b in zip(new, held, strict=True)]
            for row, impulse in zip(block.rows, new, strict=True):
                x[row] = impulse
            change = maximum(change, abs(steps[0]) * block.scales[0])
            if len(steps) == 3:
                change = maximum(change, maximum(abs(steps[1]), abs(steps[2])) * block.scales[1])
            done.append(steps)
        for number, steps in zip(group, done, strict=True):
            _add(u, blocks[number], steps)
    return u, x, change


def visits(blocks: Sequence[Block]) -> list[tuple[int, ...]]:
    """Return the numbers of the blocks of each visit: pairs of contacts on different branches, then others.

    Both blocks of a pair are solved for the same u, which a processor does at the same time. Sweeps over two
    blocks converge with a symmetric positive definite matrix whether the second one knows the first or not
    (only more slowly); contacts on one body may have a singular one.
    """
    found: list[tuple[int, ...]] = []
    left = list(range(len(blocks)))
    while left:
        first = left.pop(0)
        own = blocks[first].places
        for number in left:
            other = blocks[number].places
            if len(blocks[first].rows) == 3 == len(blocks[number].rows) and own - other and other - own:
                left.remove(number)
                found.append((first, number))
                break
        else:
            found.append((first,))
    return found


def _contact_impulses(block: Block, mu: Any, x: Vector, f: Vector) -> Vector:
    """Return the impulses of a contact for given others, from impulses x (3,) near them and its velocities f
    (3,) without them."""
    (a, b, c), (_, d, e), (_, _, g) = block.G
    n, s, t = x
    fn, fs, ft = f
    stuck = [row[0] * fn + row[1] * fs + row[2] * ft for row in block.sticking]
    most = mu * stuck[0]
    sticks = less_equal(maximum(stuck[1] * stuck[1] + stuck[2] * stuck[2] - most * abs(most), fn), 0.0)
    # B is the matrix of p; the first direction is that of the impulses before.
    mu_n, mu_s, mu_t = mu * fn, mu * fs, mu * ft
    B = [[mu_s * b - mu_n * d, mu_s * c - mu_n * e], [mu_t * b - mu_n * e, mu_t * c - mu_n * g]]
    shortened = 1.0 / maximum(mu * n, LEAST_IMPULSE)
    ds, dt = shortened * s, shortened * t
    ps = a * fs - fn * b + B[0][0] * ds + B[0][1] * dt
    pt = a * ft - fn * c + B[1][0] * ds + B[1][1] * dt
    curvature = (B[0][0] * dt - (B[0][1] + B[1][0]) * ds) * dt + B[1][1] * (ds * ds)
    curvature = maximum(curvature, -mu_n * block.least_curvature)
    wanted = [curvature * ds - ps, curvature * dt - pt]
    length = inverse_length(curvature, wanted)
    ds, dt = length * wanted[0], length * wanted[1]
    slope = a + mu * (b * ds + c * dt)
    # An immovable normal keeps its impulse, which is none.
    divisor = maximum(slope, block.least_slope)
    slides = maximum(0.0, (n * (divisor - slope) - fn) / divisor)
    limit = mu * slides
    found = [slides, limit * ds, limit * dt]
    return [select(sticks, one, other) for one, other in zip(stuck, found, strict=True)]


def _projected_impulses(block: Block, mu: Any, x: Vector, w: Vector) -> Vector:
    """Return the impulses of a redundant contact for given others, after `INNER` projections of its normal
    and its tangents, from impulses x (3,) and the velocities w (3,) with them."""
    (a, b, c), (_, d, e), (_, _, f) = block.G
    of_normal, of_tangents = block.inverse
    # This does not depend on impulses, so that kernels compute it once for all sweeps.
    of_normal = of_normal * minimum(1.0, MOST_OF_SLOPE / (1.0 + mu * norm([b, c]) * of_normal))
    n, s, t = x
    wn, ws, wt = w
    for number in range(INNER):
        last = number == INNER - 1
        new = maximum(0.0, n - wn * of_normal)
        step, n = new - n, new
        ws, wt = ws + b * step, wt + c * step
        ys, yt = s - ws * of_tangents, t - wt * of_tangents
        share = disk_share(mu * n, [ys, yt])
        ds, dt = share * ys - s, share * yt - t
        s, t = share * ys, share * yt
        if not last:
            wn = wn + a * step + b * ds + c * dt
            ws, wt = ws + d * ds + e * dt, wt + e * ds + f * dt
    return [n, s, t]


def _joint_impulse(block: Block, bounds: JointBounds, x: Any, w: Any) -> Any:
    """Return the impulse of a joint for given others."""
    g = block.scales[0]
    free = w - g * x
    held = _end_velocity(bounds, g, free)
    return (held - free) * block.inverse[0]


def _end_velocity(bounds: JointBounds, g: Any, free: Any) -> Any:
    """Return the velocity of a joint that would have the velocity `free` without its impulse."""
    most = g * bounds.friction
    slowed = free - minimum(maximum(free, -most), most)
    return minimum(maximum(slowed, bounds.low), bounds.high)


def block_residual(
    blocks: Sequence[Block],
    c: Vector,
    friction: Sequence[Any],
    bounds: Sequence[JointBounds],
    u: Velocities,
    x: Vector,
) -> tuple[Any, list[Vector]]:
    """Return the largest violation of the laws [m/s or rad/s], and the velocities of each block's rows."""
    worst: Any = 0.0
    # Squared, so that one root is that of all contacts.
    friction_error: Any = 0.0
    velocities = []
    for number, block in enumerate(blocks):
        w = block_velocity(block, c, u, x)
        velocities.append(w)
        held = [x[row] for row in block.rows]
        if len(held) == 1:
            g = block.scales[0]
            law = _end_velocity(bounds[number - len(friction)], g, w[0] - g * held[0])
            worst = maximum(worst, abs(law - w[0]))
            continue
        g_n, g_t = block.scales
        radius = friction[number] * maximum(held[0], 0.0)
        wanted = [y - v * block.inverse[1] for y, v in zip(held[1:], w[1:], strict=True)]
        share = disk_share(radius, wanted)
        s, t = (g_t * (y - share * z) for y, z in zip(held[1:], wanted, strict=True))
        friction_error = maximum(friction_error, s * s + t * t)
        for each in (-w[0], abs(minimum(w[0], g_n * held[0])), g_t * (norm(held[1:]) - radius)):
            worst = maximum(worst, each)
    return maximum(worst, root(friction_error)), velocities


# -- displacements ------------------------------------------------------------------------------------


def displacement_sweep(
    blocks: Sequence[Block],
    wanted: Sequence[Any],
    ranges: Sequence[tuple[Any, Any]],
    u: Velocities,
    y: Vector,
) -> tuple[Velocities, Vector, Any]:
    """Visit every block once for the displacement that takes back overlaps, without friction.

    `wanted` has the velocity of each contact's normal without such impulses, which the displacement makes at
    least 0; `ranges` the least and largest change of each joint's velocity. `u` and y (n,), an impulse for
    each block, belong to the displacement alone. Returns both, and the largest change [m/s or rad/s].
    """
    u, y = dict(u), list(y)
    change: Any = 0.0
    for number, block in enumerate(blocks):
        w = _first_velocity(block, u, y[number])
        if len(block.rows) == 3:
            new = maximum(0.0, y[number] - (wanted[number] + w) * block.inverse[0])
        else:
            least, most = ranges[number - len(wanted)]
            free = w - block.scales[0] * y[number]
            new = (minimum(maximum(free, least), most) - free) * block.inverse[0]
        step = new - y[number]
        _add(u, block, [step])
        y[number] = new
        change = maximum(change, abs(step) * block.scales[0])
    return u, y, change


def _first_velocity(block: Block, u: Velocities, y: Any) -> Any:
    w = block.own[0][0] * y
    for place, entry in block.Y[0].items():
        w = w + entry * u[place]
    return w


def all_velocities(
    eliminated: EliminatedRows, pivots: Sequence[Any], rows: Sequence[int], x: Sequence[Any]
) -> Vector:
    """Return u (nv,) of impulses x on some rows; 0 where they have no entry."""
    pushed: Vector = [0.0] * len(pivots)
    for row, impulse in zip(rows, x, strict=True):
        for place, entry in eliminated.Y[row].items():
            pushed[place] = pushed[place] + entry * impulse
    return [
        each if isinstance(each, float) and each == 0.0 else each * pivot
        for each, pivot in zip(pushed, pivots, strict=True)
    ]


def as_objects(numbers: Sequence[Any]) -> Array:
    """Return numbers of any scalar as an array of objects."""
    found = np.empty(len(numbers), dtype=object)
    found[:] = numbers
    return found

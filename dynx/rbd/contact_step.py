"""One step of a robot with PD motors that touches the ground, for any scalar, without branches on values.

The step solves motion, motors, contacts, joint limits and dry friction for the velocity v' at its end. The
motors are implicit: their torque is kp (target - q') - kd v' at the end q' = q + h v' of the step. With the
armature and the damping D of the joints, and the torque s of their springs at the beginning,

    (M + armature + h (kd + D) + h^2 kp) (v' - v)
        = h (kp (target - q - h v) - (kd + D) v + s - C v - g) + J' x.

The impulses x obey the laws of `dynx.rbd.constraints`, as in `World(scene, engine="dynx")`: a contact whose
gap phi >= 0 may close in the step has the normal velocity J v' + phi / h, and a displacement without velocity
takes back a part of each overlap. A second loop solves for that, which ends at once where nothing overlaps.

A motor has a largest torque. A torque that exceeds it at the end of the step, with the impulses of the step
before, is constant at the limit in this step.

The factors of M are those of a tree (`dynx.rbd.elimination`), so that a row of J has entries only at the
joints between the base and the body that touches, and sweeps need no Delassus matrix
(`dynx.rbd.block_sweeps`). Velocities of contacts are in axes that do not rotate during the step, in which
`dynx.rbd.displacement` moves a floating base.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from dynx.model.geometry import Shape, Sphere
from dynx.model.mechanism import ROOT, Mechanism
from dynx.rbd.block_sweeps import (
    Block,
    JointBounds,
    Velocities,
    all_velocities,
    as_objects,
    block_residual,
    block_sweep,
    blocks_of,
    displacement_sweep,
    impulse_velocities,
)
from dynx.rbd.constraints import NEGLIGIBLE, TINY, displacement_velocity, opening_velocity
from dynx.rbd.contact_geometry import plane_point_count, plane_points
from dynx.rbd.crba import mass_matrix
from dynx.rbd.displacement import floating_displacement, floating_end_velocity
from dynx.rbd.eliminated_rows import (
    EliminatedRows,
    SparseRow,
    eliminate_rows,
    eliminate_tips,
    substitute_back,
)
from dynx.rbd.elimination import factorize_mass_matrix, solve_with_factors
from dynx.rbd.kinematics import ancestry
from dynx.rbd.placement import Placement
from dynx.rbd.rnea import bias_torque
from dynx.spatial.scalar import Array, Floats, less, maximum, minimum, select
from dynx.spatial.so3 import cross, rotate, rotation_from_quat

MAX_ACCELERATION = 64.0
"""Number of steps of sweeps that acceleration takes at most at once. Along impulses that change no velocity,
as redundant contacts have, steps are rounding and their quotients arbitrary."""

ACCELERATED = 60
"""Number of sweeps with acceleration, after which as many follow without, and so on. In some states
accelerated sweeps lead around the solution for ever, and the plain ones go there; in others the plain ones
are slow."""

MAX_GROWTH = 2.0
"""Factor by which the squared length of a step may exceed that of the step before. Where joints with dry
friction stick beside contacts, impulses grow by equal steps until one of them slips, and acceleration takes
many of these steps at once. Where steps grow faster, the sweeps alone go on."""

RATIO = 0.1
"""Change of a sweep relative to that of the sweep before, at which `Sweeps.tolerance` is the bound."""

LEAST_RATIO = 0.02
"""Least such ratio that sweeps without acceleration rely on."""

DISPLACEMENT_SWEEPS = 4
"""Number of sweeps for the displacement between two tests."""

Numbers = dict[str, Array]

Repeat = Callable[[Callable[[Numbers], Numbers], Numbers, int], Numbers]
"""Repetition of a step: from a function of a state to the next state, the first state, and the largest number
of steps, to the last state. It ends where ``goes_on`` (1,) of the state is 0."""


Axes = tuple[tuple[float, float, float], ...]

LEVEL: Axes = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Axes of level ground."""


class FramedShape(NamedTuple):
    """A shape of a robot that may touch the ground."""

    frame: int
    """Number of a frame of the mechanism."""
    shape: Shape
    R: Floats
    """Orientation (3, 3) and place (3,) of the shape in the frame."""
    p: Floats
    friction: Any
    """Coefficient of friction with the ground."""
    deepest: bool = False
    """True if only the deepest point of the shape counts."""
    parts: tuple[str, str] = ("", "")
    """Names of the link and of the ground."""


@dataclass(frozen=True)
class ShapesOnPlane:
    """Shapes of a robot that may touch a plane of the world, the points x with normal . x = offset."""

    shapes: tuple[FramedShape, ...]
    axes: Axes = LEVEL
    """Normal of the plane, outwards, and two tangents: orthogonal unit vectors."""
    offset: Any = 0.0

    @property
    def counts(self) -> list[int]:
        """Number of contact points of each shape."""
        return [plane_point_count(each.shape, deepest=each.deepest) for each in self.shapes]

    def has_redundant_points(self, mechanism: Mechanism) -> bool:
        """Check whether a body has several contact points."""
        bodies = [mechanism.frames[each.frame].body for each in self.shapes]
        return len(set(bodies)) < sum(self.counts)

    @property
    def friction(self) -> list[Any]:
        """Coefficient of friction of each contact point."""
        pairs = zip(self.counts, self.shapes, strict=True)
        return [each.friction for count, each in pairs for _ in range(count)]


def spheres_on_plane(
    radii: Mapping[int, float], friction: Any, axes: Axes = LEVEL, offset: Any = 0.0
) -> ShapesOnPlane:
    """Return spheres at the origins of frames, and a plane with that coefficient of `friction`.

    `radii` [m] are by the numbers of the frames in the mechanism.
    """
    shapes = [
        FramedShape(frame, Sphere(radius), np.eye(3), np.zeros(3), friction)
        for frame, radius in radii.items()
    ]
    return ShapesOnPlane(tuple(shapes), axes, offset)


@dataclass(frozen=True)
class ServoJoints:
    """PD motors and what else acts on joints: arrays (n joints,) of any scalar, but floats for stops."""

    kp: Array
    kd: Array
    damping: Array
    armature: Array
    max_torque: Array | None = None
    """Largest torque of each motor [N m or N]; None without a limit."""
    friction: Array | None = None
    """Torque of dry friction [N m or N]; None without."""
    springs: tuple[Array, Array] | None = None
    """Stiffnesses of springs [N m/rad or N/m], and the positions at which they do not pull [rad or m]."""
    stops: tuple[Floats, Floats] | None = None
    """Lowest and highest positions [rad or m], infinite without a stop."""

    @property
    def limited(self) -> list[int]:
        """Numbers of the joints with dry friction or stops, which have a row of impulses each."""
        found = set[int]()
        if self.friction is not None:
            found |= {k for k, each in enumerate(self.friction) if not _is_zero(each)}
        if self.stops is not None:
            found |= {k for stops in self.stops for k in np.flatnonzero(np.isfinite(stops)).tolist()}
        return sorted(found)


@dataclass(frozen=True)
class Sweeps:
    """When the sweeps of a step end."""

    tolerance: float = 2e-6
    """Change of a row's velocity in a sweep below which they end [m/s]: residuals are then below half of it
    where contacts bear a robot on separate feet. It is the bound of sweeps whose changes fall tenfold; of
    those that fall faster or slower it is higher or lower, so that the next change would be the same. With
    acceleration, of which the next change tells little, it is always the bound."""
    most: int = 60
    """Largest number of sweeps."""
    accelerated: bool | None = None
    """True if each sweep begins at a point that the last two determine by the secant method (Anderson,
    Iterative procedures for nonlinear integral equations, 1965). Points of one body need it, such as those of
    a sole: their rows are redundant, and sweeps alone converge slowly. None: where a body has several."""

    @classmethod
    def of_points(cls, *, redundant: bool) -> Sweeps:
        """Return the sweeps after which residuals are at most 1e-6 m/s, but in rare states, of contact points
        that are on separate bodies or `redundant`.

        Changes by accelerated sweeps may be smaller than the residual, and impulses of redundant points may
        have far to go with small ones.
        """
        return cls(tolerance=4e-7, most=480, accelerated=True) if redundant else cls()


def repeat_numbers(step: Callable[[Numbers], Numbers], state: Numbers, most: int) -> Numbers:
    """Repeat a step on numbers of any scalar that compares."""
    for _ in range(most):
        if state["goes_on"][0] == 0.0:
            break
        state = step(state)
    return state


def contact_step(
    mechanism: Mechanism,
    joints: ServoJoints,
    touching: ShapesOnPlane,
    sweeps: Sweeps,
    h: float,
    q: Array,
    v: Array,
    target: Array,
    impulses: Array,
    repeat: Repeat = repeat_numbers,
    *,
    regrouped: Mechanism | None = None,
) -> Numbers:
    """Return q (nq,), v (nv,), `impulses` (m,) [N s or N m s] and the largest `residual` (1,) [m/s] after a
    step.

    The length of the step is `h` [s]. `target` (n joints,) are positions; `impulses` are those of the step
    before: normal and tangents of each contact point, then those of the joints with dry friction or stops.
    `regrouped` is the mechanism with base parameters (`dynx.rbd.base_parameters`), which take fewer
    operations for the mass matrix and the bias torque. The residual is the largest violation of the laws of
    contact.
    """
    base, last = mechanism.nv - len(mechanism.bodies), mechanism.nv - 1
    moving = mechanism if regrouped is None else regrouped
    M, bias = mass_matrix(moving, q), bias_torque(moving, q, v)
    positions, rates = q[len(q) - len(mechanism.bodies) :], v[base:]
    rows, gaps = contact_rows(mechanism, touching, q)
    motors, stiffness = motor_law(joints, h, positions, rates, target)
    others, added = -bias, joints.armature + h * joints.damping
    others[base:] = others[base:] - joints.damping * rates
    if joints.springs is not None:
        stiffnesses, places = joints.springs
        others[base:] = others[base:] + stiffnesses * (places - positions)

    def factors(stiffness: Array) -> tuple[list[dict[int, Array]], list[Array]]:
        diagonal = np.concatenate([np.zeros(base), added + stiffness])
        return factorize_mass_matrix(mechanism, M + np.diag(diagonal))

    limited = joints.limited
    joint_rows: list[SparseRow] = [{last - base - k: np.array(1.0)[()]} for k in limited]
    if joints.max_torque is not None:
        pushed = others.astype(object)
        for row, impulse in zip([*rows, *joint_rows], impulses, strict=True):
            for k, each in row.items():
                pushed[last - k] = pushed[last - k] + each * (impulse / h)
        pushed[base:] = pushed[base:] + motors
        a = solve_with_factors(*factors(stiffness), pushed)
        motors, stiffness = _limited(joints.max_torque, motors, stiffness, a[base:])
    L, D = factors(stiffness)
    rest = eliminate_tips(L, np.concatenate([others[:base], motors + others[base:]]))
    # The velocity at the end is v + L^-T u.
    pivots = [1.0 / pivot for pivot in D]
    u = [h * each * pivot for each, pivot in zip(rest, pivots, strict=True)]
    contacts = len(gaps)
    rows += joint_rows
    eliminated = eliminate_rows(L, D, rows)
    moved = floating_end_velocity(v, 0.0 * v, h, mechanism.root_center) if mechanism.floating else v
    c: list[Any] = []
    for row, eliminated_row in zip(rows, eliminated.Y, strict=True):
        terms = [each * moved[last - k] for k, each in row.items()]
        terms += [each * u[k] for k, each in eliminated_row.items()]
        c.append(sum(terms[1:], terms[0]))
    opening = [opening_velocity(gap, h) for gap in gaps]
    for k, each in enumerate(opening):
        c[3 * k] = c[3 * k] + each
    redundant = touching.has_redundant_points(mechanism)
    if sweeps.accelerated is None:
        sweeps = replace(sweeps, accelerated=redundant)
    blocks = blocks_of(eliminated, pivots, contacts, len(limited), redundant=redundant)
    bounds = [_bounds(joints, k, positions[k], h) for k in limited]
    solved, w = _solved_impulses(blocks, sweeps, c, touching.friction, bounds, impulses, repeat)
    for k, each in enumerate(opening):
        w[k] = w[k] - each
    extra = _displacement(blocks, sweeps, L, pivots, eliminated, gaps, bounds, w, h, repeat)
    changes = all_velocities(eliminated, pivots, range(len(rows)), list(solved["impulses"]))
    end = moved + substitute_back(L, [a + b for a, b in zip(u, changes, strict=True)])
    if mechanism.floating:
        q, v = floating_displacement(q, end + extra, end, h, mechanism.root_center)
    else:
        q, v = q + h * (end + extra), end
    if joints.stops is not None:
        # Rounding and the tolerance of the sweeps shall not carry a joint beyond a stop.
        first, q = len(q) - len(positions), as_objects(list(q))
        for k, (low, high) in enumerate(zip(*joints.stops, strict=True)):
            if np.isfinite(low):
                q[first + k] = maximum(q[first + k], minimum(low, positions[k]))
            if np.isfinite(high):
                q[first + k] = minimum(q[first + k], maximum(high, positions[k]))
    return {"q": q, "v": v, "impulses": solved["impulses"], "residual": solved["residual"]}


def motor_law(
    joints: ServoJoints, h: float, positions: Array, rates: Array, target: Array
) -> tuple[Array, Array]:
    """Return the torques b (n,) of the motors without acceleration, and K (n,): at the end of a step from
    `positions` and `rates` (n,) with the accelerations a the torques are b - K a."""
    kp, kd = joints.kp, joints.kd
    return kp * (target - positions - h * rates) - kd * rates, h * kd + h * h * kp


def _limited(limit: Array, motors: Array, stiffness: Array, a: Array) -> tuple[Array, Array]:
    """Return b and K (n,) of motors whose torques b - K a are within their limits (n,) at accelerations a
    (n,), and the limit and 0 for the others."""
    found: list[tuple[Any, Any]] = []
    for b, K, most, wanted in zip(motors, stiffness, limit, motors - stiffness * a, strict=True):
        inside, held = less(abs(wanted), most), minimum(maximum(wanted, -most), most)
        found.append((select(inside, b, held), select(inside, K, 0.0)))
    return as_objects([b for b, _ in found]), as_objects([K for _, K in found])


def _bounds(joints: ServoJoints, k: int, position: Any, h: float) -> JointBounds:
    """Return the law of joint k in a step; one that is beyond a stop may not move further."""
    low, high = -np.inf, np.inf
    if joints.stops is not None:
        lowest, highest = (stops[k] for stops in joints.stops)
        if np.isfinite(lowest):
            low = -opening_velocity(position - lowest, h)
        if np.isfinite(highest):
            high = opening_velocity(highest - position, h)
    return JointBounds(0.0 if joints.friction is None else h * joints.friction[k], low, high)


def _is_zero(x: Any) -> bool:
    return isinstance(x, float | int) and x == 0.0


def contact_rows(
    mechanism: Mechanism, touching: ShapesOnPlane, q: Array
) -> tuple[list[SparseRow], list[Array]]:
    """Return the rows (normal, two tangents) of each contact point, and the gaps [m].

    Entries are in the order of elimination, those of a floating base for velocities in its axes.
    """
    bodies, last = mechanism.bodies, mechanism.nv - 1
    base = mechanism.nv - len(bodies)
    angles = q[len(q) - len(bodies) :]
    axes: Array = np.array(touching.axes)
    # The plane in the axes of the root.
    offset: Any = touching.offset
    if mechanism.floating:
        offset = offset - axes[0].dot(q[:3])
        axes = axes @ rotation_from_quat(q[3:7])
    frames = [mechanism.frames[each.frame] for each in touching.shapes]
    # Poses of the bodies, and directions, in the axes of the root.
    R: dict[int, Array] = {ROOT: np.eye(3, dtype=int)}
    p: dict[int, Array] = {ROOT: np.zeros(3, dtype=int)}
    moving = {k for frame in frames for k in ancestry(mechanism, frame.body)}
    for k, body in enumerate(bodies):
        if k in moving:
            placement = Placement.of(body, angles[k])
            R[k] = R[body.parent] @ placement.R
            p[k] = p[body.parent] + rotate(R[body.parent], placement.p)
    rows: list[SparseRow] = []
    gaps: list[Array] = []
    for each, frame in zip(touching.shapes, frames, strict=True):
        center = p[frame.body] + rotate(R[frame.body], frame.p + frame.R @ each.p)
        turned = R[frame.body] @ (frame.R @ each.R)
        for gap, point in plane_points(each.shape, turned, center, axes, offset, deepest=each.deepest):
            gaps.append(gap)
            # The impulses act in the middle between the surfaces.
            point = point - (0.5 * gap) * axes[0]
            columns = {}
            for k in ancestry(mechanism, frame.body):
                axis = rotate(R[k], bodies[k].axis)
                columns[base + k] = cross(axis, point - p[k]) if bodies[k].revolute else axis
            for direction in axes:
                row: SparseRow = {last - k: column.dot(direction) for k, column in columns.items()}
                if mechanism.floating:
                    moment = cross(point, direction)
                    row.update({last - k: direction[k] for k in range(3)})
                    row.update({last - 3 - k: moment[k] for k in range(3)})
                rows.append(row)
    return rows, gaps


def _solved_impulses(
    blocks: Sequence[Block],
    sweeps: Sweeps,
    c: list[Any],
    friction: Sequence[Any],
    bounds: Sequence[JointBounds],
    impulses: Array,
    repeat: Repeat,
) -> tuple[Numbers, list[Any]]:
    """Return `impulses` (m,) for velocities c (m,) without impulses and the largest `residual` (1,) [m/s];
    and the velocity of each block's first row."""
    start = impulse_velocities(blocks, list(impulses))
    places = sorted(start)
    accelerated = sweeps.accelerated
    weights = [block.scales[min(k, 1)] for block in blocks for k in range(len(block.rows))]

    def next_state(state: Numbers) -> Numbers:
        names = ("point", "of_point") if accelerated else ("impulses", "shared")
        point, of_point = (list(state[name]) for name in names)
        u, x, change = block_sweep(
            blocks, c, friction, bounds, dict(zip(places, of_point, strict=True)), point
        )
        shared = [u[k] for k in places]
        found = {"impulses": x, "shared": shared}
        if accelerated:
            found["goes_on"] = [less(sweeps.tolerance, change)]
            step = [a - b for a, b in zip(x, point, strict=True)]
            size = _product(weights, step, step)
            turned = [a - b for a, b in zip(step, state["step"], strict=True)]
            share = _product(weights, turned, step) / (_product(weights, turned, turned) + TINY)
            share = minimum(maximum(share, -MAX_ACCELERATION), MAX_ACCELERATION)
            share = select(less(MAX_GROWTH * state["size"][0], size), 0.0, share)
            count = state["count"][0]
            share = select(less(count, float(ACCELERATED)), share, 0.0)
            count = select(less(count, 2.0 * ACCELERATED - 1.0), count + 1.0, 0.0)
            found |= {"step": step, "size": [size], "count": [count]}
            found["point"] = [a - share * (a - b) for a, b in zip(x, state["impulses"], strict=True)]
            found["of_point"] = [a - share * (a - b) for a, b in zip(shared, state["shared"], strict=True)]
        else:
            # The next change times the one before, from the ratio of both.
            before = state["change"][0]
            expected = maximum(change, LEAST_RATIO * before) * change
            found |= {"change": [change], "goes_on": [less((RATIO * sweeps.tolerance) * before, expected)]}
        return {name: as_objects(values) for name, values in found.items()}

    x, shared = list(impulses), [start[k] for k in places]
    first = {"impulses": x, "shared": shared, "goes_on": [1.0]}
    if accelerated:
        first |= {"point": x, "of_point": shared, "step": [0.0] * len(x), "size": [0.0], "count": [0.0]}
    else:
        first["change"] = [sweeps.tolerance / RATIO]
    state = repeat(next_state, {name: as_objects(values) for name, values in first.items()}, sweeps.most)
    u: Velocities = dict(zip(places, state["shared"], strict=True))
    residual, w = block_residual(blocks, c, friction, bounds, u, list(state["impulses"]))
    found = {"impulses": state["impulses"], "residual": as_objects([residual])}
    return found, [each[0] for each in w]


def _product(weights: Sequence[Any], a: Sequence[Any], b: Sequence[Any]) -> Any:
    terms = [weight * x * y for weight, x, y in zip(weights, a, b, strict=True)]
    return sum(terms[1:], terms[0])


def _displacement(
    blocks: Sequence[Block],
    sweeps: Sweeps,
    L: list[dict[int, Array]],
    pivots: Sequence[Any],
    eliminated: EliminatedRows,
    gaps: Sequence[Any],
    bounds: Sequence[JointBounds],
    w: Sequence[Any],
    h: float,
    repeat: Repeat,
) -> Array:
    """Return the velocity (nv,) that a step adds in its displacement to take back overlaps.

    `w` are the velocities of each block's first row at the end of the step.
    """
    wanted = [displacement_velocity(gap, each, h) for gap, each in zip(gaps, w, strict=False)]
    ranges = [
        (minimum(law.low - each, 0.0), maximum(law.high - each, 0.0))
        for law, each in zip(bounds, w[len(gaps) :], strict=True)
    ]
    deepest: Any = 0.0
    for gap in gaps:
        deepest = maximum(deepest, -gap)
    places = sorted({place for block in blocks for place in block.Y[0]})
    rows = [block.rows[0] for block in blocks]

    def next_state(state: Numbers) -> Numbers:
        y, u = list(state["impulses"]), dict(zip(places, state["shared"], strict=True))
        change: Any = 0.0
        for _ in range(DISPLACEMENT_SWEEPS):
            u, y, change = displacement_sweep(blocks, wanted, ranges, u, y)
        entries = all_velocities(eliminated, pivots, rows, y)
        return {
            "impulses": as_objects(y),
            "shared": as_objects([u[k] for k in places]),
            "velocity": substitute_back(L, entries),
            "goes_on": as_objects([less(sweeps.tolerance, change)]),
        }

    first = {
        "impulses": as_objects([0.0] * len(blocks)),
        "shared": as_objects([0.0] * len(places)),
        "velocity": as_objects([0.0] * len(L)),
        "goes_on": as_objects([less(max(NEGLIGIBLE, h * sweeps.tolerance), deepest)]),
    }
    return repeat(next_state, first, -(-sweeps.most // DISPLACEMENT_SWEEPS))["velocity"]

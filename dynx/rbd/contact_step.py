"""One step of a robot with PD motors whose spheres touch a plane, for any scalar, without branches on values.

The step solves motion, motors and contacts for the velocity v' at its end. The motors are implicit: their
torque is kp (target - q') - kd v' at the end q' = q + h v' of the step. With the armature and the damping D
of the joints,

    (M + armature + h (kd + D) + h^2 kp) (v' - v) = h (kp (target - q - h v) - (kd + D) v - C v - g) + J' x.

The impulses x obey the laws of `dynx.rbd.constraints`: a contact whose gap phi >= 0 may close in the step has
the normal velocity J v' + phi / h. A penetration is removed slowly, by `RECOVERY` of it in a step and at most
at `MAX_RECOVERY_SPEED`, because the velocity that removes it remains.

A motor has a largest torque. A torque that exceeds it at the end of the step, with the impulses of the step
before, is constant at the limit in this step.

The factors of M are those of a tree (`dynx.rbd.elimination`), so that a row of J has entries only at the
joints between the base and the body that touches. Velocities of contacts are in axes that do not rotate
during the step, in which `dynx.rbd.integration` moves a floating base.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.model.mechanism import ROOT, Mechanism
from dynx.rbd.constraints import ConstraintSets, Disk, residuals, scales, sweep
from dynx.rbd.crba import mass_matrix
from dynx.rbd.eliminated_rows import (
    EliminatedRows,
    SparseRow,
    eliminate_rows,
    eliminate_tips,
    substitute_back,
)
from dynx.rbd.elimination import factorize_mass_matrix, solve_with_factors
from dynx.rbd.integration import floating_step
from dynx.rbd.kinematics import ancestry
from dynx.rbd.placement import Placement
from dynx.rbd.rnea import bias_torque
from dynx.spatial.scalar import Array, less, maximum, minimum, select
from dynx.spatial.so3 import cross, rotate, rotation_from_quat

RECOVERY = 0.2
"""Share of a penetration that one step removes."""

MAX_RECOVERY_SPEED = 0.1
"""Largest velocity by which a penetration is removed [m/s]."""

SWEEPS_PER_TEST = 2
"""Number of sweeps between two tests whether they may end, because a test takes a third of a sweep's time."""

Numbers = dict[str, Array]

Repeat = Callable[[Callable[[Numbers], Numbers], Numbers, int], Numbers]
"""Repetition of a step: from a function of a state to the next state, the first state, and the largest number
of steps, to the last state. It ends where ``goes_on`` (1,) of the state is 0."""


@dataclass(frozen=True)
class SpheresOnPlane:
    """Spheres of a robot that may touch a plane of the world, the points x with normal . x = offset."""

    frames: tuple[int, ...]
    """Numbers of the frames of the mechanism at whose origins the spheres are."""
    radii: tuple[float, ...]
    """Radii [m]."""
    friction: float
    """Coefficient of friction."""
    axes: tuple[tuple[float, float, float], ...] = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    """Normal of the plane, outwards, and two tangents: orthogonal unit vectors."""
    offset: float = 0.0

    @property
    def sets(self) -> ConstraintSets:
        """The sets of the rows: for each sphere the normal and two tangents."""
        rows = [3 * k for k in range(len(self.frames))]
        disks = tuple(Disk((row + 1, row + 2), row) for row in rows)
        return ConstraintSets(3 * len(rows), unilateral=tuple(rows), disks=disks)


@dataclass(frozen=True)
class ServoJoints:
    """PD motors of the joints, and what else acts on them; arrays (n joints,)."""

    kp: Array
    kd: Array
    damping: Array
    armature: Array
    max_torque: Array | None = None
    """Largest torque of each motor [N m or N]; None without a limit."""


@dataclass(frozen=True)
class Sweeps:
    """When the sweeps of a step end."""

    tolerance: float = 1e-6
    """Change of a row's velocity in a sweep below which they end [m/s]."""
    most: int = 60
    """Largest number of sweeps."""


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
    spheres: SpheresOnPlane,
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
    """Return q (nq,), v (nv,), `impulses` (3 n,) [N s] and the largest `residual` (1,) [m/s] after a step.

    The length of the step is `h` [s]. `target` (n joints,) are positions; `impulses` are those of the step
    before, normal and tangents of each sphere. `regrouped` is the mechanism with base parameters
    (`dynx.rbd.base_parameters`), which take fewer operations for the bias torque. The residual is the largest
    violation of the laws of contact.
    """
    base, last = mechanism.nv - len(mechanism.bodies), mechanism.nv - 1
    M = mass_matrix(mechanism, q)
    bias = bias_torque(mechanism if regrouped is None else regrouped, q, v)
    rates = v[base:]
    rows, gaps = contact_rows(mechanism, spheres, q)
    motors, stiffness = motor_law(joints, h, q[len(q) - len(rates) :], rates, target)
    others, added = -bias, joints.armature + h * joints.damping
    others[base:] = others[base:] - joints.damping * rates

    def factors(stiffness: Array) -> tuple[list[dict[int, Array]], list[Array]]:
        diagonal = np.concatenate([np.zeros(base), added + stiffness])
        return factorize_mass_matrix(mechanism, M + np.diag(diagonal))

    if joints.max_torque is not None:
        pushed = others.astype(object)
        for row, impulse in zip(rows, impulses, strict=True):
            for k, each in row.items():
                pushed[last - k] = pushed[last - k] + each * (impulse / h)
        pushed[base:] = pushed[base:] + motors
        a = solve_with_factors(*factors(stiffness), pushed)
        motors, stiffness = _limited(joints.max_torque, motors, stiffness, a[base:])
    L, D = factors(stiffness)
    rest = eliminate_tips(L, np.concatenate([others[:base], motors + others[base:]]))
    # The velocity at the end is v + L^-T u.
    u = [h * each / pivot for each, pivot in zip(rest, D, strict=True)]
    eliminated = eliminate_rows(L, D, rows)
    moved = _in_fixed_axes(mechanism, v, h)
    c: list[Any] = []
    for i, (row, eliminated_row) in enumerate(zip(rows, eliminated.Y, strict=True)):
        terms = [each * moved[last - k] for k, each in row.items()]
        terms += [each * u[k] for k, each in eliminated_row.items()]
        if i % 3 == 0:
            gap = gaps[i // 3]
            terms.append(maximum(gap / h, maximum(gap * (RECOVERY / h), -MAX_RECOVERY_SPEED)))
        c.append(sum(terms[1:], terms[0]))
    impulses, residual = _contact_impulses(spheres, sweeps, eliminated, _objects(c), impulses, repeat)
    for solved_row, impulse in zip(eliminated.Z, impulses, strict=True):
        for k, each in solved_row.items():
            u[k] = u[k] + each * impulse
    a = substitute_back(L, u) / h
    if mechanism.floating:
        q, v = floating_step(q, v, a, h, mechanism.root_center)
    else:
        v = v + h * a
        q = q + h * v
    return {"q": q, "v": v, "impulses": impulses, "residual": _objects([residual])}


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
    return _objects([b for b, _ in found]), _objects([K for _, K in found])


def contact_rows(
    mechanism: Mechanism, spheres: SpheresOnPlane, q: Array
) -> tuple[list[SparseRow], list[Array]]:
    """Return the rows (normal, two tangents) of the lowest point of each sphere, and the gaps [m].

    Entries are in the order of elimination, those of a floating base for velocities in its axes.
    """
    bodies, last = mechanism.bodies, mechanism.nv - 1
    base = mechanism.nv - len(bodies)
    angles = q[len(q) - len(bodies) :]
    axes: Array = np.array(spheres.axes)
    height: Any = -spheres.offset
    if mechanism.floating:
        height = axes[0].dot(q[:3]) - spheres.offset
        axes = axes @ rotation_from_quat(q[3:7])
    # Poses of the bodies, and directions, in the axes of the root.
    R: dict[int, Array] = {ROOT: np.eye(3, dtype=int)}
    p: dict[int, Array] = {ROOT: np.zeros(3, dtype=int)}
    moving = {k for frame in spheres.frames for k in ancestry(mechanism, mechanism.frames[frame].body)}
    for k, body in enumerate(bodies):
        if k in moving:
            placement = Placement.of(body, angles[k])
            R[k] = R[body.parent] @ placement.R
            p[k] = p[body.parent] + rotate(R[body.parent], placement.p)
    rows: list[SparseRow] = []
    gaps: list[Array] = []
    for number, radius in zip(spheres.frames, spheres.radii, strict=True):
        frame = mechanism.frames[number]
        center = p[frame.body] + rotate(R[frame.body], frame.p)
        point = center - radius * axes[0]
        gaps.append(height + axes[0].dot(center) - radius)
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


def _in_fixed_axes(mechanism: Mechanism, v: Array, h: float) -> Array:
    """Return v (nv,), with a base's velocity as it would be after a step without acceleration of its
    components, in axes that do not rotate with the base."""
    if not mechanism.floating:
        return v
    omega = v[3:6]
    turned = cross(omega, v[:3]) + cross(omega, cross(omega, mechanism.root_center))
    return np.concatenate([v[:3] + h * turned, v[3:]])


def _contact_impulses(
    spheres: SpheresOnPlane,
    sweeps: Sweeps,
    eliminated: EliminatedRows,
    c: Array,
    impulses: Array,
    repeat: Repeat,
) -> tuple[Array, Any]:
    """Return the impulses (m,) for velocities c (m,) without impulses, and the largest residual [m/s]."""
    sets = spheres.sets
    G = eliminated.delassus_matrix()
    g = scales(sets, G)
    limits, floors = [spheres.friction] * len(sets.disks), [0.0] * sets.size

    def next_state(state: Numbers) -> Numbers:
        x, w, change = state["impulses"], state["velocities"], 0.0
        for _ in range(SWEEPS_PER_TEST):
            x, w, change = sweep(sets, G, g, limits, floors, x, w)
        goes_on = less(sweeps.tolerance, change)
        return {"impulses": x, "velocities": w, "goes_on": _objects([goes_on])}

    start = {"impulses": impulses, "velocities": c + G @ impulses, "goes_on": _objects([1.0])}
    state = repeat(next_state, start, -(-sweeps.most // SWEEPS_PER_TEST))
    found = residuals(sets, g, limits, floors, state["impulses"], state["velocities"])
    return state["impulses"], found.largest


def _objects(numbers: list[Any]) -> Array:
    found = np.empty(len(numbers), dtype=object)
    found[:] = numbers
    return found

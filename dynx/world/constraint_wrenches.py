"""Wrenches of constraints, and torques of joint limits, in the last step of the engine of a world.

Only some engines report them, each in its own way. They follow alike on all from the motion: what moved the
robots and bodies in the step, besides torques, external forces, contacts and joint dynamics, are the
constraints and the joints that reached a limit,

    sum of J' w = M a + bias - everything else,

with the rows of every robot and body that a constraint ties, and the wrenches w as unknowns. It is solved by
least squares, exactly where the engine has solved its own equations. Constraints that do the same, such as
two welds of one body, share a wrench in no way that a motion shows: these have the smallest, and are named
not determined.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from dynx.backends import Backend
from dynx.model import Joint, Model
from dynx.rbd.jacobians import LOCAL, Reference
from dynx.rbd.joint_wrenches import about_world
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, skew
from dynx.steppers.forces import Forces
from dynx.steppers.layout import Anchor, BodyLayout, ConstraintLayout, Layout, Owner, RobotLayout
from dynx.steppers.state import BodyState, WorldState
from dynx.world.boxes import owner_pose
from dynx.world.contacts import Contact

RANK = 1e-9
"""Smallest singular value, relative to the largest, of a direction of the unknown wrenches that counts."""

NEAR_LIMIT = 1e-6
"""Distance [rad or m] from a limit, besides that of one step at the speed, at which a joint may have reached
it."""


class ConstraintWrench(NamedTuple):
    """Wrench of a constraint on both of its ends in a step: force [N], then moment [N m]."""

    kind: str
    """``weld`` or ``point``."""
    a: str
    b: str
    """Names of the parts at the ends."""
    on_a: Floats
    """Wrench (6,) on the part a; the moment of a ``point`` at its own origin is zero."""
    on_b: Floats
    """Wrench (6,) on the part b: the opposite of that on a, at the anchor of b."""
    determined: bool
    """False if other constraints do the same, so that the motion does not show which of them does it."""


@dataclass(frozen=True, eq=False)
class StepRecord:
    """State before a step of the engine, what acted in it, and the state after it."""

    before: WorldState
    forces: Forces
    after: WorldState
    contacts: Sequence[Contact]
    damps_at_end: Sequence[bool]
    """Whether the engine's damping of each robot is that of the velocity at the end of the step."""
    h: float
    accelerations: Sequence[Floats]
    """Acceleration (nv,) of each robot."""
    engines: Sequence[Backend]
    """Backend of each robot."""
    contact_forces: Sequence[Mapping[str, Floats]]
    """Wrenches (6,) of the contacts on links of each robot, about the origin of the world in its axes."""


@dataclass(frozen=True, eq=False)
class Reactions:
    """Wrenches of constraints and torques of joint limits in one step."""

    layout: Layout
    step: StepRecord
    wrenches: Floats
    """Wrench (n, 6) on the end a of each constraint, at its anchor in axes of the world."""
    determined: Sequence[bool]
    limit_torques: Mapping[int, Floats] = field(default_factory=dict)
    """Torque (nv,) of the joint limits by robots with joints at one."""

    def of_constraints(self, reference: Reference) -> tuple[ConstraintWrench, ...]:
        """Return the wrench of each constraint in a reference of the frame of each of its ends."""
        found = []
        for constraint, wrench, determined in zip(
            self.layout.constraints, self.wrenches, self.determined, strict=True
        ):
            on_a = self._expressed(wrench, constraint.a, reference)
            on_b = self._expressed(-wrench, constraint.b, reference)
            found.append(ConstraintWrench(constraint.kind, *constraint.names, on_a, on_b, determined))
        return tuple(found)

    def on_links(self, robot: int) -> Iterator[tuple[str, Floats]]:
        """Yield the links of a robot on which a constraint acts, and the wrench (6,) about the world's
        origin."""
        for constraint, wrench in zip(self.layout.constraints, self.wrenches, strict=True):
            ends = zip((constraint.a, constraint.b), constraint.names, (1.0, -1.0), strict=True)
            for anchor, name, sign in ends:
                if anchor.owner.robot == robot:
                    p = self._pose(anchor)[:3, 3]
                    yield name.partition("/")[2], about_world(sign * wrench, p)

    def _expressed(self, wrench: Floats, anchor: Anchor, reference: Reference) -> Floats:
        T = self._pose(anchor)
        if reference == LOCAL:
            return np.concatenate([T[:3, :3].T @ wrench[:3], T[:3, :3].T @ wrench[3:]])
        return np.asarray(about_world(wrench, T[:3, 3])) if reference == "world" else wrench

    def _pose(self, anchor: Anchor) -> Floats:
        pose: Floats = owner_pose(self.layout, anchor.owner, self.step.before) @ anchor.T
        return pose


def reactions(layout: Layout, in_engine: Layout, step: StepRecord) -> Reactions:
    """Return the wrenches of constraints and the torques of limits in a step; `in_engine` is the layout with
    the joint dynamics that the engine has."""
    count = len(layout.constraints)
    owners = [end.owner for each in layout.constraints for end in (each.a, each.b)]
    limited = {k: _joints_at_limits(robot, step) for k, robot in enumerate(layout.robots)}
    at_limit = {k: joints for k, joints in limited.items() if joints.any()}
    robots = sorted({owner.robot for owner in owners if owner.robot is not None} | at_limit.keys())
    bodies = sorted({owner.body for owner in owners if owner.robot is None and not layout.is_fixed(owner)})
    system = _System(layout, step, robots, bodies)
    for number, constraint in enumerate(layout.constraints):
        system.add_constraint(number, constraint)
    for k in robots:
        system.add_right_side(k, _reaction(in_engine.robots[k], k, step))
        # In the engine a joint with dry friction may stick, by a torque that is not known.
        for coordinate in np.flatnonzero(in_engine.robots[k].coefficients().friction).tolist():
            system.add_torque("friction", k, coordinate)
        for coordinate in np.flatnonzero(at_limit.get(k, np.zeros(0))).tolist():
            system.add_torque("limit", k, coordinate)
    for number in bodies:
        system.add_body(number, _body_reaction(layout, layout.bodies[number], number, step))
    wrenches, determined, torques = system.solve(count)
    return Reactions(layout, step, wrenches, determined, torques)


class _System:
    """Rows of robots and bodies, and columns of constraints and torques, of the equation for reactions."""

    def __init__(
        self, layout: Layout, step: StepRecord, robots: Sequence[int], bodies: Sequence[int]
    ) -> None:
        self._layout, self._step = layout, step
        self._rows: dict[tuple[str, int], slice] = {}
        first = 0
        for k in robots:
            nv = layout.robots[k].model.nv
            self._rows["robot", k] = slice(first, first + nv)
            first += nv
        for number in bodies:
            self._rows["body", number] = slice(first, first + 6)
            first += 6
        self._right = np.zeros(first)
        self._columns: list[Floats] = []
        self._sizes: list[int] = []
        self._torques: list[tuple[str, int, int]] = []

    def add_right_side(self, robot: int, reaction: Floats) -> None:
        self._right[self._rows["robot", robot]] = reaction

    def add_body(self, number: int, reaction: Floats) -> None:
        self._right[self._rows["body", number]] = reaction

    def add_constraint(self, number: int, constraint: ConstraintLayout) -> None:
        """Add the columns of the wrench on the end a; those of the end b are opposite."""
        size = 6 if constraint.kind == "weld" else 3
        block = np.zeros((len(self._right), size))
        for anchor, name, sign in zip(
            (constraint.a, constraint.b), constraint.names, (1.0, -1.0), strict=True
        ):
            row = self._rows.get(self._key(anchor.owner))
            if row is not None:
                block[row] += sign * self._jacobian(anchor, name)[:size].T
        self._columns.append(block)
        self._sizes.append(size)

    def add_torque(self, kind: str, robot: int, coordinate: int) -> None:
        """Add the column of an unknown torque on a coordinate of a robot."""
        column = np.zeros((len(self._right), 1))
        column[self._rows["robot", robot].start + coordinate] = 1.0
        self._columns.append(column)
        self._torques.append((kind, robot, coordinate))

    def solve(self, count: int) -> tuple[Floats, list[bool], dict[int, Floats]]:
        """Return the wrenches (n, 6), whether each is determined, and the torques of limits by robot."""
        A = np.concatenate([*self._columns, np.zeros((len(self._right), 0))], axis=1)
        U, sizes, V = np.linalg.svd(A, full_matrices=False)
        shows = sizes > RANK * sizes.max(initial=0.0)
        U, sizes, V = U[:, shows], sizes[shows], V[shows]
        x = V.T @ ((U.T @ self._right) / sizes)
        blind = 1.0 - np.einsum("ki,ki->i", V, V)
        wrenches, determined, first = np.zeros((count, 6)), [], 0
        for number, size in enumerate(self._sizes):
            wrenches[number, :size] = x[first : first + size]
            determined.append(bool((blind[first : first + size] < RANK).all()))
            first += size
        torques: dict[int, Floats] = {}
        for (kind, robot, coordinate), value in zip(self._torques, x[first:].tolist(), strict=True):
            if kind == "limit":
                nv = self._layout.robots[robot].model.nv
                torques.setdefault(robot, np.zeros(nv))[coordinate] = value
        return wrenches, determined, torques

    @staticmethod
    def _key(owner: Owner) -> tuple[str, int]:
        return ("body", owner.body) if owner.robot is None else ("robot", owner.robot)

    def _jacobian(self, anchor: Anchor, name: str) -> Floats:
        """Return the Jacobian (6, nv or 6) of an anchor at its origin, in axes of the world."""
        T = owner_pose(self._layout, anchor.owner, self._step.before) @ anchor.T
        k = anchor.owner.robot
        if k is None:
            body = self._layout.bodies[anchor.owner.body]
            center = self._step.before.bodies[body.name].T_world_body @ np.array([*body.center, 1.0])
            J = np.eye(6)
            J[:3, 3:] = -skew(T[:3, 3] - center[:3])
            return J
        q = self._step.before.robots[self._layout.robots[k].name].q
        link = name.partition("/")[2]
        engine = self._step.engines[k]
        point = np.linalg.inv(engine.forward_kinematics(q, link)) @ T[:, 3]
        return engine.jacobian(q, link, point=point[:3])


def _first_coordinates(model: Model) -> list[tuple[Joint, int]]:
    """Return the joints with coordinates, each with the index in v of its first."""
    return [(joint, model.coordinate_index(joint.name)) for joint in model.coordinate_joints]


def _joints_at_limits(robot: RobotLayout, step: StepRecord) -> Floats:
    """Return 1 for the coordinates (nv,) of a robot that may have reached a limit in a step, else 0."""
    model = robot.model
    base = 6 if model.floating else 0
    (q, v), (q_after, _) = step.before.robots[robot.name], step.after.robots[robot.name]
    if model.ball_joints:
        turned = step.h * np.array(
            [np.linalg.norm(v[k : k + joint.n_rates]) for joint, k in _first_coordinates(model)]
        )
        (before, lower, upper), (after, _, _) = robot.joint_positions(q), robot.joint_positions(q_after)
        reach = NEAR_LIMIT + turned
        near = (np.minimum(before, after) < lower + reach) | (np.maximum(before, after) > upper - reach)
        found = np.zeros(model.nv)
        for (joint, k), is_near in zip(_first_coordinates(model), near.tolist(), strict=True):
            found[k : k + joint.n_rates] = is_near
        return found
    S = np.eye(model.nv) if model.mechanism.coupling is None else model.mechanism.coupling.matrix()
    reach = NEAR_LIMIT + step.h * abs(S @ v)[base:]
    positions = [model.mechanism.tree_q(each)[7 if base else 0 :] for each in (q, q_after)]
    at_limit = (np.minimum(*positions) < robot.lower + reach) | (np.maximum(*positions) > robot.upper - reach)
    return np.asarray((abs(S).T @ np.concatenate([np.zeros(base), at_limit]) > 0.0).astype(float))


def _reaction(robot: RobotLayout, k: int, step: StepRecord) -> Floats:
    """Return the generalised force (nv,) on a robot that its motion shows besides all that is known.

    `robot` has the joint dynamics that the engine computes.
    """
    (q, v), (_, v_after) = step.before.robots[robot.name], step.after.robots[robot.name]
    a, joints = step.accelerations[k], robot.coefficients()
    tau = step.engines[k].inverse_dynamics(
        q, v, a, external_forces=step.contact_forces[k], force_reference="world"
    )
    tau = tau + joints.armature * a + joints.damping * (v_after if step.damps_at_end[k] else v)
    if joints.springs is not None:
        tau = tau - joints.springs.torque(q)
    for number, given in step.forces.torques:
        if number == k:
            tau = tau - given
    return np.asarray(tau)


def _body_reaction(layout: Layout, body: BodyLayout, number: int, step: StepRecord) -> Floats:
    """Return the force, and the moment about the centre of mass, (6,) in axes of the world, on a body of the
    scene that its motion shows besides all that is known."""
    before, after = step.before.bodies[body.name], step.after.bodies[body.name]
    R, w = before.T_world_body[:3, :3], before.twist[3:]
    center = before.T_world_body[:3, 3] + R @ body.center
    rise = (_center_velocity(body, after) - _center_velocity(body, before)) / step.h
    inertia = R @ body.inertia @ R.T
    moment = inertia @ (after.twist[3:] - w) / step.h + cross(w, inertia @ w)
    found = np.concatenate([body.mass * (rise - layout.gravity), moment])
    if step.forces.wrenches is not None:
        found = found - step.forces.wrenches[number]
    for contact in step.contacts:
        for part, sign in ((contact.a, 1.0), (contact.b, -1.0)):
            if part == body.name:
                force = sign * contact.force
                found -= np.concatenate([force, cross(contact.point - center, force)])
    return found


def _center_velocity(body: BodyLayout, state: BodyState) -> Floats:
    """Return the velocity (3,) of the centre of mass of a body in axes of the world."""
    lever = state.T_world_body[:3, :3] @ body.center
    return np.asarray(state.twist[:3] + cross(state.twist[3:], lever))

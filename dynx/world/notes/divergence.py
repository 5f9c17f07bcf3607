"""Likely causes of a world that diverged: gains, torques, forces, overlaps and light parts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np

from dynx.backends import Backend
from dynx.errors import DynxError, shown
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout, Owner
from dynx.steppers.state import WorldState
from dynx.steppers.stepper import Stepper
from dynx.world.motors import JointLaw
from dynx.world.notes.start_notes import joints_beyond_limits, overlaps_of, unbounded_motions, violations

MIN_SPEED_CHANGE = 100.0
"""Change of a velocity [rad/s or m/s] in one step from which a torque or force is a likely cause."""

MIN_MASS_RATIO = 1e4
"""Ratio of the masses of two bodies that touch from which it is a likely cause."""

MIN_IMPLICIT_RATIO = 2.0
"""Ratio of kd dt + kp dt^2 to the inertia from which a motor at the end of a step is named."""

MAX_CAUSES = 3
"""Largest number of causes in a message."""


class RobotLoad(NamedTuple):
    """Loads on a robot in the last step: the caller's torque, and the law of its motors."""

    robot: int
    dynamics: Backend
    torque: Floats | None
    law: JointLaw | None
    implicit: Floats | None
    """1 for joints whose law holds at the end of the step, 0 for the others (n,)."""


class LastLoads(NamedTuple):
    """Loads of the last step: on robots, and force and moment (6,) on bodies by number."""

    robots: Sequence[RobotLoad]
    wrenches: Mapping[int, Floats]


def likely_causes(
    begun: Stepper, start: WorldState, engine: Stepper, loads: LastLoads, h: float
) -> list[str]:
    """Return what probably made a world diverge in steps of `h` [s], the most likely first.

    `begun` is at the state `start` in which the motion began, `engine` at the last finite state, in which
    overlaps and positions beyond limits may be consequences. Where nothing is conspicuous, a shorter step is
    recommended.
    """
    layout = begun.layout
    try:
        causes = [
            *_gravity(layout, h),
            *_gains_and_torques(layout, start, loads, h),
            *_wrenches(layout, loads, h),
            *_overlaps(begun),
            *(f"{each} at the start" for each in islice(violations(layout, start), 1)),
            *(f"{each} at the start" for each in islice(joints_beyond_limits(layout, start), 1)),
            *_light_parts(engine),
            *unbounded_motions(layout, start),
        ]
        gains = "" if causes else "".join(islice(_implicit_gains(layout, start, loads, h), 1))
    except DynxError:
        # The message of the failure itself matters more than its explanation.
        causes, gains = [], ""
    shorter = f"the step is too long for the motion{gains}; try a smaller dt or more substeps"
    return causes[:MAX_CAUSES] or [shorter]


def _gravity(layout: Layout, h: float) -> Iterator[str]:
    change = h * float(np.linalg.norm(layout.gravity))
    if change > MIN_SPEED_CHANGE:
        yield f"gravity changes velocities by {change:.3g} m/s in one step of {h:.3g} s"


def _gains_and_torques(layout: Layout, state: WorldState, loads: LastLoads, h: float) -> Iterator[str]:
    for load in loads.robots:
        robot = layout.robots[load.robot]
        mobility = _mobility(load.dynamics, robot.model, state.robots[robot.name].q)
        names = robot.model.joint_names
        base = len(mobility) - len(names)
        if load.law is not None and load.implicit is not None and len(names):
            yield from _stiff_gains(robot.name, names, load.law, load.implicit, mobility[base:], h)
        if load.torque is not None and len(mobility):
            change = h * np.abs(load.torque) * mobility
            k = int(np.argmax(change))
            if change[k] > MIN_SPEED_CHANGE:
                where = shown(f"{robot.name}/{names[k - base]}") if k >= base else f"the base of {robot.name}"
                yield (
                    f"the torque of {load.torque[k]:.3g} on {where} changes its velocity by "
                    f"{change[k]:.3g} in one step of {h:.3g} s"
                )


def _stiff_gains(
    robot: str, names: Sequence[str], law: JointLaw, implicit: Floats, mobility: Floats, h: float
) -> Iterator[str]:
    """Yield the joint whose law at the beginning of the step is unstable: h kd + h^2 kp / 2 > 2 inertia."""
    damping = (1.0 - implicit) * h * law.kd * mobility
    stiffness = (1.0 - implicit) * h * h * law.kp * mobility
    k = int(np.argmax(damping + 0.5 * stiffness))
    if damping[k] + 0.5 * stiffness[k] <= 2.0:
        return
    if damping[k] >= 0.5 * stiffness[k]:
        gain, ratio, most = "kd dt", damping[k], 2
    else:
        gain, ratio, most = "kp dt^2", stiffness[k], 4
    yield (
        f"the gains of {shown(f'{robot}/{names[k]}')} are stiff for steps of {h:.3g} s: {gain} is "
        f"{ratio:.3g} times the inertia, and such a motor is unstable above {most}; use a PositionMotor, "
        "which has no such bound, smaller gains or more substeps"
    )


def _implicit_gains(layout: Layout, state: WorldState, loads: LastLoads, h: float) -> Iterator[str]:
    """Yield, for each robot, the motor at the end of a step whose gains are the largest for the inertia.

    It computes the velocity at the end of the step with the other forces of the step before. What these
    change by in a step acts as if there were no motor; the stiffer the gains, the harder the correction.
    """
    for load in loads.robots:
        robot = layout.robots[load.robot]
        names = robot.model.joint_names
        if load.law is None or load.implicit is None or not len(names):
            continue
        mobility = _mobility(load.dynamics, robot.model, state.robots[robot.name].q)[-len(names) :]
        ratio = load.implicit * h * (load.law.kd + h * load.law.kp) * mobility
        k = int(np.argmax(ratio))
        if ratio[k] > MIN_IMPLICIT_RATIO:
            yield (
                f" and the gains of {shown(f'{robot.name}/{names[k]}')} (kd dt + kp dt^2 is {ratio[k]:.3g} "
                "times the inertia)"
            )


def _wrenches(layout: Layout, loads: LastLoads, h: float) -> Iterator[str]:
    for k, wrench in loads.wrenches.items():
        body = layout.bodies[k]
        change = h * float(np.linalg.norm(wrench[:3])) / body.mass
        if change > MIN_SPEED_CHANGE:
            yield f"a force changes the velocity of {shown(body.name)} by {change:.3g} m/s in one step"


def _overlaps(engine: Stepper) -> Iterator[str]:
    for overlap in islice(overlaps_of(engine), 1):
        yield (
            f"{shown(overlap.a)} and {shown(overlap.b)} overlap by {1e3 * overlap.depth:.3g} mm at the start"
        )


def _light_parts(engine: Stepper) -> Iterator[str]:
    """Yield the pair of bodies in contact whose masses differ the most."""
    layout = engine.layout
    worst = (MIN_MASS_RATIO, "", "")
    for point in engine.contacts():
        pair = [
            (mass, layout.colliders[k].name)
            for k in (point.a, point.b)
            if (mass := _mass(layout, layout.colliders[k].owner)) is not None
        ]
        if len(pair) == 2 and min(pair)[0] > 0.0:
            worst = max(worst, (max(pair)[0] / min(pair)[0], min(pair)[1], max(pair)[1]))
    ratio, light, heavy = worst
    if light:
        yield f"{shown(light)} touches {shown(heavy)}, which is {ratio:.2g} times as heavy"


def _mass(layout: Layout, owner: Owner) -> float | None:
    """Return the mass of a body [kg], of a robot that of all its links; None for what is fixed."""
    if layout.is_fixed(owner):
        return None
    if owner.robot is None:
        return layout.bodies[owner.body].mass
    return layout.robots[owner.robot].model.total_mass


def _mobility(dynamics: Backend, model: Model, q: Floats) -> Floats:
    """Return the acceleration of each coordinate (nv,) for a unit of its own torque."""
    M = dynamics.mass_matrix(q)
    return np.asarray(np.linalg.pinv(M, hermitian=True).diagonal().copy() if len(M) else np.zeros(0))

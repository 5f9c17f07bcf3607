"""Wrenches that joints and bases transmit in the rollouts of a batch, from what was recorded of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.argument_types import checks_types
from dynx.backends import backend
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.rbd.jacobians import LOCAL
from dynx.rbd.parameters import plant_model
from dynx.sim.record.rollout import push_wrenches
from dynx.spatial.scalar import Floats
from dynx.world.last_step import MeanAcceleration

if TYPE_CHECKING:
    from dynx.sim.batch_rollouts import BatchRollouts


@checks_types
def joint_wrenches_of(
    rollouts: BatchRollouts,
    *,
    frame: str | None = None,
    reference: str = LOCAL,
    models: Sequence[Model] | None = None,
) -> Floats:
    """Return the wrenches (n, kept - 1, n_joints, 6) [N, N m] that the parents of all joints exert on their
    children in each step from one recorded state to the next.

    They follow from the recorded motion and the pushes of the scenario; row k belongs to the step from
    ``t[k]`` to ``t[k + 1]``. `Backend.joint_wrenches` describes the order, the signs and the options.
    `models` has the robot of each rollout, of which those with `parameters` of their own differ
    (``parametric.parameters.model_of(row)``). Rows of rollouts that were not computed, or diverged, are NaN.

    Raises ArgumentError unless every state was recorded (``record_every=1``), and without the models of
    rollouts that have parameters of their own.
    """
    return _wrenches(rollouts, "joint_wrenches", models, frame=frame, reference=reference)


@checks_types
def base_wrench_of(
    rollouts: BatchRollouts,
    *,
    frame: str | None = None,
    reference: str = LOCAL,
    models: Sequence[Model] | None = None,
) -> Floats:
    """Return the wrench (n, kept - 1, 6) [N, N m] that the world exerts on the root link, besides pushes, in
    each step from one recorded state to the next; see `joint_wrenches_of`."""
    return _wrenches(rollouts, "base_wrench", models, frame=frame, reference=reference)


def _wrenches(
    rollouts: BatchRollouts, quantity: str, models: Sequence[Model] | None, **options: Any
) -> Floats:
    robots, t, dt = _robots_of(rollouts, models), rollouts.t, rollouts.dt
    if len(t) < 2 or not np.allclose(np.diff(t), dt, rtol=1e-6):
        raise ArgumentError(
            f"{len(t)} states of each rollout were recorded; wanted every one: simulate_batch(..., "
            "record_every=1)"
        )
    pushes = rollouts.scenario.all_pushes
    rows = np.isfinite(rollouts.q_record).all(axis=(1, 2)) & np.isfinite(rollouts.v_record).all(axis=(1, 2))
    rows &= rollouts.done & np.isnan(rollouts.diverged)
    found: Floats | None = None
    for robot in dict.fromkeys(robots):
        mine = np.flatnonzero(rows & np.array([each is robot or each == robot for each in robots]))
        q, v = rollouts.q_record[mine], rollouts.v_record[mine]
        a = _accelerations(robot, q, v, dt)
        with backend("reference", robot) as engine:
            forces = push_wrenches(engine, pushes, t, q[:, :-1])
            evaluate = getattr(engine, quantity)
            given = {"external_forces": forces, "force_reference": "world"}
            wrenches = evaluate(q[:, :-1], v[:, :-1], a, **given, **options)
        if found is None:
            found = np.full((len(rollouts), *wrenches.shape[1:]), np.nan)
        found[mine] = wrenches
    assert found is not None
    return found


def _accelerations(model: Model, q: Floats, v: Floats, dt: float) -> Floats:
    """Return the accelerations (n, kept - 1, nv) of steps of semi-implicit Euler between states."""
    if not model.floating:
        return np.asarray(np.diff(v, axis=1) / dt)
    between = MeanAcceleration(model, dt)
    n, kept = q.shape[:2]
    found = np.zeros((n, kept - 1, model.nv))
    for row in range(n):
        for k in range(kept - 1):
            found[row, k] = between(q[row, k], v[row, k], q[row, k + 1], v[row, k + 1])
    return found


def _robots_of(rollouts: BatchRollouts, models: Sequence[Model] | None) -> list[Model]:
    """Return the robot of each rollout."""
    scenario, n = rollouts.scenario, len(rollouts)
    if models is None:
        if rollouts.own_parameters is not False:
            why = "have parameters of their own" if rollouts.own_parameters else "may have parameters"
            raise ArgumentError(
                f"the rollouts {why}, which the record does not hold; give models=[...], the robot of each"
            )
        return [plant_model(scenario.model, scenario.payload, scenario.mass_scale)] * n
    robots = list(models)
    names = {tuple(joint.name for joint in robot.joints) for robot in robots}
    if len(robots) != n or len(names) != 1:
        raise ArgumentError(
            f"models are {len(robots)} robots with {len(names)} lists of joints; wanted {n} with one"
        )
    for robot in robots:
        if (robot.nq, robot.base) != (scenario.model.nq, scenario.model.base):
            raise ArgumentError(
                f"{shown(robot)} is no variant of {shown(scenario.model)}, the robot simulated"
            )
    return robots

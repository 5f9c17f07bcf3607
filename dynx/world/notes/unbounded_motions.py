"""Robots whose description puts no bound on an acceleration: a singular mass matrix, and massless gimbals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from dynx.errors import SingularMassMatrixError, shown
from dynx.model import Model
from dynx.model.mechanism import ROOT, Mechanism
from dynx.spatial.scalar import Floats
from dynx.world.layout import Layout, RobotLayout
from dynx.world.notes.conditioning import singular_direction
from dynx.world.state import WorldState


def unbounded_motions(layout: Layout, state: WorldState) -> Iterator[str]:
    """Yield, for each robot, why its acceleration has no bound at a state or where two of its axes align."""
    for robot in layout.robots:
        model = robot.model
        if not model.mechanism.bodies:
            continue
        found = singular_direction(model, state.robots[robot.name].q)
        if found is not None:
            _, direction = found
            joints = [shown(f"{robot.name}/{name}") for name in main_joints(model, direction)]
            yield (
                f"the mass matrix of {shown(robot.name)} is singular to rounding, because its links have "
                f"almost no inertia about {' and '.join(joints) or 'its base'}"
            )
        elif (axes := _massless_gimbal(model.mechanism)) is not None:
            moving = [joint.name for joint in model.joints if joint.moves]
            first, last = (shown(f"{robot.name}/{moving[k]}") for k in axes)
            yield (
                f"the links between {first} and {last} have no mass, so that the motion has no bound where "
                "the axes of these two joints align"
            )


def refuse_singular_start(robot: RobotLayout, remedy: str) -> None:
    """Raise SingularMassMatrixError, naming the joints and a remedy, if M is singular to rounding at the
    start."""
    if not robot.model.mechanism.bodies:
        return
    found = singular_direction(robot.model, robot.q)
    if found is None:
        return
    condition, direction = found
    if condition * len(direction) * 4.0 * np.finfo(float).eps > 1.0:
        joints = " and ".join(map(shown, main_joints(robot.model, direction))) or "its base"
        raise SingularMassMatrixError(
            f"{robot.model.name} has no unique acceleration at its configuration at the start, because its "
            f"links have almost no inertia about {joints} ({remedy}, start at another configuration, lock "
            "one of the joints, or give the links an inertia)"
        )


def main_joints(model: Model, direction: Floats) -> list[str]:
    """Return the names of the at most two joints that move the most along a `singular_direction`; none where
    the base does."""
    moving = [joint.name for joint in model.joints if joint.moves]
    share = np.abs(direction[len(direction) - len(moving) :])
    return [moving[k] for k in np.argsort(-share)[:2] if share[k] > 0.1]


def _massless_gimbal(mechanism: Mechanism) -> tuple[int, int] | None:
    """Return the first and the last of three revolute joints in series without mass between them."""
    children = Counter(body.parent for body in mechanism.bodies)
    for last, body in enumerate(mechanism.bodies):
        chain = [last]
        while len(chain) < 3 and (parent := mechanism.bodies[chain[-1]].parent) != ROOT:
            inertia = mechanism.bodies[parent].inertia
            if float(inertia.mass) != 0.0 or np.any(inertia.rotational_inertia != 0.0):
                break
            if children[parent] > 1:
                break
            chain.append(parent)
        if len(chain) == 3 and body.revolute and all(mechanism.bodies[k].revolute for k in chain):
            return chain[-1], last
    return None

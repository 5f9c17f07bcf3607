"""Robots whose description puts no bound on an acceleration: a singular mass matrix, and massless gimbals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from dynx.errors import shown
from dynx.model.mechanism import ROOT, Mechanism
from dynx.steppers.conditioning import main_joints, singular_direction
from dynx.steppers.layout import Layout
from dynx.steppers.state import WorldState


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

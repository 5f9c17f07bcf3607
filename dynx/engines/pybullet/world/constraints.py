"""Welds and ball joints of a scene in Bullet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynx.engines.pybullet.world.bodies import BulletBody
from dynx.engines.pybullet.world.client import WorldClient
from dynx.engines.pybullet.world.robot import BulletRobot
from dynx.model.mechanism import ROOT
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation
from dynx.steppers.layout import WORLD, Anchor, ConstraintLayout

NO_BODY = -1
"""Bullet's number of the world as the second body of a constraint."""


def add_constraint(
    client: WorldClient,
    constraint: ConstraintLayout,
    robots: Sequence[BulletRobot],
    bodies: Sequence[BulletBody],
    most: float,
) -> None:
    """Create a constraint with forces up to `most` [N or N m]."""
    ends = [_end(each, robots, bodies) for each in (constraint.a, constraint.b)]
    if ends[0][0] == NO_BODY:
        ends.reverse()
    (body_a, link_a, T_a), (body_b, link_b, T_b) = ends
    engine = client.engine
    kind = engine.JOINT_FIXED if constraint.kind == "weld" else engine.JOINT_POINT2POINT
    number = client.call(
        engine.createConstraint,
        body_a,
        link_a,
        body_b,
        link_b,
        kind,
        [0.0, 0.0, 0.0],
        T_a[:3, 3].tolist(),
        T_b[:3, 3].tolist(),
        quat_from_rotation(T_a[:3, :3]).tolist(),
        quat_from_rotation(T_b[:3, :3]).tolist(),
    )
    client.call(engine.changeConstraint, number, maxForce=most)


def _end(
    anchor: Anchor, robots: Sequence[BulletRobot], bodies: Sequence[BulletBody]
) -> tuple[int, int, Floats]:
    """Return body, link and frame of an anchor; the frame is relative to the link's inertial frame."""
    robot, body = anchor.owner
    if robot is None and body == WORLD:
        return NO_BODY, ROOT, anchor.T
    found = bodies[body].object if robot is None else robots[robot].object
    part = ROOT if robot is None else body
    link = ROOT if part == ROOT else found.links[part]
    return found.body, link, np.linalg.inv(found.inertial_frame(part)) @ anchor.T

"""A robot with two arms, and the check that an engine loads it as the file describes it."""

from __future__ import annotations

import numpy as np

from dynx.loaded import LoadedModel, LoadedRobot
from dynx.loaded.difference import model_difference
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Model, Pose
from dynx.model.tree import Base
from tests.loaded.files import TILTED, loaded

BASES: tuple[Base, ...] = ("fixed", "floating")
BODY = Inertial(1.5, Pose((0.1, 0.2, 0.3), (0.3, 0.2, 0.1)), 0.2, 0.01, 0.02, 0.3, 0.03, 0.4)
NO_LOSSES = JointDynamics()
LOSSES = JointDynamics(0.5, 0.25)


def forked(
    base: Base = "fixed", dynamics: JointDynamics = NO_LOSSES, *, root: str = "trunk", wide: bool = False
) -> Model:
    """Return a rotating arm with a tool on a fixed joint, and a sliding arm.

    The names of both are against the order of the alphabet, and the arm that is deeper comes first in
    the document. `dynamics` are those of the turning arm, which is continuous; a `wide` one has limits, and
    the sliding arm farther ones, that no sample comes near.
    """
    turning = Limits(-9.0, 9.0, 3.0, 40.0) if wide else Limits(velocity=3.0, effort=40.0)
    sliding = Limits(-9.0, 9.0, 2.0, 9.0) if wide else Limits(-0.3, 0.7, 2.0, 9.0)
    links = [Link(name, BODY) for name in (root, "z", "a", "tool")]
    joints = [
        Joint(
            "z_joint",
            "revolute" if wide else "continuous",
            root,
            "z",
            Pose((0.5, 0.0, 0.1), (0.1, 0.2, 0.3)),
            (0.0, 0.6, 0.8),
            turning,
            dynamics,
        ),
        Joint("a_joint", "prismatic", root, "a", Pose((0.0, 0.4, 0.1)), limits=sliding),
        Joint("weld", "fixed", "z", "tool", Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6))),
    ]
    return Model.build("forked", links, joints, base=base, gravity=TILTED)


def check_loaded_as_written(kind: type[LoadedRobot], model: Model) -> LoadedModel:
    """Check that an engine loads a fork that is not wide as the file describes it, and return that."""
    with loaded(kind, model) as robot:
        held = robot.describe()
    assert model_difference(model, [held]) == ()
    assert held.missing_links == ()
    joint = held.joints["z_joint"]
    assert (joint.type, joint.limits, joint.velocity) == ("continuous", (-np.inf, np.inf), 3.0)
    assert held.joints["a_joint"].limits == (-0.3, 0.7)
    assert list(held.gravity) == [0.0, 0.0, -9.81]
    assert held.base_frame.tolist() == np.eye(4).tolist()
    return held

"""Robots for the contract: small, and with something in each that an engine may get wrong."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Mimic, Model, Pose


def body(mass: float, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Inertial:
    """Return a body without symmetry whose centre of mass is at (x, y, z), its axes turned."""
    return Inertial(
        mass,
        Pose((x, y, z), (0.3, -0.2, 0.5)),
        ixx=0.04 * mass,
        iyy=0.05 * mass,
        izz=0.03 * mass,
        ixy=0.004 * mass,
        ixz=-0.003 * mass,
        iyz=0.002 * mass,
    )


LINKS = (
    Link("trunk", body(3.0, 0.1, 0.0, 0.05)),
    Link("zeta", body(1.5, 0.0, 0.1, 0.2)),
    Link("alpha", body(1.0, 0.05, 0.0, -0.1)),
    Link("plate", body(0.4, 0.0, 0.02, 0.0)),
    Link("mid", body(0.8, 0.1, 0.1, 0.0)),
    Link("beta", body(0.6, 0.0, 0.0, 0.15)),
    Link("tool"),
)
# Neither the names nor the order of the document is the depth-first order, and each engine has an
# order of its own: Pinocchio's reader sorts by name, PyBullet goes breadth-first in parts.
JOINTS = (
    Joint(
        "z_shoulder",
        "revolute",
        "trunk",
        "zeta",
        Pose((0.1, 0.2, 0.3), (0.1, 0.2, 0.3)),
        (0.0, 0.6, 0.8),
        Limits(-2.0, 2.5, 3.0, 40.0),
        JointDynamics(0.5, 0.2, 0.1),
    ),
    Joint(
        "a_slide",
        "prismatic",
        "trunk",
        "alpha",
        Pose((-0.1, 0.0, 0.2), (0.0, 0.7, 0.0)),
        (1.0, 0.0, 0.0),
        Limits(-0.3, 0.4, 1.0, 80.0),
        JointDynamics(2.0, 1.0, 0.3),
    ),
    Joint("m_weld", "fixed", "zeta", "plate", Pose((0.0, 0.1, 0.0), (0.4, 0.0, 0.1))),
    Joint(
        "m_wheel",
        "continuous",
        "plate",
        "mid",
        Pose((0.2, 0.0, 0.1), (0.0, -0.5, 0.0)),
        (0.0, 0.0, -1.0),
        dynamics=JointDynamics(0.1, 0.0, 0.05),
    ),
    Joint(
        "b_elbow",
        "revolute",
        "alpha",
        "beta",
        Pose((0.0, 0.0, 0.25), (0.0, 0.0, 1.0)),
        (0.0, 1.0, 0.0),
        Limits(-1.0, 1.0, 2.0, 20.0),
    ),
    Joint("t_weld", "fixed", "mid", "tool", Pose((0.05, -0.02, 0.3), (1.0, 0.5, -0.4))),
)
JOINT_ORDER = ("z_shoulder", "m_wheel", "a_slide", "b_elbow")
LINK_ORDER = ("trunk", "zeta", "plate", "mid", "tool", "alpha", "beta")


def branched() -> Model:
    """Return two branches with every kind of joint and a tilted gravity."""
    return Model.build("branched", LINKS, JOINTS, gravity=(0.3, -0.7, -9.81))


def mimicking() -> Model:
    """`branched` with an elbow that follows the wheel of the other branch."""
    return Model.build("mimicking", LINKS, followed_elbow(2.0, 0.3), gravity=(0.3, -0.7, -9.81))


def followed_elbow(multiplier: float, offset: float) -> list[Joint]:
    """JOINTS in which ``b_elbow = multiplier * m_wheel + offset``."""
    mimic = Mimic("m_wheel", multiplier, offset)
    return [replace(joint, mimic=mimic) if joint.name == "b_elbow" else joint for joint in JOINTS]


def hinge(inertial: Inertial | None, axis: tuple[float, float, float] = (0.0, 1.0, 0.0)) -> Model:
    """Return one link on one hinge."""
    joint = Joint("hinge", "continuous", "ground", "arm", axis=axis)
    return Model.build("hinge", [Link("ground"), Link("arm", inertial)], [joint])


MODELS = {
    "fixed": branched(),
    "floating": branched().with_base("floating"),
    "mimicking": mimicking(),
}
each_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())

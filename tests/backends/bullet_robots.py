"""What the tests of the backend `pybullet` share: robots that try it, and agreement with the reference."""

from __future__ import annotations

from dynx.backends.pybullet import PyBulletBackend
from dynx.backends.reference import ReferenceBackend
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.elements import JointType
from dynx.model.model import Base
from tests.backends.robots import assert_close, motion
from tests.closeness import Closeness, samples_at

BASES: tuple[Base, ...] = ("fixed", "floating")
BOX = Inertial(1.0, Pose((0.1, 0.02, 0.03), (0.3, 0.2, 0.1)), ixx=0.02, iyy=0.03, izz=0.04)


def assert_agrees(model: Model, seed: int = 0, samples: int = 2) -> None:
    """Rigid-body answers as the reference gives them, at random states."""
    q, v, a = motion(model, seed, (samples,))
    with PyBulletBackend(model) as engine:
        reference = ReferenceBackend(model)
        near = Closeness(samples_at(model, q, v, a))
        tau = reference.inverse_dynamics(q, v, a)
        near.check("inverse_dynamics", engine.inverse_dynamics(q, v, a), tau)
        near.check("mass_matrix", engine.mass_matrix(q), reference.mass_matrix(q))
        near.check("gravity_torque", engine.gravity_torque(q), reference.gravity_torque(q))
        assert_close(engine.forward_kinematics(q), reference.forward_kinematics(q))
        for frame in model.frame_names:
            for name in ("local_world_aligned", "local", "world"):
                J = engine.jacobian(q, frame, reference=name)
                assert_close(J, reference.jacobian(q, frame, reference=name), what=f"{frame} {name}")


def assert_solves(model: Model, seed: int = 0, faster: float = 1.0) -> None:
    """Forward dynamics, put into the reference's inverse dynamics, takes the torque asked for."""
    q, v, tau = motion(model, seed, (2,))
    v, tau = faster * v, faster * tau
    with PyBulletBackend(model) as engine:
        a = engine.forward_dynamics(q, v, tau)
    near = Closeness(samples_at(model, q, v, tau=tau))
    near.check_solves(a, ReferenceBackend(model).inverse_dynamics(q, v, a), tau)


def pair(root: Inertial | None, tip: Inertial | None, base: Base, prismatic: bool = False) -> Model:
    """A root, a link that carries the inertial in question, and a sound one beyond it."""
    kind: JointType = "prismatic" if prismatic else "revolute"
    joints = [
        Joint("a", kind, "root", "tip", Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)), (0.6, 0.0, 0.8)),
        Joint("b", "revolute", "tip", "end", Pose((0.0, 0.3, 0.1)), (0.0, 1.0, 0.0)),
    ]
    links = [Link("root", root), Link("tip", tip), Link("end", BOX)]
    return Model.build("pair", links, joints, base=base, gravity=(0.3, -0.7, -9.81))


def clients(engine: PyBulletBackend) -> list[int]:
    """The numbers of the Bullet clients that a backend holds."""
    return [robot._client._client for robot in engine._robots]

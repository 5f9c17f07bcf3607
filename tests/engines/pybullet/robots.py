"""Clients of the backend `pybullet` and checks of agreement with the reference, shared by its tests."""

from __future__ import annotations

from dynx.engines.pybullet.backend import PyBulletBackend
from dynx.model import Model
from dynx.reference.backend import ReferenceBackend
from tests.backends.robots import assert_close, motion
from tests.error_bounds import ErrorBounds, samples_at


def assert_agrees(model: Model, seed: int = 0, samples: int = 2) -> None:
    """Check rigid-body quantities against the reference at random states."""
    q, v, a = motion(model, seed, (samples,))
    with PyBulletBackend(model) as engine:
        reference = ReferenceBackend(model)
        near = ErrorBounds(samples_at(model, q, v, a))
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
    """Check that the reference's inverse dynamics of the computed acceleration returns the applied torque."""
    q, v, tau = motion(model, seed, (2,))
    v, tau = faster * v, faster * tau
    with PyBulletBackend(model) as engine:
        a = engine.forward_dynamics(q, v, tau)
    near = ErrorBounds(samples_at(model, q, v, tau=tau))
    near.check_solves(a, ReferenceBackend(model).inverse_dynamics(q, v, a), tau)


def clients(engine: PyBulletBackend) -> list[int]:
    """Return the numbers of the Bullet clients that a backend holds."""
    return [robot._client.number for robot in engine._robots]

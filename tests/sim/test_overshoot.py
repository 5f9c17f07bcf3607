"""The overshoot of a damped joint is damping times time step over inertia."""

from __future__ import annotations

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.sim.overshoot import largest_overshoot

DT = 1e-3


def test_the_joint_with_the_largest_ratio_is_named() -> None:
    model = dynx.load("ur5")
    q = np.linspace(-1.0, 1.0, 6)
    inertia = np.diagonal(dynx.backend("pinocchio", model).mass_matrix(q))
    kd = np.full(6, 1.0)
    kd[4] = 3.0 * inertia[4] / DT
    kd[2] = 2.0 * inertia[2] / DT
    for controller in (
        control.PD(model, kp=0.0, kd=kd),
        control.FrictionCompensation(control.PD(model, kp=0.0, kd=kd)),
    ):
        found = largest_overshoot(controller, q, DT)
        assert found is not None
        assert found.joint == model.joint_names[4]
        assert found.ratio == pytest.approx(3.0, rel=1e-9)


def test_damping_that_overshoots_nothing_is_none() -> None:
    model = dynx.load("ur5")
    inertia = np.diagonal(dynx.backend("pinocchio", model).mass_matrix(np.zeros(6)))
    slow = control.PD(model, kp=0.0, kd=0.999 * inertia / DT)
    assert largest_overshoot(slow, np.zeros(6), DT) is None
    # Its gains are in 1/s, not in N m s/rad.
    assert largest_overshoot(control.ComputedTorque(model, kp=1.0, kd=1e6), np.zeros(6), DT) is None
    assert largest_overshoot(None, np.zeros(6), DT) is None


def test_damping_of_a_frame_acts_on_a_joint_through_the_jacobian() -> None:
    model = dynx.load("ur5")
    q = np.linspace(-1.0, 1.0, 6)
    frame = model.frame_names[-1]
    engine = dynx.backend("pinocchio", model)
    J = engine.jacobian(q, frame)
    D = np.array([40.0, 50.0, 60.0, 7.0, 8.0, 9.0])
    controller = control.Impedance(model, frame, stiffness=0.0, damping=D, joint_damping=0.5)
    ratio = (np.diagonal(J.T @ np.diag(D) @ J) + 0.5) / np.diagonal(engine.mass_matrix(q))
    dt = 2.0 / ratio.max()
    found = largest_overshoot(controller, q, dt)
    assert found is not None
    assert found.joint == model.joint_names[int(np.argmax(ratio))]
    assert found.ratio == pytest.approx(2.0, rel=1e-9)

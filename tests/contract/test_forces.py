"""Gravity, external forces, and joint dynamics."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dynx.model import Inertial, JointDynamics, Model, Pose
from dynx.rbd.jacobians import REFERENCES
from tests.contract.conftest import Make
from tests.contract.engine_calls import random_state
from tests.contract.robots import branched, each_model, hinge
from tests.error_bounds import ErrorBounds, samples_at

each_reference = pytest.mark.parametrize("reference", REFERENCES)


class TestGravity:
    """Gravity of the model, by default (0, 0, -9.81)."""

    def test_default(self, make: Make) -> None:
        """A point mass at distance d along x on a hinge about y requires the torque m g d."""
        model = hinge(Inertial(2.0, Pose((0.5, 0.0, 0.0))))
        assert model.gravity == (0.0, 0.0, -9.81)
        close = ErrorBounds(samples_at(model, [0.0]))
        close.check("gravity_torque", make(model).gravity_torque([0.0]), np.array([-2.0 * 9.81 * 0.5]))

    @each_model
    def test_any_direction(self, make: Make, model: Model) -> None:
        """The torque is linear in gravity, and without gravity there is none."""
        state = random_state(model, 41, (3,))
        pull = [make(model.with_gravity(9.0 * axis)).gravity_torque(state.q) for axis in np.eye(3)]
        mixed = model.with_gravity((9.0 * 0.2, 9.0 * -0.5, 9.0 * 0.7))
        close = ErrorBounds(samples_at(mixed, state.q))
        wanted = 0.2 * pull[0] - 0.5 * pull[1] + 0.7 * pull[2]
        close.check("gravity_torque", make(mixed).gravity_torque(state.q), wanted)
        nothing = make(model.with_gravity((0.0, 0.0, 0.0)))
        np.testing.assert_array_equal(nothing.gravity_torque(state.q), np.zeros((3, model.nv)))
        np.testing.assert_array_equal(nothing.potential_energy(state.q), np.zeros(3))

    @each_model
    def test_is_inverse_dynamics_at_rest(self, make: Make, model: Model) -> None:
        engine, state = make(model), random_state(model, 42, (3,))
        close = ErrorBounds(samples_at(model, state.q, state.v))
        rest = 0 * state.v
        wanted = engine.inverse_dynamics(state.q, rest, rest)
        close.check("gravity_torque", engine.gravity_torque(state.q), wanted)
        wanted = engine.inverse_dynamics(state.q, state.v, rest)
        close.check("bias_torque", engine.bias_torque(state.q, state.v), wanted)

    @each_model
    def test_does_not_change_kinematics_or_inertia(self, make: Make, model: Model) -> None:
        engine, other = make(model), make(model.with_gravity((5.0, 3.0, 1.0)))
        state = random_state(model, 43, (3,))
        close = ErrorBounds(samples_at(model, state.q, state.v))
        poses = zip(
            engine.forward_kinematics(state.q).swapaxes(0, 1),
            other.forward_kinematics(state.q).swapaxes(0, 1),
            strict=True,
        )
        for mine, theirs in poses:
            close.check("forward_kinematics", theirs, mine)
        close.check("mass_matrix", other.mass_matrix(state.q), engine.mass_matrix(state.q))
        wanted = engine.coriolis_matrix(state.q, state.v)
        close.check("coriolis_matrix", other.coriolis_matrix(state.q, state.v), wanted)


class TestExternalForces:
    """Wrenches on named frames, force then moment, in a reference that is stated."""

    def test_a_force_that_carries_the_weight(self, make: Make) -> None:
        """Up, at the centre of mass, in each reference: it takes gravity off the hinge."""
        model = hinge(Inertial(2.0, Pose((0.5, 0.0, 0.0)))).with_frame(
            "center", "arm", Pose((0.5, 0.0, 0.0), (0.3, 0.4, 0.5))
        )
        engine, q = make(model), np.array([0.7])
        T = engine.forward_kinematics(q, "center")
        up = np.array([0.0, 0.0, 2.0 * 9.81])
        wrenches = {
            "local_world_aligned": [*up, 0, 0, 0],
            "local": [*(T[:3, :3].T @ up), 0, 0, 0],
            "world": [*up, *np.cross(T[:3, 3], up)],
        }
        close = ErrorBounds(samples_at(model, q, wrench=wrenches["world"], frame="center"))
        rest = np.zeros(1)
        for reference, wrench in wrenches.items():
            forces = {"center": wrench}
            tau = engine.inverse_dynamics(q, rest, rest, external_forces=forces, force_reference=reference)
            close.check("inverse_dynamics_external_forces", np.tile(tau, 3), np.zeros(3))
        by_default = engine.inverse_dynamics(
            q, rest, rest, external_forces={"center": wrenches["local_world_aligned"]}
        )
        close.check("inverse_dynamics_external_forces", np.tile(by_default, 3), np.zeros(3))

    @each_model
    @each_reference
    def test_they_enter_by_the_transposed_jacobian(self, make: Make, model: Model, reference: str) -> None:
        engine, state = make(model), random_state(model, 44)
        q, v, a = state.q, state.v, state.a
        wrench = np.array([3.0, -1.0, 2.0, 0.5, -0.4, 0.3])
        forces = {"tool": wrench, "alpha": -0.5 * wrench}
        pushed = sum(
            engine.jacobian(q, frame, reference=reference).T @ each for frame, each in forces.items()
        )
        keywords: dict[str, Any] = {"external_forces": forces, "force_reference": reference}
        close = ErrorBounds(samples_at(model, q, v, a, state.tau, wrench=wrench, frame="tool"))

        def check(got: np.ndarray, free: np.ndarray) -> None:
            wanted = free - pushed
            close.check("inverse_dynamics_external_forces", np.tile(got, 3), np.tile(wanted, 3))

        check(engine.inverse_dynamics(q, v, a, **keywords), engine.inverse_dynamics(q, v, a))
        check(engine.bias_torque(q, v, **keywords), engine.bias_torque(q, v))
        found = engine.forward_dynamics(q, v, state.tau, **keywords)
        close.check_solves(found, engine.inverse_dynamics(q, v, found), state.tau + pushed)

    @each_model
    def test_no_force_is_no_force(self, make: Make, model: Model) -> None:
        engine, state = make(model), random_state(model, 45)
        free = engine.inverse_dynamics(state.q, state.v, state.a)
        for nothing in ({}, None, {"tool": np.zeros(6)}):
            tau = engine.inverse_dynamics(state.q, state.v, state.a, external_forces=nothing)
            np.testing.assert_array_equal(tau, free)


class TestJointDynamics:
    """Off by default; as an option, armature a + damping v + friction sign(v), everywhere alike."""

    @each_model
    def test_terms(self, make: Make, model: Model) -> None:
        engine, state = make(model), random_state(model, 46)
        q, v, a = state.q, state.v, state.a
        speed, push = self.in_the_joints(model, v), self.in_the_joints(model, a)
        lost, extra, M_extra = np.zeros(model.nv), np.zeros(model.nv), np.zeros((model.nv, model.nv))
        for joint in model.joints:
            if not joint.moves:
                continue
            owner = joint.mimic.joint if joint.mimic else joint.name
            ratio = joint.mimic.multiplier if joint.mimic else 1.0
            k, own = model.coordinate_index(owner), joint.dynamics
            w = speed[joint.name]
            lost[k] += ratio * (own.damping * w + own.friction * np.sign(w))
            extra[k] += ratio * own.armature * push[joint.name]
            M_extra[k, k] += ratio**2 * own.armature
        assert np.any(lost)
        assert np.any(extra)
        close = ErrorBounds(samples_at(model, q, v, a, state.tau))
        tau = engine.inverse_dynamics(q, v, a)
        with_them = engine.inverse_dynamics(q, v, a, joint_dynamics=True)
        close.check("inverse_dynamics_joint_dynamics", with_them, tau + lost + extra)
        bias = engine.bias_torque(q, v, joint_dynamics=True)
        close.check("inverse_dynamics_joint_dynamics", bias, engine.bias_torque(q, v) + lost)
        M = engine.mass_matrix(q)
        np.testing.assert_array_equal(engine.mass_matrix(q, joint_dynamics=True), M + M_extra)
        energy = engine.kinetic_energy(q, v, joint_dynamics=True)
        close.check("kinetic_energy", energy, engine.kinetic_energy(q, v) + 0.5 * v @ M_extra @ v)
        found = engine.forward_dynamics(q, v, state.tau, joint_dynamics=True)
        taken = engine.inverse_dynamics(q, v, found, joint_dynamics=True)
        close.check_solves(found, taken, state.tau)

    def test_dry_friction_is_zero_at_rest(self, make: Make) -> None:
        model = branched()
        engine, state = make(model), random_state(model, 47)
        rest = np.zeros(model.nv)
        np.testing.assert_array_equal(
            engine.inverse_dynamics(state.q, rest, rest, joint_dynamics=True),
            engine.inverse_dynamics(state.q, rest, rest),
        )

    def test_an_armature_alone_makes_a_massless_joint_solvable(self, make: Make) -> None:
        bare = hinge(None)
        joint = replace(bare.joints[0], dynamics=JointDynamics(armature=0.5))
        model = Model.build("rotor", bare.links, [joint])
        a = make(model).forward_dynamics([0.3], [0.0], [2.0], joint_dynamics=True)
        np.testing.assert_array_equal(a, [4.0])

    @staticmethod
    def in_the_joints(model: Model, v: np.ndarray) -> dict[str, float]:
        """Return the rate of every moving joint."""
        rates = {name: float(v[model.coordinate_index(name)]) for name in model.joint_names}
        for joint in model.joints:
            if joint.mimic is not None:
                rates[joint.name] = joint.mimic.multiplier * rates[joint.mimic.joint]
        return rates

from __future__ import annotations

import numpy as np
from hypothesis import given

import dynx
from dynx.agreement import tolerances
from dynx.agreement.compared_quantities import compared_quantities
from dynx.agreement.magnitudes import MIN_INERTIA_RATIO, Magnitudes
from dynx.agreement.sampling import draw_samples
from dynx.model import Model
from dynx.reference.backend import ReferenceBackend
from dynx.testing.strategies import models
from tests.agreement.robots import arm

BOUNDS = {
    "forward_kinematics",
    "jacobian",
    "jacobian_derivative",
    "frame_velocity",
    "frame_acceleration",
    "gravity_torque",
    "mass_matrix",
    "kinetic_energy",
    "potential_energy",
    "inertial_regressor",
    "joint_wrenches",
    "joint_wrenches_external_forces",
    "base_wrench",
    "base_wrench_external_forces",
    "center_of_mass",
    "center_of_mass_jacobian",
    "centroidal_momentum",
}
"""Quantities whose natural magnitude is a proven bound."""


@given(models(base="either"))
def test_natural_magnitudes_bound_the_quantities(model: Model) -> None:
    samples = draw_samples(model, 6, 0)
    magnitudes = Magnitudes(samples)
    slack = 1.0 + tolerances.rounding(magnitudes.depth)
    with ReferenceBackend(model) as backend:
        for quantity in compared_quantities():
            if quantity.name in BOUNDS:
                value = np.abs(np.asarray(quantity.evaluate(backend, samples), dtype=float))
                scale = np.asarray(quantity.scale(magnitudes))
                floor = tolerances.rounding(magnitudes.depth) * np.max(scale, initial=0.0)
                assert np.all(value <= 2.0 * scale * slack + floor), quantity.name


@given(models())
def test_frames_move_no_faster_than_the_bounds(model: Model) -> None:
    samples = draw_samples(model, 4, 1)
    magnitudes = Magnitudes(samples)
    with ReferenceBackend(model) as backend:
        for frame in model.frame_names:
            twist = backend.frame_velocity(samples.q, samples.v, frame)
            slack = 1.0 + tolerances.rounding(magnitudes.depth)
            assert np.all(np.linalg.norm(twist[:, 3:], axis=-1) <= 2.0 * magnitudes.angular_speed * slack)
            assert np.all(np.linalg.norm(twist[:, :3], axis=-1) <= 2.0 * magnitudes.speed * slack)


def test_a_tensor_that_violates_the_triangle_inequality_counts_as_a_whole() -> None:
    """0.125 kg m^2 about one oblique axis and none about the others, which no body has."""
    text = """<robot name="spindle"><link name="only"><inertial>
        <origin xyz="0 0 0" rpy="0.7853981633974483 1.5707963267948966 0.7853981633974483"/>
        <mass value="1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0.125"/>
        </inertial></link></robot>"""
    spindle = dynx.load(text, base="floating")
    magnitudes = Magnitudes(draw_samples(spindle, 2, 0))
    np.testing.assert_allclose(magnitudes.sqrt_diagonal[:, 3:] ** 2, 0.125)
    assert dynx.agree(spindle, ["reference", "pinocchio"], samples=2).agree


def test_a_tensor_at_the_triangle_inequality_bounds_a_zero_moment() -> None:
    """A rod has no moment about its axis; `MIN_INERTIA_RATIO` of the tensor counts there."""
    text = """<robot name="rod"><link name="only"><inertial><mass value="1"/>
        <inertia ixx="0.125" ixy="0" ixz="0" iyy="0.125" iyz="0" izz="0"/></inertial></link></robot>"""
    magnitudes = Magnitudes(draw_samples(dynx.load(text, base="floating"), 2, 0))
    np.testing.assert_allclose(magnitudes.sqrt_diagonal[:, 3:5] ** 2, 0.125)
    np.testing.assert_allclose(magnitudes.sqrt_diagonal[:, 5] ** 2, MIN_INERTIA_RATIO * 0.125)


def test_the_lower_bound_holds_for_torques_of_found_accelerations() -> None:
    """A joint about the small moment of such a tensor: the large one is in the rounding of its torque."""
    text = """<robot name="blade"><link name="hub"><inertial><mass value="1"/>
        <inertia ixx="0.125" ixy="0" ixz="0" iyy="0.125" iyz="0" izz="0.125"/></inertial></link>
        <link name="blade"><inertial><mass value="1"/>
        <inertia ixx="0" ixy="0" ixz="0" iyy="0.125" iyz="0" izz="3e-8"/></inertial></link>
        <joint name="spin" type="continuous"><parent link="hub"/><child link="blade"/><axis xyz="0 0 1"/>
        </joint></robot>"""
    blade = dynx.load(text, base="floating")
    samples = draw_samples(blade, 2, 0)
    a = np.zeros((2, 7))
    a[:, 6] = 4e7
    assert (Magnitudes(samples).solved_torque(a) >= 0.125 * 4e7).all()
    assert dynx.agree(blade, ["reference", "pinocchio"], samples=6).agree


def test_a_mimic_joint_moves_with_the_joint_that_it_follows() -> None:
    model = arm()
    sizes = Magnitudes(draw_samples(model, 2, 0))
    assert model.nv < len(model.mechanism.bodies)
    for quantity in compared_quantities():
        assert np.isfinite(quantity.scale(sizes)).all()


def test_the_step_of_derivatives_balances_truncation_against_rounding() -> None:
    """Half and twice that step would give no error that is much smaller."""
    truncation = tolerances.STEP**tolerances.ORDER * tolerances.TRUNCATION
    for depth in (0, 6, 30):
        rounding = tolerances.derivative(depth) - truncation
        for factor in (0.5, 2.0):
            other = truncation * factor**tolerances.ORDER + rounding / factor
            assert tolerances.derivative(depth) < 1.5 * other


def test_a_follower_has_the_position_that_its_joint_gives_it() -> None:
    magnitudes = Magnitudes(draw_samples(arm(), 3, 0))
    model = magnitudes.samples.model
    coupling = model.mechanism.coupling
    assert coupling is not None
    np.testing.assert_array_equal(magnitudes._q_tree, coupling.expand_q(magnitudes.samples.q))
    assert [each.shape for each in magnitudes._joint_q] == [(3,)] * model.mechanism.nv

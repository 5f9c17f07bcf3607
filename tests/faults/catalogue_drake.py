"""Faults in the backend `drake` and in what loads a file with Drake."""

from __future__ import annotations

from tests.faults.fault import Fault

DRAKE = "dynx.engines.drake.backend"
PLANT = "dynx.engines.drake.multibody_plant"
COORDINATES = "dynx.engines.drake.coordinates"
LOADED = "dynx.engines.drake.as_loaded"
DESCRIPTION = "dynx.engines.drake.loaded_description"
SETTINGS = "dynx.engines.drake.settings"
TEST_DRAKE = "tests/engines/drake/test_backend.py"
TEST_COORDINATES = "tests/engines/drake/test_coordinates.py"
TEST_LOADED = "tests/engines/drake/test_as_loaded.py"
FREE_BODY = "tests/oracles/test_closed_forms.py::test_backend_matches_closed_form[free_body-drake]"
REFERENCE = f"{TEST_DRAKE}::test_it_answers_as_the_reference_does"

DRAKE_FAULTS = (
    Fault(
        "drake_linear_before_angular",
        COORDINATES,
        right="_ANGULAR_THEN_LINEAR = (3, 4, 5, 0, 1, 2)",
        wrong="_ANGULAR_THEN_LINEAR = (0, 1, 2, 3, 4, 5)",
        caught_by=f"{TEST_COORDINATES}::test_a_floating_base_is_where_drake_has_it",
    ),
    Fault(
        "drake_turning_of_the_base_sign",
        COORDINATES,
        right="a[:3] += _turning(v)",
        wrong="a[:3] -= _turning(v)",
        caught_by=f"{TEST_LOADED}::test_joints_are_in_the_order_of_dynx[floating]",
    ),
    Fault(
        "drake_gravity_pushes_the_base_up",
        DRAKE,
        right="a[:3] -= self._gravity @ self._coordinates.attitude(q)",
        wrong="a[:3] += self._gravity @ self._coordinates.attitude(q)",
        caught_by=FREE_BODY,
    ),
    Fault(
        "drake_classical_for_spatial_acceleration",
        DRAKE,
        right="acceleration[:3] -= np.cross(velocity.rotational(), velocity.translational())",
        wrong="acceleration[:3] -= 0.0 * velocity.translational()",
        caught_by=f"{REFERENCE}[False-fixed]",
    ),
    Fault(
        "drake_world_point_in_world_axes",
        DRAKE,
        right="point = on_robot.CalcPoseInWorld(context).inverse().translation()",
        wrong="point = -on_robot.CalcPoseInWorld(context).translation()",
        caught_by=f"{REFERENCE}[False-fixed]",
    ),
    Fault(
        "drake_counterweight_adds_to_the_weight",
        PLANT,
        right="_inertia(-largest, nothing)]",
        wrong="_inertia(largest, nothing)]",
        caught_by=(f"{TEST_DRAKE}::test_inertias_that_no_body_can_have_are_used_as_they_stand"),
    ),
    Fault(
        "drake_frames_of_the_next_body",
        PLANT,
        right="np.array([frame.body - ROOT for frame in mechanism.frames], dtype=int)",
        wrong="np.array([frame.body for frame in mechanism.frames], dtype=int)",
        caught_by=f"{REFERENCE}[False-fixed]",
    ),
    Fault(
        "drake_loaded_jacobian_angular_first",
        LOADED,
        right="np.concatenate([J[3:], J[:3]])",
        wrong="np.concatenate([J[:3], J[3:]])",
        caught_by=f"{TEST_LOADED}::test_joints_are_in_the_order_of_dynx[fixed]",
    ),
    Fault(
        "drake_loaded_tensor_about_the_origin",
        DESCRIPTION,
        right="(unit - (center @ center) * np.eye(3) + np.outer(center, center))",
        wrong="(unit + 0.0 * np.outer(center, center))",
        caught_by=f"{TEST_LOADED}::test_what_it_holds_comes_link_by_link[fixed]",
    ),
    Fault(
        "drake_loaded_damping_stays",
        SETTINGS,
        right="joint.set_default_damping_vector(0.0 * joint",
        wrong="joint.set_default_damping_vector(1.0 * joint",
        caught_by=f"{TEST_LOADED}::test_damping_is_in_inverse_dynamics[fixed]",
    ),
    Fault(
        "drake_loaded_inertia_not_per_mass",
        SETTINGS,
        right="np.asarray(stated.second_moment / mass)",
        wrong="np.asarray(stated.second_moment)",
        caught_by=f"{TEST_LOADED}::test_an_inertia_of_no_body_is_replaced",
    ),
)

"""Faults in the backend `pinocchio`."""

from __future__ import annotations

from tests.faults.fault import Fault

PINOCCHIO = "dynx.engines.pinocchio.backend"
COORDINATES = "tests/contract/test_coordinates.py"
REFERENCES = "tests/contract/test_references.py"
FORCES = "tests/contract/test_forces.py"
CLOSED_FORM = "tests/oracles/test_closed_forms.py::test_backend_matches_closed_form"
TEST_PINOCCHIO = "tests/engines/pinocchio/test_backend.py"
NATIVE = f"{TEST_PINOCCHIO}::test_native_answers_are_those_derived_and_those_of_the_reference"

PINOCCHIO_FAULTS = (
    Fault(
        "pinocchio_axis_z_for_y",
        PINOCCHIO,
        right="pin.JointModelPY() if prismatic else pin.JointModelRY()",
        wrong="pin.JointModelPY() if prismatic else pin.JointModelRZ()",
        caught_by=(
            f"{COORDINATES}::test_a_coordinate_moves_what_is_below_its_joint_along_its_axis[pinocchio-fixed]"
        ),
    ),
    Fault(
        "pinocchio_default_gravity",
        PINOCCHIO,
        right="engine.gravity.linear = np.array(model.gravity)",
        wrong="engine.gravity.linear = np.array([0.0, 0.0, -9.81])",
        caught_by=f"{FORCES}::TestGravity::test_any_direction[pinocchio-fixed]",
    ),
    Fault(
        "pinocchio_chain_of_welds_forgotten",
        PINOCCHIO,
        right="T_carrier_joint = T_carrier_parent * _placement(joint.origin)",
        wrong="T_carrier_joint = _placement(joint.origin)",
        caught_by=f"{COORDINATES}::test_at_zero_frames_are_where_the_description_puts_them[pinocchio-fixed]",
    ),
    Fault(
        "pinocchio_inertia_in_the_link_frame",
        PINOCCHIO,
        right="(T_carrier_link * _placement(inertial.origin)).act(own)",
        wrong="T_carrier_link.act(own)",
        caught_by=f"{CLOSED_FORM}[pendulum-pinocchio]",
    ),
    Fault(
        "pinocchio_welded_inertia_unplaced",
        PINOCCHIO,
        right="(T_carrier_link * _placement(inertial.origin)).act(own)",
        wrong="_placement(inertial.origin).act(own)",
        caught_by="tests/contract/test_bodies.py::test_mass_matrix_is_the_sum_over_the_links[pinocchio-fixed]",
    ),
    Fault(
        "pinocchio_state_not_set",
        PINOCCHIO,
        right="        pin.forwardKinematics(self._engine, data, q)\n",
        wrong="",
        caught_by=(
            f"{COORDINATES}::test_a_coordinate_moves_what_is_below_its_joint_along_its_axis[pinocchio-fixed]"
        ),
    ),
    Fault(
        "pinocchio_workspace_shared_by_threads",
        PINOCCHIO,
        right="class _Workspace(local):",
        wrong="class _Workspace:",
        caught_by=f"{TEST_PINOCCHIO}::test_each_thread_has_a_workspace_of_its_own",
    ),
    Fault(
        "pinocchio_references_exchanged",
        PINOCCHIO,
        right='"local": pin.LOCAL,\n            "world": pin.WORLD,',
        wrong='"local": pin.WORLD,\n            "world": pin.LOCAL,',
        caught_by=f"{REFERENCES}::test_local_and_world_follow_from_the_default[pinocchio-fixed]",
    ),
    Fault(
        "pinocchio_spatial_for_classical_acceleration",
        PINOCCHIO,
        right='if reference == "local_world_aligned"',
        wrong='if reference == "none"',
        caught_by=(
            f"{REFERENCES}::test_velocity_and_acceleration_follow_from_the_jacobian"
            "[pinocchio-local_world_aligned-fixed]"
        ),
    ),
    Fault(
        "pinocchio_vector_for_a_jacobian_of_one_column",
        PINOCCHIO,
        right="return J if self._nv > 1 else J.reshape(6, self._nv)",
        wrong="return J",
        caught_by=f"{TEST_PINOCCHIO}::test_a_robot_with_one_joint_or_none_has_arrays_of_the_usual_shapes",
    ),
    Fault(
        "pinocchio_engines_buffer_returned",
        PINOCCHIO,
        right="M: Floats = pin.crba(self._engine, self._workspace.data, q)\n        return M",
        wrong="pin.crba(self._engine, self._workspace.data, q)\n        return self._workspace.data.M",
        caught_by="tests/contract/test_arrays.py::test_answers_belong_to_the_caller[pinocchio-mass_matrix]",
    ),
    Fault(
        "pinocchio_upper_triangle_only",
        PINOCCHIO,
        right="M: Floats = pin.crba(self._engine, self._workspace.data, q)\n        return M",
        wrong="M: Floats = pin.crba(self._engine, self._workspace.data, q)\n        return np.triu(M)",
        caught_by=f"{CLOSED_FORM}[double_pendulum-pinocchio]",
    ),
    Fault(
        "pinocchio_centre_of_what_moves_only",
        PINOCCHIO,
        right="return (self._moving_mass * moving + self._rest_moment) / self._total_mass",
        wrong="return moving",
        caught_by=(
            "tests/contract/test_bodies.py::"
            "test_centre_of_mass_and_gravity_are_those_of_the_links[pinocchio-fixed]"
        ),
    ),
    Fault(
        "pinocchio_energy_of_what_moves_only",
        PINOCCHIO,
        right="return np.asarray(moving + self._rest_energy)",
        wrong="return np.asarray(moving)",
        caught_by=f"{NATIVE}[fixed-False]",
    ),
    Fault(
        "pinocchio_exception_unmapped",
        "dynx.backends.engine_errors",
        right='raise EngineError(f"{engine} failed on {self.model.name}: {gist(error)}") from error',
        wrong="raise",
        caught_by=f"{TEST_PINOCCHIO}::test_what_the_engine_raises_becomes_an_engine_error",
    ),
    Fault(
        "pinocchio_forces_read_from_velocity",
        PINOCCHIO,
        right="tau: Floats = pin.rnea(self._engine, self._workspace.data, q, v, a)",
        wrong="tau: Floats = pin.rnea(self._engine, self._workspace.data, q, 0 * v, a)",
        caught_by=f"{CLOSED_FORM}[double_pendulum-pinocchio]",
    ),
)

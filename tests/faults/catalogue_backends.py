"""Faults in the interface and in the two wrapped engines."""

from __future__ import annotations

from tests.faults.fault import Fault

BASE, ARGUMENTS, EVALUATION = "dynx.backends.base", "dynx.backends.arguments", "dynx.backends.evaluation"
HOOKS, JOINT_DYNAMICS = "dynx.backends.hooks", "dynx.backends.joint_dynamics"
LIFE = "dynx.backends.lifecycle"
PINOCCHIO, PYBULLET, REFERENCE = (
    "dynx.backends.pinocchio",
    "dynx.backends.pybullet",
    "dynx.backends.reference",
)
CLIENT, ROBOT = "dynx.backends.bullet_client", "dynx.backends.bullet_robot"
INERTIA, URDF = "dynx.backends.bullet_inertia", "dynx.backends.bullet_urdf"

COORDINATES = "tests/contract/test_coordinates.py"
REFERENCES = "tests/contract/test_references.py"
FORCES = "tests/contract/test_forces.py"
SHAPES = "tests/contract/test_shapes.py"
LIFECYCLE = "tests/contract/test_lifecycle.py"
CLOSED_FORM = "tests/oracles/test_closed_forms.py::test_backend_matches_closed_form"
TEST_PINOCCHIO = "tests/backends/test_pinocchio.py"
NATIVE = f"{TEST_PINOCCHIO}::test_native_answers_are_those_derived_and_those_of_the_reference"
TEST_PYBULLET = "tests/backends/test_pybullet.py"
BULLET_FREE_BODY = f"{CLOSED_FORM}[free_body-pybullet]"
STEPPER = f"{TEST_PYBULLET}::test_the_stepper_has_no_clamp_limits_motors_or_damping"

INTERFACE_FAULTS = (
    Fault(
        "external_force_sign",
        BASE,
        right="tau = tau - self._force_torque(known, tau, external_forces, force_reference)",
        wrong="tau = tau + self._force_torque(known, tau, external_forces, force_reference)",
        caught_by=f"{FORCES}::TestExternalForces::test_a_force_that_carries_the_weight[reference]",
    ),
    Fault(
        "external_force_missing_in_forward_dynamics",
        BASE,
        right="tau = tau + self._force_torque(q, tau, external_forces, force_reference)",
        wrong="self._force_torque(q, tau, external_forces, force_reference)",
        caught_by=(
            f"{FORCES}::TestExternalForces::test_they_enter_by_the_transposed_jacobian[reference-local-fixed]"
        ),
    ),
    Fault(
        "force_reference_ignored",
        BASE,
        right="for frame, wrench in wrenches.items():\n"
        "            J = self.jacobian(q, frame, reference=reference)",
        wrong="for frame, wrench in wrenches.items():\n            J = self.jacobian(q, frame)",
        caught_by=f"{FORCES}::TestExternalForces::test_a_force_that_carries_the_weight[reference]",
    ),
    Fault(
        "rotor_term_missing",
        BASE,
        right="tau + self._joint_terms.losses(speed) + self._joint_terms.rotor_torque(wanted)",
        wrong="tau + self._joint_terms.losses(speed)",
        caught_by=f"{FORCES}::TestJointDynamics::test_terms[reference-fixed]",
    ),
    Fault(
        "rotors_missing_in_forward_dynamics",
        BASE,
        right="if self._straight and not (joint_dynamics and self._joint_terms.has_rotors):",
        wrong="if self._straight:",
        caught_by=f"{FORCES}::TestJointDynamics::test_terms[reference-fixed]",
    ),
    Fault(
        "damping_drives_the_joint",
        BASE,
        right="tau = tau - self._joint_terms.losses(v)",
        wrong="tau = tau + self._joint_terms.losses(v)",
        caught_by=f"{FORCES}::TestJointDynamics::test_terms[reference-fixed]",
    ),
    Fault(
        "dry_friction_at_rest",
        JOINT_DYNAMICS,
        right="self._friction * np.sign(tree)",
        wrong="self._friction * np.where(tree < 0.0, -1.0, 1.0)",
        caught_by=f"{FORCES}::TestJointDynamics::test_dry_friction_is_zero_at_rest[reference]",
    ),
    Fault(
        "rotor_of_a_follower_scaled_once",
        JOINT_DYNAMICS,
        right="self._S.T @ np.diag(armature) @ self._S",
        wrong="np.diag(self._S.T @ armature)",
        caught_by=(
            "tests/backends/test_base.py::test_joint_dynamics_has_one_meaning_in_every_quantity"
            "[True-fixed-ReferenceBackend]"
        ),
    ),
    Fault(
        "unknown_frame_taken_for_the_last",
        BASE,
        right="except (KeyError, TypeError):\n            return self.model.frame_index(frame)",
        wrong="except (KeyError, TypeError):\n            return len(self._frame_index) - 1",
        caught_by="tests/contract/test_bad_input.py::TestNames::test_frame_in_a_list[reference]",
    ),
    Fault(
        "closed_backend_still_answers",
        ARGUMENTS,
        right="if self.closed:",
        wrong="if self.closed and q is None:",
        caught_by=f"{LIFECYCLE}::test_a_closed_backend_refuses[reference-True]",
    ),
    Fault(
        "closed_backend_without_validation_still_answers",
        LIFE,
        right="            self._validate = True\n            self._arguments.closed = True",
        wrong="            self._arguments.closed = True",
        caught_by=f"{LIFECYCLE}::test_a_closed_backend_refuses[reference-False]",
    ),
    Fault(
        "pickle_forgets_the_options",
        LIFE,
        right="return _rebuild, (type(self), self.model, self._options)",
        wrong="return _rebuild, (type(self), self.model, {})",
        caught_by=f"{LIFECYCLE}::test_pickling_keeps_the_options[reference]",
    ),
    Fault(
        "unnamed_singular_mass_matrix",
        BASE,
        right="self._solvability.refuse_singular(joint_dynamics)",
        wrong="pass",
        caught_by="tests/backends/test_base.py::test_a_joint_that_moves_no_inertia_is_named[ReferenceBackend]",
    ),
    Fault(
        "singular_mass_matrix_solved_all_the_same",
        HOOKS,
        right="if np.all(smallest > M.shape[-1] * np.finfo(np.float64).eps):",
        wrong="if smallest is not None:",
        caught_by="tests/backends/test_hooks.py::test_a_matrix_singular_but_for_rounding_is_not_solved",
    ),
    Fault(
        "derived_mass_matrix_with_gravity_in_it",
        HOOKS,
        right="self._inverse_dynamics(q, rest, rest + unit) - gravity for unit",
        wrong="self._inverse_dynamics(q, rest, rest + unit) for unit",
        caught_by=(
            "tests/backends/test_derived.py::test_derived_answers_are_the_native_ones"
            "[size0-fixed-ReferenceBackend]"
        ),
    ),
    Fault(
        "derived_acceleration_without_the_velocity_product",
        HOOKS,
        right="self._jacobian_derivative(q, v, frame, reference), v\n        )",
        wrong="self._jacobian_derivative(q, v, frame, reference), 0 * v\n        )",
        caught_by=f"{CLOSED_FORM}[double_pendulum-reference]",
    ),
    Fault(
        "batch_off_by_one",
        EVALUATION,
        right="answer[k] = hook(*sample, *args)",
        wrong="answer[k - 1] = hook(*sample, *args)",
        caught_by=f"{SHAPES}::test_a_batch_is_its_samples[pinocchio-mass_matrix-fixed]",
    ),
    Fault(
        "broadcast_by_repeating_the_numbers",
        EVALUATION,
        right="np.broadcast_to(x, (*batch, x.shape[-1])) for x in",
        wrong="np.resize(x, (*batch, x.shape[-1])) for x in",
        caught_by=f"{SHAPES}::test_leading_axes_broadcast[reference-inverse_dynamics-fixed]",
    ),
    Fault(
        "mimic_torque_not_reduced",
        EVALUATION,
        right="return np.asarray(answer @ self._S)",
        wrong="return np.asarray(answer @ (self._S != 0.0))",
        caught_by=f"{COORDINATES}::TestMimicJoints::test_reduced_answers[reference-inverse_dynamics]",
    ),
    Fault(
        "answer_is_a_read_only_view",
        REFERENCE,
        right="return np.array(np.broadcast_to(homogeneous(R, p), (*q.shape[:-1], 4, 4)))",
        wrong="return np.broadcast_to(homogeneous(R, p), (*q.shape[:-1], 4, 4))",
        caught_by=(
            "tests/contract/test_arrays.py::test_answers_belong_to_the_caller[reference-forward_kinematics]"
        ),
    ),
    Fault(
        "unknown_reference_taken_for_the_default",
        ARGUMENTS,
        right="return REFERENCES[reference]\n",
        wrong='return REFERENCES.get(reference, "local_world_aligned")\n',
        caught_by="tests/contract/test_bad_input.py::TestNames::test_reference",
    ),
)

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
        PINOCCHIO,
        right='raise EngineError(f"pinocchio failed on {self.model.name}: {_gist(error)}") from error',
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

PYBULLET_FAULTS = (
    Fault(
        "bullet_base_linear_and_angular_exchanged",
        ROBOT,
        right="X[:3, 3:] = X[3:, :3] = axes.T",
        wrong="X[:3, :3] = X[3:, 3:] = axes.T",
        caught_by=BULLET_FREE_BODY,
    ),
    Fault(
        "bullet_lever_of_the_base_sign",
        ROBOT,
        right="X[3:, 3:] = -axes.T @ skew(center)",
        wrong="X[3:, 3:] = axes.T @ skew(center)",
        caught_by=BULLET_FREE_BODY,
    ),
    Fault(
        "bullet_spatial_for_classical_acceleration",
        ROBOT,
        right="a_C[3:] += cross(v_C[:3], v_C[3:])",
        wrong="a_C[3:] += 0.0",
        caught_by=BULLET_FREE_BODY,
    ),
    Fault(
        "bullet_classical_acceleration_from_the_stepper",
        ROBOT,
        right="a[3:6] -= cross(v_C[:3], v_C[3:])",
        wrong="a[3:6] -= 0.0",
        caught_by=BULLET_FREE_BODY,
    ),
    Fault(
        "bullet_gravity_not_turned_with_the_base",
        ROBOT,
        right="gravity = self._base(q)[1][:3, :3].T @ gravity",
        wrong="gravity = 1.0 * gravity",
        caught_by=BULLET_FREE_BODY,
    ),
    Fault(
        "bullet_torque_before_force",
        ROBOT,
        right="np.concatenate([tau[3:6], tau[:3]])",
        wrong="np.concatenate([tau[:3], tau[3:6]])",
        caught_by=BULLET_FREE_BODY,
    ),
    Fault(
        "bullet_quaternion_conjugated",
        ROBOT,
        right="K[i, 3, k, j], K[i, 3, j, k] = 2.0, -2.0",
        wrong="K[i, 3, k, j], K[i, 3, j, k] = -2.0, 2.0",
        caught_by=f"{COORDINATES}::TestFloatingBase::test_pose_of_the_base[pybullet]",
    ),
    Fault(
        "bullet_link_frame_for_com_frame",
        ROBOT,
        right="T = homogeneous(R, inertia.axes.T @ (frame.p - inertia.center))",
        wrong="T = homogeneous(R, inertia.axes.T @ frame.p)",
        caught_by=f"{COORDINATES}::test_at_zero_frames_are_where_the_description_puts_them[pybullet-fixed]",
    ),
    Fault(
        "bullet_jacobian_point_from_the_com",
        ROBOT,
        right="point = self._inertias[frame.body].axes.T @ frame.p",
        wrong="point = self._inertias[frame.body].axes.T @ (frame.p - self._inertias[frame.body].center)",
        caught_by=f"{REFERENCES}::test_default_is_the_geometric_jacobian[pybullet-fixed]",
    ),
    Fault(
        "bullet_world_reference_shifted_backwards",
        ROBOT,
        right="linear = linear + skew(self.frame_placement(q, frame)[:3, 3]) @ angular",
        wrong="linear = linear - skew(self.frame_placement(q, frame)[:3, 3]) @ angular",
        caught_by=f"{REFERENCES}::test_local_and_world_follow_from_the_default[pybullet-fixed]",
    ),
    Fault(
        "bullet_unit_of_mass_forgotten",
        ROBOT,
        right="tau = tau / self._unit",
        wrong="tau = 1.0 * tau",
        caught_by=f"{TEST_PYBULLET}::test_bodies_heavier_or_lighter_than_bullet_s_checks_foresee",
    ),
    Fault(
        "bullet_extrapolation_left_out",
        PYBULLET,
        right="return 2.0 * once - twice",
        wrong="return once + 0.0 * twice",
        caught_by="tests/contract/test_masses.py::test_impossible_products_of_inertia[pybullet]",
    ),
    Fault(
        "bullet_too_light_for_the_stepper",
        PYBULLET,
        right="            if a.all():",
        wrong="            if a is not None:",
        caught_by=f"{TEST_PYBULLET}::test_a_joint_too_light_for_the_stepper_still_moves",
    ),
    Fault(
        "bullet_motors_left_on",
        CLIENT,
        right="        if self._links:\n            self._ask(\n                self._engine.setJointMotorControlArray,",
        wrong="        if not self._links:\n"
        "            self._ask(\n                self._engine.setJointMotorControlArray,",
        caught_by=f"{STEPPER}[fixed]",
    ),
    Fault(
        "bullet_damping_left_on",
        CLIENT,
        right="linearDamping=0.0,\n            angularDamping=0.0,",
        wrong="linearDamping=0.04,\n            angularDamping=0.04,",
        caught_by=f"{STEPPER}[floating]",
    ),
    Fault(
        "bullet_speed_clamp_left_on",
        CLIENT,
        right="maxJointVelocity=1e300",
        wrong="maxJointVelocity=100.0",
        caught_by=f"{STEPPER}[fixed]",
    ),
    Fault(
        "bullet_time_step_forgotten",
        CLIENT,
        right="fixedTimeStep=1.0",
        wrong="fixedTimeStep=0.5",
        caught_by=f"{CLOSED_FORM}[pendulum-pybullet]",
    ),
    Fault(
        "bullet_state_not_set",
        CLIENT,
        right="        self._reset_joints(joints, None)\n        # Entries 0 and 1 only",
        wrong="        # Entries 0 and 1 only",
        caught_by=f"{LIFECYCLE}::test_no_order_of_calls_changes_an_answer[pybullet]",
    ),
    Fault(
        "bullet_state_of_the_call_before",
        CLIENT,
        right="        self._reset_joints(joints, None)\n        state = self._ask(",
        wrong="        state = self._ask(",
        caught_by=(
            f"{COORDINATES}::test_a_coordinate_moves_what_is_below_its_joint_along_its_axis[pybullet-fixed]"
        ),
    ),
    Fault(
        "bullet_gravity_of_the_call_before",
        CLIENT,
        right="if gravity != self._gravity:",
        wrong="if not self._gravity:",
        caught_by=BULLET_FREE_BODY,
    ),
    Fault(
        "bullet_nan_handed_to_the_engine",
        CLIENT,
        right="if not isfinite(sum(map(sum, numbers))) and not all(isfinite(x) for xs in numbers for x in xs):",
        wrong="if not self._robot:",
        caught_by=f"{TEST_PYBULLET}::test_nan_does_not_poison_the_engine",
    ),
    Fault(
        "bullet_principal_moments_with_the_wrong_steiner_sign",
        INERTIA,
        right="second = second + longdouble(inertia.mass) * (arm @ arm)",
        wrong="second = second - longdouble(inertia.mass) * (arm @ arm)",
        caught_by="tests/backends/test_bullet_inertia.py::test_principal_inertia_rebuilds_the_body",
    ),
    Fault(
        "bullet_negative_moments_rounded_to_zero",
        INERTIA,
        right="values = np.where((values < 0) & (values >= -noise), 0, values)",
        wrong="values = np.where(values < 0, 0, values)",
        caught_by="tests/backends/test_bullet_inertia.py::test_a_negative_moment_needs_ballast",
    ),
    Fault(
        "bullet_children_of_the_root_not_moved_to_its_com",
        URDF,
        right="R, p = root.axes.T @ R, rotate_back(root.axes, p - root.center)",
        wrong="R, p = root.axes.T @ R, rotate_back(root.axes, p)",
        caught_by=(
            f"{COORDINATES}::test_at_zero_frames_are_where_the_description_puts_them[pybullet-floating]"
        ),
    ),
    Fault(
        "bullet_axis_not_scaled_to_one",
        URDF,
        right="axis = body.axis / np.sqrt(body.axis @ body.axis)",
        wrong="axis = 1.0000001 * body.axis",
        caught_by=f"{CLOSED_FORM}[scara-pybullet]",
    ),
    Fault(
        "bullet_client_never_given_back",
        CLIENT,
        right="if engine.isConnected(client):\n        engine.disconnect(client)",
        wrong="engine.isConnected(client)",
        caught_by=f"{TEST_PYBULLET}::test_a_closed_backend_refuses_and_holds_no_client",
    ),
)

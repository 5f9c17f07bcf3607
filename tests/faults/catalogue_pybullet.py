"""Faults in the backend `pybullet`."""

from __future__ import annotations

from tests.faults.fault import Fault

PYBULLET = "dynx.engines.pybullet.backend"
CLIENT = "dynx.engines.pybullet.client"
ROBOT = "dynx.engines.pybullet.robot"
INERTIA = "dynx.engines.pybullet.inertia"
URDF = "dynx.engines.pybullet.canonical_urdf"
COORDINATES = "tests/contract/test_coordinates.py"
REFERENCES = "tests/contract/test_references.py"
LIFECYCLE = "tests/contract/test_lifecycle.py"
CLOSED_FORM = "tests/oracles/test_closed_forms.py::test_backend_matches_closed_form"
TEST_PYBULLET = "tests/engines/pybullet/test_backend.py"
TEST_INERTIAS = "tests/engines/pybullet/test_inertias_of_robots.py"
TEST_LIFECYCLE = "tests/engines/pybullet/test_lifecycle.py"
BULLET_FREE_BODY = f"{CLOSED_FORM}[free_body-pybullet]"
STEPPER = f"{TEST_PYBULLET}::test_the_stepper_has_no_clamp_limits_motors_or_damping"

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
        caught_by=f"{TEST_INERTIAS}::test_bodies_heavier_or_lighter_than_bullet_s_checks_foresee",
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
        caught_by=f"{TEST_INERTIAS}::test_a_joint_too_light_for_the_stepper_still_moves",
    ),
    Fault(
        "bullet_motors_left_on",
        CLIENT,
        right="        if self._links:\n"
        "            self._ask(\n                self._engine.setJointMotorControlArray,",
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
        right="if not isfinite(sum(map(sum, numbers))) and not all(",
        wrong="if not self._robot and not all(",
        caught_by=f"{TEST_LIFECYCLE}::test_nan_does_not_poison_the_engine",
    ),
    Fault(
        "bullet_principal_moments_with_the_wrong_steiner_sign",
        INERTIA,
        right="second = second + longdouble(inertia.mass) * (arm @ arm)",
        wrong="second = second - longdouble(inertia.mass) * (arm @ arm)",
        caught_by="tests/engines/pybullet/test_inertia.py::test_principal_inertia_rebuilds_the_body",
    ),
    Fault(
        "bullet_negative_moments_rounded_to_zero",
        INERTIA,
        right="values = np.where((values < 0) & (values >= -noise), 0, values)",
        wrong="values = np.where(values < 0, 0, values)",
        caught_by="tests/engines/pybullet/test_inertia.py::test_a_negative_moment_needs_ballast",
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
        caught_by=f"{TEST_LIFECYCLE}::test_a_closed_backend_refuses_and_holds_no_client",
    ),
)

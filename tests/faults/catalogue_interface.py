"""Faults in the interface that all backends share, and in what it derives."""

from __future__ import annotations

from tests.faults.fault import Fault

BASE = "dynx.backends.base"
ARGUMENTS = "dynx.backends.arguments"
EVALUATION = "dynx.backends.evaluation"
HOOKS = "dynx.backends.hooks"
JOINT_DYNAMICS = "dynx.backends.joint_dynamics"
LIFE = "dynx.backends.lifecycle"
REFERENCE = "dynx.reference.backend"
COORDINATES = "tests/contract/test_coordinates.py"
REFERENCES = "tests/contract/test_references.py"
FORCES = "tests/contract/test_forces.py"
SHAPES = "tests/contract/test_shapes.py"
LIFECYCLE = "tests/contract/test_lifecycle.py"
CLOSED_FORM = "tests/oracles/test_closed_forms.py::test_backend_matches_closed_form"

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
        right="else np.broadcast_to(x, (*batch, x.shape[-1]))",
        wrong="else np.resize(x, (*batch, x.shape[-1]))",
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

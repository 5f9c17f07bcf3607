"""Faults in the backend `mujoco` and in what loads a file with MuJoCo."""

from __future__ import annotations

from tests.faults.fault import Fault

MUJOCO = "dynx.engines.mujoco.backend"
TREE = "dynx.engines.mujoco.tree"
PROJECTION = "dynx.engines.mujoco.projection"
LOADED = "dynx.engines.mujoco.as_loaded"
LOADED_FILE = "dynx.engines.mujoco.file_loading"
CONTENTS = "dynx.engines.mujoco.loaded_description"
CLOSED_FORM = "tests/oracles/test_closed_forms.py::test_backend_matches_closed_form"
NATIVE = (
    "tests/engines/mujoco/test_backend.py::test_native_answers_are_those_derived_and_those_of_the_reference"
)
TEST_LOADED = "tests/engines/mujoco/test_as_loaded.py"
MUJOCO_FREE_BODY = f"{CLOSED_FORM}[free_body-mujoco]"

MUJOCO_FAULTS = (
    Fault(
        "mujoco_spatial_for_classical_acceleration",
        MUJOCO,
        right="work.a[:3] = work.R[ROOT] @ (a[:3] + np.cross(v[3:6], v[:3]))",
        wrong="work.a[:3] = work.R[ROOT] @ a[:3]",
        caught_by=MUJOCO_FREE_BODY,
    ),
    Fault(
        "mujoco_quaternion_in_the_order_of_dynx",
        MUJOCO,
        right="work.q[3], work.q[4:7] = q[6], q[3:6]",
        wrong="work.q[3:7] = q[3:7]",
        caught_by=MUJOCO_FREE_BODY,
    ),
    Fault(
        "mujoco_force_of_the_base_turned_the_wrong_way",
        MUJOCO,
        right="work.tau[:3] = work.R[ROOT] @ tau[:3]",
        wrong="work.tau[:3] = work.R[ROOT].T @ tau[:3]",
        caught_by=MUJOCO_FREE_BODY,
    ),
    Fault(
        "mujoco_world_reference_at_the_link",
        MUJOCO,
        right='ORIGIN if reference == "world" else work.p[body]',
        wrong='ORIGIN if reference == "local" else work.p[body]',
        caught_by=f"{NATIVE}[fixed-False]",
    ),
    Fault(
        "mujoco_axes_of_the_inertial_forgotten",
        TREE,
        right="_rotation(inertial.origin) @ axes",
        wrong="axes",
        caught_by=f"{NATIVE}[fixed-False]",
    ),
    Fault(
        "mujoco_weight_of_grandchildren_forgotten",
        TREE,
        right="total[compiled.body_parentid[number]] += total[number]",
        wrong="total[compiled.body_parentid[number]] += masses[number]",
        caught_by=f"{NATIVE}[floating-False]",
    ),
    Fault(
        "mujoco_masses_out_of_step_with_rows",
        PROJECTION,
        right="np.repeat(self._mass, 3)",
        wrong="np.tile(self._mass, 3)",
        caught_by=f"{NATIVE}[fixed-False]",
    ),
    Fault(
        "mujoco_lever_from_the_body_to_the_joint",
        PROJECTION,
        right="lever = data.xipos[self._bodies][:, None, :] - anchors",
        wrong="lever = anchors - data.xipos[self._bodies][:, None, :]",
        caught_by=f"{NATIVE}[floating-False]",
    ),
    Fault(
        "mujoco_loaded_attitude_read_before_it_is_known",
        LOADED,
        right="                mujoco.mj_kinematics(self._loaded, data)\n",
        wrong="",
        caught_by=f"{TEST_LOADED}::test_links_fused_or_not_the_answers_are_those_of_the_file[floating]",
    ),
    Fault(
        "mujoco_loaded_mass_matrix_half_turned",
        LOADED,
        right="M[:3] = R.T @ M[:3]",
        wrong="M[:3] = R @ M[:3]",
        caught_by=f"{TEST_LOADED}::test_links_fused_or_not_the_answers_are_those_of_the_file[floating]",
    ),
    Fault(
        "mujoco_loaded_calls_taken_unasked",
        LOADED_FILE,
        right="                if call in calls:",
        wrong="                if calls:",
        caught_by=f"{TEST_LOADED}::test_damping_and_friction_are_in_the_torque",
    ),
    Fault(
        "mujoco_loaded_tensor_in_principal_axes",
        CONTENTS,
        right="inertia=np.asarray((R * loaded.body_inertia[body]) @ R.T)",
        wrong="inertia=np.asarray((R.T * loaded.body_inertia[body]) @ R)",
        caught_by=f"{TEST_LOADED}::test_what_it_holds_is_what_the_file_says",
    ),
)

"""The catalogue: every planted fault. The score is that each is caught (`test_faults_are_caught`)."""

from __future__ import annotations

from tests.faults.catalogue_agreement import AGREEMENT_FAULTS
from tests.faults.catalogue_batch import BATCH_FAULTS
from tests.faults.catalogue_control import CONTROL_FAULTS
from tests.faults.catalogue_doctor import DOCTOR_FAULTS
from tests.faults.catalogue_drake import DRAKE_FAULTS
from tests.faults.catalogue_ik import IK_FAULTS
from tests.faults.catalogue_interface import INTERFACE_FAULTS
from tests.faults.catalogue_model import MODEL_FAULTS
from tests.faults.catalogue_mujoco import MUJOCO_FAULTS
from tests.faults.catalogue_pinocchio import PINOCCHIO_FAULTS
from tests.faults.catalogue_pybullet import PYBULLET_FAULTS
from tests.faults.catalogue_rbd import RBD_FAULTS
from tests.faults.catalogue_reader import READER_FAULTS
from tests.faults.catalogue_records import RECORDS_FAULTS
from tests.faults.catalogue_rules import RULES_FAULTS
from tests.faults.catalogue_sim_command import SIM_COMMAND_FAULTS
from tests.faults.catalogue_simd import SIMD_FAULTS
from tests.faults.catalogue_spatial import SPATIAL_FAULTS
from tests.faults.catalogue_trajectory import TRAJECTORY_FAULTS
from tests.faults.fault import Fault

FAULTS_BY_AREA: dict[str, tuple[Fault, ...]] = {
    "spatial": SPATIAL_FAULTS,
    "rbd": RBD_FAULTS,
    "model": MODEL_FAULTS,
    "reader": READER_FAULTS,
    "interface": INTERFACE_FAULTS,
    "pinocchio": PINOCCHIO_FAULTS,
    "pybullet": PYBULLET_FAULTS,
    "mujoco": MUJOCO_FAULTS,
    "drake": DRAKE_FAULTS,
    "ik": IK_FAULTS,
    "agreement": AGREEMENT_FAULTS,
    "rules": RULES_FAULTS,
    "doctor": DOCTOR_FAULTS,
    "simd": SIMD_FAULTS,
    "trajectory": TRAJECTORY_FAULTS,
    "control": CONTROL_FAULTS,
    "batch": BATCH_FAULTS,
    "records": RECORDS_FAULTS,
    "sim_command": SIM_COMMAND_FAULTS,
}
FAULTS: tuple[Fault, ...] = tuple(fault for faults in FAULTS_BY_AREA.values() for fault in faults)

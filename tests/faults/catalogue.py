"""Every planted fault, by area."""

from __future__ import annotations

from tests.faults.checks import CHECKS_FAULTS
from tests.faults.contacts import CONTACTS_FAULTS
from tests.faults.description import DESCRIPTION_FAULTS
from tests.faults.distance import DISTANCE_FAULTS
from tests.faults.engines import ENGINES_FAULTS
from tests.faults.environments import ENVIRONMENTS_FAULTS
from tests.faults.fault import Fault
from tests.faults.rigid_body import RIGID_BODY_FAULTS
from tests.faults.simulation import SIMULATION_FAULTS
from tests.faults.training import TRAINING_FAULTS
from tests.faults.viewer import VIEWER_FAULTS
from tests.faults.worlds import WORLDS_FAULTS

FAULTS_BY_AREA: dict[str, tuple[Fault, ...]] = {
    "rigid_body": RIGID_BODY_FAULTS,
    "description": DESCRIPTION_FAULTS,
    "engines": ENGINES_FAULTS,
    "checks": CHECKS_FAULTS,
    "contacts": CONTACTS_FAULTS,
    "distance": DISTANCE_FAULTS,
    "environments": ENVIRONMENTS_FAULTS,
    "simulation": SIMULATION_FAULTS,
    "training": TRAINING_FAULTS,
    "viewer": VIEWER_FAULTS,
    "worlds": WORLDS_FAULTS,
}
FAULTS: tuple[Fault, ...] = tuple(fault for faults in FAULTS_BY_AREA.values() for fault in faults)

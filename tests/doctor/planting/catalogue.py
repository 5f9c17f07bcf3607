"""Every planter by the id of its rule, and the rules that have none."""

from __future__ import annotations

from tests.doctor.planting import bodies, dynamics, elements, inertia, joints, shapes, text
from tests.doctor.planting.site import Planter

PLANTERS: dict[str, Planter] = {
    planter.rule: planter
    for family in (inertia, bodies, joints, dynamics, text, elements, shapes)
    for planter in family.PLANTERS
}

EXEMPT: dict[str, str] = {
    "DX112": "MuJoCo up to 3.13 alone; no engine version that is installed has the defect",
    "DX115": "a matter of the call; every trial checks that it is proved beside the planted defects",
    "DX116": "a matter of the call, which is examined on request only",
}
"""Rules without a planter, and the reason."""

"""Documents of earlier versions name classes by modules that have moved."""

from __future__ import annotations

import pytest

from dynx.sim.scenario.documents import _class_of
from dynx.sim.scenario.moved import CLASSES, MODULES, present_name


@pytest.mark.parametrize(
    ("former", "kind"),
    [
        ("dynx.control.engine_motors:EngineMotor", "BulletMotor"),
        ("dynx.control.engine_motors:MotorCommand", "BulletMotorCommand"),
        ("dynx.control.engine_motors:PDMotor", "BulletPDMotor"),
        ("dynx.control.engine_motors:PositionMotor", "BulletPositionMotor"),
        ("dynx.control.engine_motors:TorqueMotor", "BulletTorqueMotor"),
        ("dynx.control.engine_motors:VelocityMotor", "BulletVelocityMotor"),
        ("dynx.control.friction:JointFriction", "JointFriction"),
        ("dynx.sim.plants.disturbances:Push", "ExternalForce"),
        ("dynx.world.scene.material:Material", "Material"),
        ("dynx.world.camera.view:Camera", "Camera"),
        ("dynx.sim.clock:Clock", "Clock"),
        ("dynx.world.state:RobotState", "RobotState"),
        ("dynx.control.pd:PD", "PD"),
    ],
)
def test_classes_are_found_by_their_former_names(former: str, kind: str) -> None:
    assert _class_of(former).__name__ == kind


def test_every_former_name_leads_to_a_class_of_today() -> None:
    for name in (*MODULES, *CLASSES):
        assert present_name(name) != name
    for name in CLASSES.values():
        assert present_name(name) == name
        assert _class_of(name) is not None or name.endswith(":BulletMotor")

"""Mend a description on which the engines disagree."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.bullet import inverse_dynamics
from tests.tasks.robots import ball, fixed, pinocchio_model, revolute, robot, rod
from tests.tasks.task import Task, Wrong, existing, require, require_close


def description() -> str:
    """Return an arm with a link without inertial element and a link with an impossible inertia."""
    impossible = rod("forearm", 1.6, 0.35).replace('izz="0.00016"', 'izz="0.16"')
    return robot(
        "welding_arm",
        '  <link name="base"/>\n',
        rod("upper_arm", 2.5, 0.45),
        impossible,
        '  <link name="adapter"/>\n',
        ball("torch", 0.3, 0.04, "1 0 0 1"),
        revolute("yaw", "base", "upper_arm", "0 0 0.1", axis="0.6 0 0.8"),
        revolute("elbow", "upper_arm", "forearm", "0 0 0.45", axis="0 0.6 0.8"),
        fixed("adapter_mount", "forearm", "adapter", "0 0 0.35"),
        fixed("torch_mount", "adapter", "torch", "0.05 0 0.06"),
    )


def check(folder: Path) -> None:
    """Compare both engines on the mended file, and the mended file with the given one."""
    text = existing(folder, "answer.urdf").read_text()
    given = pinocchio_model(description())
    try:
        mended = pinocchio_model(text)
    except (ValueError, RuntimeError):
        raise Wrong("Pinocchio does not load answer.urdf") from None
    require(list(mended.names) == list(given.names), "the joints are not those of the given file")
    links = {frame.name for frame in given.frames}
    require(links == {frame.name for frame in mended.frames}, "the links are not those of the given file")
    total = abs(pin.computeTotalMass(mended) - pin.computeTotalMass(given))
    require(total < 1e-6, f"the total mass has changed by {total:.2g} kg")
    for inertia in mended.inertias[1:]:
        moments = np.linalg.eigvalsh(inertia.inertia)
        require(moments[0] > 0 and moments[2] <= moments[0] + moments[1] + 1e-12, "an inertia is impossible")
    random = np.random.default_rng(12)
    for _ in range(5):
        q, v, a = random.uniform(-1, 1, (3, 2))
        data, before = mended.createData(), given.createData()
        own = np.array(pin.rnea(mended, data, q, v, a))
        require_close("PyBullet's torque", inverse_dynamics(text, q, v, a), own, 1e-6)
        still = np.array(pin.computeGeneralizedGravity(mended, data, q))
        require_close(
            "gravity torque", still, np.array(pin.computeGeneralizedGravity(given, before, q)), 1e-6
        )
        pin.framesForwardKinematics(mended, data, q)
        pin.framesForwardKinematics(given, before, q)
        pose = [data.oMf[model.getFrameId("torch")] for model, data in ((mended, data), (given, before))]
        require_close("pose of the torch", pose[0].homogeneous, pose[1].homogeneous, 1e-9)


TASK = Task(
    "Mend a robot description",
    """
PyBullet and Pinocchio compute different inverse dynamics from arm.urdf. Two places of the file are to blame.
Mend the file so that both engines agree to 1e-6 N m in every state, each loading the file itself
(PyBullet with a fixed base and URDF_USE_INERTIA_FROM_FILE).
Links, joints, lengths, the total mass and the gravity torques that Pinocchio computes must stay as they are.
Every moment of inertia must be one that a body can have. The inertia of a link may change where the file's
is impossible.

Write answer.urdf.
""",
    check,
    {"arm.urdf": description},
)

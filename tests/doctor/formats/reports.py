"""Reports made by hand, with everything a format has to show."""

from __future__ import annotations

import math

from dynx.agreement.report import LoadFailure
from dynx.doctor.report import (
    Counterexample,
    DoctorReport,
    Effect,
    EngineResult,
    Finding,
    PairError,
    RunTimeCall,
    Unexplained,
)
from dynx.loaded.difference import Deviation

TEXT = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  <!-- the tool has no inertial -->
  <link name="tool">
    <inertial>
      <mass value="1.5"/>
      <inertia ixx="0.1" ixy="0.001" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>
    </inertial>
  </link>
  <joint name="elbow" type="revolute">
    <parent link="base"/>
    <child link="tool"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="0" velocity="1"/>
  </joint>
</robot>
"""

MENDED = TEXT.replace(
    '  <link name="base"/>\n',
    '  <link name="base">\n    <inertial>\n      <mass value="0"/>\n    </inertial>\n  </link>\n',
)

HOSTILE = "<script>alert(1)</script>]]>&\"'\0\x1b[31m\n\u202e\ud800" + "x" * 5000
"""A name with markup, quotes, control characters, a line break, a lone surrogate, and far too long."""

SMALL = '<robot name="r"><link name="a"/></robot>'


def differing(robot: str = "arm", base: str = "fixed", line_shift: int = 0, **names: str) -> DoctorReport:
    """Engines differ by a large cause, by rounding and by something unexplained; one refuses the file.

    `names` overrides ``link``, ``joint`` and ``message``; `line_shift` moves every line.
    """
    link, joint = names.get("link", "base"), names.get("joint", "elbow")
    message = names.get("message", "has no <inertial>")
    found = Counterexample(SMALL, (0.5,), (1.0,), (0.0,), 1, 0.2)
    return DoctorReport(
        robot=robot,
        source=f"{robot}.urdf",
        base=base,
        engines=(
            EngineResult(
                "pinocchio", "4.1.0", "model = pinocchio.buildModelFromUrdf(path)", None, None,
                {"mass_matrix": 1e-16, "inverse_dynamics": 2e-16},
                {"mass_matrix": 1e-16, "inverse_dynamics": 2e-16},
            ),
            EngineResult(
                "pybullet", "3.2.7", "robot = p.loadURDF(path, useFixedBase=True)", None, None,
                {"mass_matrix": 19.0, "inverse_dynamics": 3e-11},
                {"mass_matrix": 4e-16, "inverse_dynamics": 0.25},
            ),
            EngineResult(
                "mujoco", "4.0.0", "model = mujoco.MjModel.from_xml_path(path)",
                "inertia must be positive", None,
                {}, {"mass_matrix": 4e-16},
            ),
        ),
        findings=(
            Finding(
                "DX901", "planted-cause", "difference", link, None, 3 + line_shift, message, ("pybullet",),
                Effect("mass_matrix", 19.0), True, "write an explicit zero inertial",
            ),
            Finding(
                "DX901", "planted-cause", "difference", "tool", None, 5 + line_shift, message,
                ("pybullet", "mujoco"), Effect("mass_matrix", math.inf), True, "write one",
            ),
            Finding(
                "DX902", "planted-rounding", "difference", "tool", None, 8 + line_shift, "is not diagonal",
                ("pybullet",), Effect("inverse_dynamics", 3e-11), True, "diagonalise",
            ),
            Finding("DX903", "planted-practice", "practice", None, joint, 15 + line_shift, "has effort 0"),
        ),
        unexplained=(Unexplained("pybullet", "inverse_dynamics", 0.25, joint, found),),
        residual=0.25,
        tolerance=1e-12,
        samples=6,
        seed=0,
        choices=("DX901: zero was written for the inertia (--choose DX901=keep keeps it)",),
        calls=(RunTimeCall("pybullet", "for link in range(n):\n    p.changeDynamics(robot, link)"),),
        pairs=(
            PairError(("pinocchio", "pybullet"), "mass_matrix", 19.0, {joint: 19.0}),
            PairError(("pinocchio", "pybullet"), "inverse_dynamics", 3e-11, {joint: 3e-11}),
        ),
        model_difference=(
            Deviation("pybullet", "link", link, "mass", 0.0, 1.0),
            Deviation("pybullet", "link", "tool", "center of mass", [0.0, 0.0, 0.1], [0.0, 1e-13, 0.1]),
        ),
        mended=MENDED,
        text=TEXT,
        seconds=1.25,
    )  # fmt: skip


def alike(robot: str = "arm") -> DoctorReport:
    """Return the report of a file that all engines load alike."""
    small = {"mass_matrix": 1e-16}
    return DoctorReport(
        robot=robot,
        source=f"{robot}.urdf",
        base="fixed",
        engines=(
            EngineResult("pinocchio", "4.1.0", "load", None, None, small, small),
            EngineResult("pybullet", "3.2.7", "load", None, None, small, small),
        ),
        pairs=(PairError(("pinocchio", "pybullet"), "mass_matrix", 3e-16),),
        tolerance=1e-12,
        text=TEXT,
    )  # fmt: skip


def refused(robot: str = "broken") -> DoctorReport:
    """Return a robot that could not be read."""
    return DoctorReport(robot, base="fixed", error=LoadFailure("DescriptionError", f"{robot}: no XML"))


def hostile() -> DoctorReport:
    """Engines differ on a robot whose names are hostile."""
    return differing(HOSTILE, link=HOSTILE, joint=HOSTILE, message=HOSTILE)

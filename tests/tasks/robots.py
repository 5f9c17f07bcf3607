"""Robots of the tasks: files of example-robot-data, and descriptions that a task gives as text."""

from importlib.metadata import files
from pathlib import Path
from typing import Any

import pinocchio as pin


def example_robot(name: str) -> Path:
    """Return the path of a URDF file of example-robot-data."""
    for file in files("example-robot-data") or []:
        if file.name == name:
            return Path(str(file.locate())).resolve()
    raise FileNotFoundError(name)


def pinocchio_model(description: Path | str, *, floating: bool = False) -> Any:
    """Return Pinocchio's model of a file or of a URDF text."""
    text = description if isinstance(description, str) else description.read_text()
    if floating:
        return pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    return pin.buildModelFromXML(text)


def rod(name: str, mass: float, length: float, axis: str = "z", color: str = "0.5 0.5 0.6 1") -> str:
    """Return a link: a uniform thin rod that begins at the link's frame."""
    lateral = mass * length**2 / 12
    axial = mass * 1e-4
    origin = {"x": f"{length / 2} 0 0", "z": f"0 0 {length / 2}"}[axis]
    turn = {"x": "0 1.570796326794897 0", "z": "0 0 0"}[axis]
    xx, zz = (axial, lateral) if axis == "x" else (lateral, axial)
    return f"""\
  <link name="{name}">
    <inertial>
      <origin xyz="{origin}"/>
      <mass value="{mass}"/>
      <inertia ixx="{xx:.9g}" iyy="{lateral:.9g}" izz="{zz:.9g}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual>
      <origin xyz="{origin}" rpy="{turn}"/>
      <geometry><cylinder radius="0.02" length="{length}"/></geometry>
      <material name="{name}_color"><color rgba="{color}"/></material>
    </visual>
  </link>
"""


def revolute(name: str, parent: str, child: str, xyz: str, dynamics: str = "", axis: str = "0 1 0") -> str:
    """Return a revolute joint about y that can turn far."""
    return f"""\
  <joint name="{name}" type="revolute">
    <parent link="{parent}"/>
    <child link="{child}"/>
    <origin xyz="{xyz}"/>
    <axis xyz="{axis}"/>
    <limit lower="-20" upper="20" effort="500" velocity="100"/>{dynamics}
  </joint>
"""


def fixed(name: str, parent: str, child: str, xyz: str) -> str:
    """Return a fixed joint."""
    return f"""\
  <joint name="{name}" type="fixed">
    <parent link="{parent}"/>
    <child link="{child}"/>
    <origin xyz="{xyz}"/>
  </joint>
"""


def robot(name: str, *parts: str) -> str:
    """Return a URDF text of these links and joints."""
    return f'<?xml version="1.0"?>\n<robot name="{name}">\n' + "".join(parts) + "</robot>\n"


def two_link_arm(
    masses: tuple[float, float] = (2.0, 1.0),
    lengths: tuple[float, float] = (0.4, 0.3),
    shoulder: str = "",
    elbow: str = "",
    tip: str = '  <link name="tip"/>\n',
) -> str:
    """Return an arm of two rods that hangs from or stands on the world's origin: at zero it points up."""
    return robot(
        "two_link_arm",
        '  <link name="base"/>\n',
        rod("upper_arm", masses[0], lengths[0]),
        rod("forearm", masses[1], lengths[1]),
        tip,
        revolute("shoulder", "base", "upper_arm", "0 0 0", shoulder),
        revolute("elbow", "upper_arm", "forearm", f"0 0 {lengths[0]}", elbow),
        fixed("tip_mount", "forearm", "tip", f"0 0 {lengths[1]}"),
    )


def ball(name: str, mass: float, radius: float, color: str) -> str:
    """Return a link: a small ball, drawn in a colour, with the inertia of a uniform ball."""
    moment = 0.4 * mass * radius**2
    return f"""\
  <link name="{name}">
    <inertial>
      <mass value="{mass}"/>
      <inertia ixx="{moment:.9g}" iyy="{moment:.9g}" izz="{moment:.9g}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual>
      <geometry><sphere radius="{radius}"/></geometry>
      <material name="{name}_color"><color rgba="{color}"/></material>
    </visual>
    <collision><geometry><sphere radius="{radius}"/></geometry></collision>
  </link>
"""


def damping(viscous: float) -> str:
    """Return the element of a joint with viscous damping [N m s/rad]."""
    return f'\n    <dynamics damping="{viscous}" friction="0"/>'


def cart_pole(top: str = '  <link name="top"/>\n') -> str:
    """Return a cart of 1 kg on a rail along x, with a pole of 0.2 kg and 1 m that stands at zero."""
    return robot(
        "cart_pole",
        '  <link name="rail"/>\n',
        """\
  <link name="cart">
    <inertial>
      <mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual>
      <geometry><box size="0.3 0.2 0.1"/></geometry>
      <material name="cart_color"><color rgba="0.2 0.3 0.8 1"/></material>
    </visual>
  </link>
""",
        rod("pole", 0.2, 1.0),
        top,
        """\
  <joint name="slide" type="prismatic">
    <parent link="rail"/>
    <child link="cart"/>
    <axis xyz="1 0 0"/>
    <limit lower="-50" upper="50" effort="100" velocity="100"/>
  </joint>
""",
        revolute("hinge", "cart", "pole", "0 0 0"),
        fixed("top_mount", "pole", "top", "0 0 1"),
    )

"""Small URDF texts shared by the tests of the reader."""

from __future__ import annotations

INERTIAL = """<inertial>
      <origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/>
      <mass value="2.5"/>
      <inertia ixx="0.03" ixy="0.001" ixz="0.002" iyy="0.04" iyz="0.003" izz="0.05"/>
    </inertial>"""


def robot(inside: str, name: str = 'name="test"') -> str:
    """Return a document of one robot; `inside` begins in line 2."""
    return f"<robot {name}>\n{inside}\n</robot>\n"


def joint(inside: str = "", kind: str = "revolute", limit: str = '<limit lower="-1" upper="2"/>') -> str:
    """Return two links, in lines 2 and 3, and a joint between them whose `inside` begins in line 5."""
    return robot(
        '  <link name="a"/>\n  <link name="b"/>\n'
        f'  <joint name="j" type="{kind}"><parent link="a"/><child link="b"/>{limit}\n{inside}\n  </joint>'
    )


def link(inside: str = INERTIAL) -> str:
    """Return a robot of one link; `inside` begins in line 3."""
    return robot(f'  <link name="a">\n{inside}\n  </link>')


def chain(n: int) -> str:
    """Return a chain of `n` links with continuous joints, one element per line."""
    lines = [f'<link name="l{k}"/>' for k in range(n)]
    lines += [
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/></joint>'
        for k in range(n - 1)
    ]
    return robot("\n".join(lines))

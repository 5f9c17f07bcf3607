"""Forward dynamics is not compared where errors that engines are allowed decide its solution."""

from __future__ import annotations

import pytest

from dynx.doctor.examination import draw_states, model_without_mimics, reference_values
from dynx.model.xml.source import XmlSource

LINK = (
    '<link name="{}"><inertial><mass value="{}"/>'
    '<inertia ixx="{}" ixy="0" ixz="0" iyy="{}" iyz="0" izz="{}"/></inertial></link>'
)
HINGE = (
    '<joint name="{0}{1}" type="continuous"><origin xyz="0.1 0.2 0.3"/><parent link="{0}"/>'
    '<child link="{1}"/><axis xyz="0 0 1"/></joint>'
)
BODY, LEAST = (1.0, 0.1, 0.1, 0.1), (2e-15, 1.5e-14, 1.5e-14, 1.5e-14)


@pytest.mark.parametrize(
    ("root", "end", "solvable"),
    [(BODY, BODY, True), (BODY, LEAST, True), (LEAST, BODY, False)],
    ids=["bodies", "least at the end", "least at the root"],
)
def test_forward_dynamics_of_a_floating_pair(
    root: tuple[float, ...], end: tuple[float, ...], solvable: bool
) -> None:
    links = LINK.format("a", *root) + LINK.format("b", *end)
    model = model_without_mimics(
        XmlSource(f'<robot name="r">{links}{HINGE.format("a", "b")}</robot>'), "floating"
    )
    assert reference_values(model, draw_states(model, 3, 0)).solvable == solvable

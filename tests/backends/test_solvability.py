"""The joints that make a mass matrix singular at every configuration."""

from __future__ import annotations

import re

import pytest

from dynx.backends.solvability import singular_coordinates
from dynx.model import Joint, Link, Model, Pose


@pytest.mark.parametrize("count", [1, 6, 7, 9])
def test_joints_without_inertia_are_named_or_counted(count: int) -> None:
    names = [f"massless_{number}" for number in range(count)]
    joints = [Joint(name, "continuous", "base", f"tip_{name}", Pose(), (0.0, 0.0, 1.0)) for name in names]
    model = Model.build("massless", [Link("base"), *(Link(f"tip_{name}") for name in names)], joints)
    found = singular_coordinates(model)
    assert found.alone == tuple(names)
    named = re.findall(r"'(massless_\d)'", found.reason)
    more = [int(each) for each in re.findall(r"and (\d+) more", found.reason)]
    assert named == names[: len(named)]
    assert len(named) + sum(more) == count
    assert len(named) == min(count, 6)

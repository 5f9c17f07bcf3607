"""Real robots in the viewer: a sample of those that are installed."""

from __future__ import annotations

import numpy as np
import pytest

import dynx
from dynx.model.tree import Base
from dynx.viewer import view
from tests.conftest import needs_examples

SAMPLE = ("double_pendulum", "hyq", "tiago", "icub_reduced")


@needs_examples
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", SAMPLE)
def test_real_robots_open_with_everything_switched_on(name: str, base: Base) -> None:
    model = dynx.load(name, base=base)
    with view(model) as viewer:
        for kind in viewer.view._marks.kinds:
            viewer.view._marks.show(kind, True)
        viewer.view.robot.show(visuals=True, collisions=True)
        viewer.view._torques.shown = viewer.view._ellipsoid.shown = True
        q = model.random(0)
        viewer.view.put(q)
        assert np.array_equal(viewer.view.q, q)

"""Real robots in the viewer: a sample here, all of them by ``python -m tests.viewer.test_robots``."""

from __future__ import annotations

import time

import numpy as np
import pytest

import dynx
from dynx.errors import DynxError
from dynx.model.library import EXAMPLE_ROBOT_DATA, robots
from dynx.viewer import view
from tests.conftest import needs_examples

SAMPLE = ("double_pendulum", "hyq", "tiago", "icub_reduced")


def open_robot(name: str, base: str) -> tuple[int, tuple[str, ...]]:
    """Show a robot with everything switched on; return the number of its triangles and its notes."""
    model = dynx.load(name, base=base)  # type: ignore[arg-type]
    with view(model) as viewer:
        for kind in viewer.view._marks.kinds:
            viewer.view._marks.show(kind, True)
        viewer.view.robot.show(visuals=True, collisions=True)
        viewer.view._torques.shown = viewer.view._ellipsoid.shown = True
        q = model.random(0)
        viewer.view.put(q)
        assert np.array_equal(viewer.view.q, q)
        drawn = viewer.view.robot.visuals.values()
        return sum(len(node.faces) for nodes in drawn for node in nodes), viewer.notes


@needs_examples
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", SAMPLE)
def test_real_robots_open(name: str, base: str) -> None:
    open_robot(name, base)


if __name__ == "__main__":
    for entry in robots():
        if entry.source == EXAMPLE_ROBOT_DATA:
            began = time.monotonic()
            try:
                triangles, notes = open_robot(entry.name, "floating")
                print(
                    f"{entry.name}: {triangles} triangles, {time.monotonic() - began:.1f} s", *notes, sep="; "
                )
            except DynxError as error:
                print(f"{entry.name}: {error}")

"""All poses of a robot reach the page in one message, and place its nodes there as they are placed here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import dynx
from dynx.viewer import Viewer
from tests.viewer.conftest import OpenPage, connected, poses_of_nodes, until

MATRICES = """(paths) => {
  const page = window.__viserMutable, world = page?.nodeRefFromName[""];
  const nodes = paths.map((path) => page?.nodeRefFromName[path]);
  if (!world || nodes.some((node) => !node)) return null;
  world.updateMatrixWorld(true);
  const inverse = world.matrixWorld.clone().invert();
  return nodes.map((node) => node.matrixWorld.clone().premultiply(inverse).elements);
}"""
"""Poses of nodes in the world of viser, column by column."""


def places(page: Any, viewer: Viewer) -> bool:
    """Check whether a page has all links where the viewer has placed them."""
    parts = viewer.view.drawn.parts
    found = page.evaluate(MATRICES, [node.name for node in parts.values()])
    if found is None:
        return False
    T = np.array(found).reshape(-1, 4, 4).swapaxes(1, 2)
    # The page computes in single precision.
    return np.allclose(T, [viewer.view.drawn.pose(name) for name in parts], atol=1e-5)


def messages(viewer: Viewer) -> int:
    """Return the number of messages that were sent so far."""
    buffer = viewer.page.scene._websock_interface.get_message_buffer()
    return int(buffer.message_counter)


def test_each_pose_of_a_robot_is_one_message() -> None:
    model = dynx.load("six_axis_arm")
    with model.view() as viewer:
        drawn = viewer.view.robot
        for seed in range(3):
            before = messages(viewer)
            drawn.move(model.random(seed))
            assert messages(viewer) == before + 1
            poses = poses_of_nodes(drawn)
            for name in drawn.parts:
                assert np.allclose(poses[name], drawn.pose(name), rtol=0.0, atol=1e-12)
        before = messages(viewer)
        drawn.move(model.random(2))
        assert messages(viewer) == before


def test_open_pages_later_pages_and_exported_pages_place_the_links(
    open_page: OpenPage, tmp_path: Path
) -> None:
    model = dynx.load("six_axis_arm")
    with model.view(q=model.random(0)) as viewer:
        first = open_page(viewer.url)
        connected(viewer)
        until(lambda: places(first.page, viewer), "the links at the start")
        viewer.update(model.random(1))
        until(lambda: places(first.page, viewer), "the links of the next pose")
        later = open_page(viewer.url)
        until(lambda: places(later.page, viewer), "the links in a page that is opened later")
        viewer.export(tmp_path / "still.html")
        exported = open_page(f"file://{tmp_path}/still.html")
        until(lambda: places(exported.page, viewer), "the links in a page without a server")
        # Nodes of the same names are placed anew where something else is shown.
        viewer.show(dynx.load("scara"), q=dynx.load("scara").random(1))
        until(lambda: places(first.page, viewer), "the links of another robot")
        assert not [*first.errors, *later.errors, *exported.errors]

"""The example of docs/how-to/controls-in-the-viewer.md that reads a joystick moves its world."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import pytest

from dynx.viewer import Viewer
from tests.viewer.conftest import OpenPage, connected, until

PAGE = Path(__file__).parents[2] / "docs/how-to/controls-in-the-viewer.md"


PLACE = """path => {
  const page = window.__viserMutable, world = page?.nodeRefFromName[""], node = page?.nodeRefFromName[path];
  if (!world || !node) return null;
  const place = world.position.clone();
  node.getWorldPosition(place);
  return world.worldToLocal(place).toArray();
}"""
"""Script that returns where the page has a node, in the world [m], and null while it has none."""

# A button, then the axis 0 at the half of its range to the left: time, value, kind, number.
EVENTS = struct.pack("IhBB", 1, 1, 1, 0) + struct.pack("IhBB", 2, -16384, 2, 0)


def test_the_axis_of_a_joystick_pushes_the_cart_that_a_page_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, open_page: OpenPage
) -> None:
    text = PAGE.read_text(encoding="utf-8")
    (code,) = (block for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "js0" in block)
    code = re.sub(r"joystick.write_bytes\(.*?\)\)", lambda _: f"joystick.write_bytes({EVENTS!r})", code)
    code = code.replace("    while world.", "    opened(viewer)\n    while world.")
    code = re.sub(r"assert .*", "driven(viewer, world.state.robots['cart'].q)", code)
    monkeypatch.chdir(tmp_path)
    driven_to = []
    pages = []

    def opened(viewer: Viewer) -> None:
        pages.append(open_page(viewer.url, (400, 300)))
        connected(viewer)

    def driven(viewer: Viewer, q: Any) -> None:
        (joint,) = (
            each for each in viewer.view.world.scene.robot("cart").model.joints if each.name == "slide"
        )
        path = viewer.view.drawn.parts[f"cart/{joint.child}"].name

        def is_there() -> bool:
            place = pages[0].page.evaluate(PLACE, path)
            return place is not None and abs(place[0] - q[0]) < 1e-4

        until(is_there, "the cart in the page")
        driven_to.append(q[0])

    names: dict[str, Any] = {"opened": opened, "driven": driven}
    exec(compile(code, str(PAGE), "exec"), names)
    assert names["axes"] == {0: -16384 / 32767}
    (place,) = driven_to
    assert place < -1.0
    assert not pages[0].errors

"""The example of docs/how-to/controls-in-the-viewer.md that reads a joystick moves its world."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import numpy as np

PAGE = Path(__file__).parents[2] / "docs/how-to/controls-in-the-viewer.md"


def test_the_axis_of_a_joystick_pushes_the_cart(tmp_path: Path) -> None:
    text = PAGE.read_text(encoding="utf-8")
    (code,) = (block for block in re.findall(r"```py\n(.*?)```", text, re.DOTALL) if "js0" in block)
    device = tmp_path / "js0"
    # A button, then the axis 0 at the half of its range to the left: time, value, kind, number.
    device.write_bytes(struct.pack("IhBB", 1, 1, 1, 0) + struct.pack("IhBB", 2, -16384, 2, 0))
    code = code.replace("/dev/input/js0", str(device))
    code = code.replace("while not viewer.wait(0.02):", "for _ in range(20):")
    code += "\n    q = world.state.robots['cart'].q\n"
    names: dict[str, Any] = {}
    code = code.replace("daemon=True).start()", "daemon=True).run()")
    exec(compile(code, str(PAGE), "exec"), names)
    assert names["axes"] == {0: -16384 / 32767}
    assert np.asarray(names["q"])[0] < -0.1

"""The example of docs/how-to/controls-in-the-viewer.md that reads a joystick moves its world."""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

PAGE = Path(__file__).parents[2] / "docs/how-to/controls-in-the-viewer.md"


def test_the_axis_of_a_joystick_pushes_the_cart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = PAGE.read_text(encoding="utf-8")
    (code,) = (block for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "js0" in block)
    # A button, then the axis 0 at the half of its range to the left: time, value, kind, number.
    events = struct.pack("IhBB", 1, 1, 1, 0) + struct.pack("IhBB", 2, -16384, 2, 0)
    code = re.sub(r"joystick.write_bytes\(.*?\)\)", lambda _: f"joystick.write_bytes({events!r})", code)
    code = re.sub(r"assert .*", "q = world.state.robots['cart'].q", code)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(compile(code, str(PAGE), "exec"), names)
    assert names["axes"] == {0: -16384 / 32767}
    assert np.asarray(names["q"])[0] < -1.0

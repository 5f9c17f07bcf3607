"""Settings of engines: checked by name and value, and documented with their defaults."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dynx.errors import ArgumentError, UnknownNameError
from dynx.steppers.registry import world_class
from dynx.steppers.settings import Setting, checked_settings
from dynx.world import Scene, World, box, ground
from tests.world.engines import WORLDS

PAGE = (Path(__file__).parents[2] / "docs" / "world.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("engine", WORLDS)
def test_every_setting_is_documented_with_its_default(engine: str) -> None:
    pytest.importorskip({"drake": "pydrake"}.get(engine, engine))
    for name, setting in world_class(engine).settings.items():
        assert f"| `{engine}` | `{name}` | {setting.default} | {setting.meaning} |" in PAGE


@pytest.mark.parametrize("engine", WORLDS)
def test_every_default_is_valid(engine: str) -> None:
    pytest.importorskip({"drake": "pydrake"}.get(engine, engine))
    known = world_class(engine).settings
    defaults = checked_settings(engine, known, {})
    assert checked_settings(engine, known, defaults) == defaults


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        (Setting(1.0, ""), float("nan")),
        (Setting(1.0, ""), "1"),
        (Setting(1.0, "", least=0.5), 0.1),
        (Setting(1.0, "", most=2.0), 3.0),
        (Setting(1, ""), 1.5),
        (Setting(True, ""), 1),
        (Setting("a", "", choices=("a", "b")), "c"),
        (Setting((1.0, 2.0), ""), (1.0,)),
        (Setting((1.0, 2.0), ""), (1.0, -1.0)),
    ],
)
def test_an_invalid_value_is_refused(setting: Setting, value: object) -> None:
    with pytest.raises(ArgumentError, match="setting x"):
        setting.checked("x", value)


def test_a_setting_reaches_the_engine() -> None:
    scene = Scene("s", bodies=(box("a", (1.0, 1.0, 1.0), mass=1.0),))
    with World(scene, "pybullet", solver_iterations=7) as world:
        assert world.settings["solver_iterations"] == 7
    with pytest.raises(UnknownNameError, match="solver_iterations"):
        World(scene, "pybullet", solver_iteration=7)


def other_value(setting: Setting) -> Any:
    if setting.choices:
        return setting.choices[-1]
    if isinstance(setting.default, bool):
        return not setting.default
    if isinstance(setting.default, tuple):
        return setting.default
    grown = 2 * setting.default or 1
    return min(grown, type(grown)(setting.most)) if setting.most < 1e9 else grown


@pytest.mark.parametrize("engine", WORLDS)
def test_a_world_steps_with_every_setting_changed(engine: str) -> None:
    pytest.importorskip({"drake": "pydrake"}.get(engine, engine))
    scene = Scene("s", bodies=(ground(), box("b", (0.1, 0.1, 0.1), mass=1.0)))
    for name, setting in world_class(engine).settings.items():
        value = other_value(setting)
        with World(scene, engine, **{name: value}) as world:
            assert world.settings[name] == value
            world.step(5)

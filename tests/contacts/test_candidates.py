"""Changes of settings that may explain an error: each is one that its engine takes."""

from __future__ import annotations

import re
from typing import Any

import pytest

from dynx.contacts import CANDIDATES, SettingsChange
from dynx.contacts.candidates import SUBSTEPS
from dynx.steppers.registry import installed_worlds, world_class
from dynx.world import Scene, World, box

NAMES = {"pybullet": "Bullet", "mujoco": "MuJoCo", "drake": "Drake"}
CHANGES = [
    pytest.param(engine, change, id=f"{engine}-{number}")
    for engine, changes in CANDIDATES.items()
    if engine in installed_worlds()
    for number, change in enumerate(changes)
]


@pytest.mark.parametrize(("engine", "change"), CHANGES)
def test_a_change_is_of_settings_that_the_engine_takes(engine: str, change: SettingsChange) -> None:
    settings = world_class(engine).settings
    scene = Scene("s", bodies=(box("brick", (0.1, 0.1, 0.1), mass=1.0),))
    assert change.changes
    for each in change.changes:
        assert each.keys() <= {SUBSTEPS, *settings}
        options: dict[str, Any] = dict(each)
        with World(scene, engine, dt=1e-3, **options) as world:
            for name, value in each.items():
                held = world.substeps if name == SUBSTEPS else world.settings[name]
                assert held == value
                assert name == SUBSTEPS or value != settings[name].default


@pytest.mark.parametrize(("engine", "change"), CHANGES)
def test_the_reason_is_in_sentences_on_this_engine(engine: str, change: SettingsChange) -> None:
    assert re.fullmatch(r"[A-Z].*\.", change.reason)
    assert all(re.match("[A-Z]", sentence) for sentence in re.split(r"\. ", change.reason))
    named = {name for name in NAMES.values() if name in change.reason}
    assert named <= {NAMES[engine]}
    assert named or SUBSTEPS in change.values

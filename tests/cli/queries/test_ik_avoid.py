"""`dynx ik --avoid SCENE`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from dynx.backends import backend
from dynx.cli.shell.main import cli
from dynx.model.loading import load
from dynx.world.scene import read_scene
from dynx.world.scene.scene import MARGIN
from tests.cli.queries.test_evaluate import document


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """A scene with a box in front of the arm."""
    file = tmp_path / "cell.toml"
    file.write_text(
        'schema = "dynx.scene/1"\nname = "cell"\n[[bodies]]\nname = "box"\n'
        "shape = { box = [0.2, 0.2, 0.3] }\npose = [0.45, 0.1, 0.1, 0.0, 0.0, 0.0]\n",
        encoding="utf-8",
    )
    return file


def test_margins_from_a_scene_are_kept(cell: Path) -> None:
    """A box is avoided where that is possible, and named where it is not."""
    options = ["ur5", "--frame", "ee_link", "--backend", "reference", "--avoid", str(cell)]
    beside = document("ik", *options, "--to-pose", "0.45,0.1,0.35", "--margin", "0.02")
    assert beside["status"] == "REACHED"
    avoidance = read_scene(cell).avoidance_for(load("ur5"), margin=0.02)
    assert avoidance.is_clear(backend("reference", load("ur5")), np.array(beside["q"]))
    inside = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "0.45,0.1,0.1,3.14159,0,0"])
    assert inside.exit_code == 1
    assert "in collision" in inside.stdout
    assert "box" in inside.stdout
    refused = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "0.45,0.1,0.35,0,0,0", "--margin", "-1"])
    assert refused.exit_code == 2
    assert "margin is" in refused.stderr
    alone = CliRunner().invoke(cli, ["ik", "ur5", "--to-pose", "0.4,0.1,0.3", "--margin", "0.1"])
    assert alone.exit_code == 2
    assert "give the scene" in alone.stderr


def test_all_solutions_say_which_are_in_collision(cell: Path) -> None:
    options = ["ur5", "--frame", "ee_link", "--backend", "reference", "--all-solutions", "--avoid", str(cell)]
    pose = ["--to-pose", "0.5,0.1,0.4,0,1.57,0"]
    found = document("ik", *options, *pose)
    avoidance = read_scene(cell).avoidance_for(load("ur5"), margin=MARGIN)
    engine = backend("reference", load("ur5"))
    clear = [avoidance.is_clear(engine, np.array(each["q"])) for each in found["solutions"]]
    assert [each["collision"] == "" for each in found["solutions"]] == clear
    assert any(clear)
    assert not all(clear)
    assert found["avoid"] == str(cell)
    shown = CliRunner().invoke(cli, ["ik", *options, *pose])
    assert shown.exit_code == 0
    assert f"{sum(clear)} of {len(clear)} keep all margins" in shown.stdout
    assert shown.stdout.count("  in collision: ") == len(clear) - sum(clear)
    inside = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "0.45,0.1,0.1,0,1.57,0"])
    assert inside.exit_code == 1
    assert "0 of " in inside.stdout

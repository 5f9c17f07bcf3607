"""`dynx ik --avoid SCENE`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from click.testing import CliRunner

from dynx.backends import backend
from dynx.cli.shell.main import cli
from dynx.model.loading import load
from dynx.world.scene import read_scene
from tests.cli.queries.test_evaluate import document


def test_margins_from_a_scene_are_kept(tmp_path: Path) -> None:
    """A box is avoided where that is possible, and named where it is not."""
    file = tmp_path / "cell.toml"
    file.write_text(
        'schema = "dynx.scene/1"\nname = "cell"\n[[bodies]]\nname = "box"\n'
        "shape = { box = [0.2, 0.2, 0.3] }\npose = [0.45, 0.1, 0.1, 0.0, 0.0, 0.0]\n",
        encoding="utf-8",
    )
    options = ["ur5", "--frame", "ee_link", "--backend", "reference", "--avoid", str(file)]
    beside = document("ik", *options, "--to-pose", "0.45,0.1,0.35", "--margin", "0.02")
    assert beside["status"] == "REACHED"
    avoidance = read_scene(file).avoidance_for(load("ur5"), margin=0.02)
    assert avoidance.is_clear(backend("reference", load("ur5")), np.array(beside["q"]))
    inside = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "0.45,0.1,0.1,3.14159,0,0"])
    assert inside.exit_code == 1
    assert "in collision" in inside.stdout
    assert "box" in inside.stdout
    for wrong, message in ((["--all-solutions"], "--avoid chooses"), (["--margin", "-1"], "margin is")):
        refused = CliRunner().invoke(cli, ["ik", *options, "--to-pose", "0.45,0.1,0.35,0,0,0", *wrong])
        assert refused.exit_code == 2
        assert message in refused.stderr
    alone = CliRunner().invoke(cli, ["ik", "ur5", "--to-pose", "0.4,0.1,0.3", "--margin", "0.1"])
    assert alone.exit_code == 2
    assert "give the scene" in alone.stderr

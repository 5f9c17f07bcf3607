"""Documents of `dynx train`, `dynx play` and `dynx env` keep their published schemas."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from dynx.cli.shell.main import cli
from tests.test_schemas import errors

pytest.importorskip("stable_baselines3", reason="needs the extra train")


def test_documents_keep_their_schemas(tmp_path: Path) -> None:
    out = str(tmp_path / "run")
    few = ["--set", "n_steps=16", "--set", "batch_size=32", "--envs", "2", "--episodes", "1"]
    policy = f"{out}/final.zip"
    engines = ["--engine", "reference,compiled"]
    for name, arguments in (
        ("train", ["train", "CartPole", "--engine", "reference", "--steps", "32", "--out", out, *few]),
        ("play", ["play", policy, "--episodes", "1"]),
        ("tasks", ["env", "list"]),
        (
            "env-distance",
            ["env", "distance", "CartPole", *engines, "--seed", "0", "--policy", policy, "--episodes", "1"],
        ),
    ):
        result = CliRunner().invoke(cli, [*arguments, "--json"])
        assert result.exit_code == 0, result.output
        assert errors(name, json.loads(result.stdout)) == []

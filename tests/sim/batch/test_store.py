"""The folder of finished parts of a batch."""

from __future__ import annotations

import os
import time
from pathlib import Path

from dynx.model.loading import load
from dynx.sim import Scenario
from dynx.sim.batch import OutcomeStore


def test_unfinished_files_of_killed_runs_are_cleared(tmp_path: Path) -> None:
    left = tmp_path / f".dynx-{'0' * 16}.part"
    left.write_bytes(b"half")
    long_ago = time.time() - 7 * 24 * 3600
    os.utime(left, (long_ago, long_ago))
    OutcomeStore(tmp_path, Scenario(load("pendulum"), duration=0.1))
    assert not left.exists()

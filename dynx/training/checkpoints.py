"""Checkpoints of a run: the policy with the state of its optimizer, and the replay buffer where there is
one."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, shown
from dynx.files.arrays import read_arrays
from dynx.files.reading import named_file
from dynx.files.writing import atomic_file
from dynx.training.library import read_weights, replay_arrays, restore_replay
from dynx.training.policy import Policy, read_policy_document, scaling_of
from dynx.training.specification import PolicyDocument, TrainingSpec

KEPT = 2
"""Number of checkpoints that are kept: the newest, and the one before should the newest be unreadable."""


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint on the disk."""

    path: Path
    document: PolicyDocument

    @property
    def steps_done(self) -> int:
        """Steps that were done at the checkpoint."""
        return self.document.steps_done

    def restore(self, algorithm: Any, vector: Any) -> None:
        """Let a new algorithm and its environments go on from here."""
        with named_file(self.path) as file:
            read_weights(algorithm, file, str(self.path))
        algorithm.num_timesteps = self.steps_done
        scaling = scaling_of(self.document, vector.observation_space.shape, str(self.path))
        if scaling is not None:
            scaling.give(vector)
        replay = _replay_path(self.path)
        if replay.exists():
            restore_replay(algorithm, read_arrays(replay, "a replay buffer").arrays, str(replay))


class Checkpoints:
    """The checkpoints in a folder, of which the newest `KEPT` are kept."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def add(self, policy: Policy) -> None:
        """Write a checkpoint; it counts only when all of it is on the disk."""
        try:
            self._folder.mkdir(exist_ok=True)
        except OSError as error:
            raise ArgumentError(f"{shown(self._folder, 300)} cannot be made: {error.strerror}") from error
        path = self._folder / f"{policy.steps_done:012d}.zip"
        arrays = replay_arrays(policy.algorithm)
        if arrays is not None:
            with atomic_file(_replay_path(path)) as file:
                np.savez(file, **arrays)  # type: ignore[arg-type]  # the stub takes no dictionary
        policy.save(path)
        for old in self._paths()[:-KEPT]:
            for each in (old, _replay_path(old)):
                with contextlib.suppress(OSError):
                    each.unlink()

    def newest(self, spec: TrainingSpec) -> Checkpoint | None:
        """Return the newest checkpoint that is readable; None if there is none at all.

        The task of a checkpoint is only compared with that of the run, which the caller names.

        Raises ArgumentError if there are checkpoints, and none is readable or of the run.
        """
        problems = []
        for path in reversed(self._paths()):
            try:
                document = read_policy_document(path)
            except ArgumentError as error:
                problems.append(str(error))
                continue
            difference = spec.obstacle_to_continuing(document.spec)
            if difference is None:
                return Checkpoint(path, document)
            problems.append(f"{shown(path, 300)} is of another run: {difference}")
        if problems:
            raise ArgumentError(f"no checkpoint can be used: {'; '.join(problems)}")
        return None

    def _paths(self) -> list[Path]:
        return sorted(self._folder.glob("[0-9]*.zip"))


def _replay_path(path: Path) -> Path:
    return path.with_suffix(".npz")

"""A trained policy: its file, and the action that it takes."""

from __future__ import annotations

import io
import json
import os
import warnings
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx._version import __version__
from dynx.errors import ArgumentError, shown
from dynx.files.documents import convert_document, json_text, to_json_values
from dynx.files.reading import irregularity
from dynx.files.writing import atomic_file
from dynx.training.environments import CLIPPED_AT, make
from dynx.training.library import (
    DummyVecEnv,
    VecNormalize,
    action_of,
    new_algorithm,
    read_weights,
    write_weights,
)
from dynx.training.specification import PolicyDocument, TaskSpec, TrainingSpec

DOCUMENT = "dynx.json"
"""Member of the file of a policy that says what it was trained on; stable-baselines3 ignores it."""

MAX_DOCUMENT = 1_000_000
"""Largest size of that member [bytes]."""

_EPSILON = 1e-8
"""What is added to a variance before its root is taken, as in stable-baselines3."""


@dataclass(frozen=True)
class Scaling:
    """Running mean and variance of observations, and variance of returns, after a number of samples."""

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    return_variance: float
    samples: float

    def __call__(self, observation: NDArray[Any]) -> NDArray[np.float32]:
        """Scale an observation as in training."""
        scaled = (observation - self.mean) / np.sqrt(self.variance + _EPSILON)
        return np.clip(scaled, -CLIPPED_AT, CLIPPED_AT).astype(np.float32)

    @staticmethod
    def of(vector: Any) -> Scaling | None:
        """Return the scaling of environments; None where they have none."""
        if not isinstance(vector, VecNormalize):
            return None
        seen = vector.obs_rms
        return Scaling(seen.mean.copy(), seen.var.copy(), float(vector.ret_rms.var), float(seen.count))

    def give(self, vector: Any) -> None:
        """Let environments of training go on with this scaling."""
        vector.obs_rms.mean, vector.obs_rms.var = self.mean.copy(), self.variance.copy()
        vector.ret_rms.var = np.array(self.return_variance)
        vector.obs_rms.count = vector.ret_rms.count = self.samples


class Policy:
    """A policy that was trained with `spec` for `steps_done` steps.

    Called with one observation, or several (n, ...), it returns as many actions: the likeliest, or random
    ones with `deterministic` False.
    """

    def __init__(
        self, algorithm: Any, spec: TrainingSpec, steps_done: int, scaling: Scaling | None = None
    ) -> None:
        self.algorithm = algorithm
        self.spec = spec
        self.steps_done = steps_done
        self.scaling = scaling

    def __repr__(self) -> str:
        return (
            f"<Policy by {self.spec.algorithm} of {self.spec.task.name}, {self.steps_done:,} steps, "
            f"seed {self.spec.seed}>"
        )

    def __call__(self, observation: NDArray[Any], deterministic: bool = True) -> Any:
        seen = observation if self.scaling is None else self.scaling(observation)
        return action_of(self.algorithm, seen, deterministic)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the policy: a file that stable-baselines3 loads, with its origin added."""
        scaling = self.scaling
        document = PolicyDocument(
            "dynx.policy/1",
            __version__,
            self.spec,
            self.steps_done,
            None if scaling is None else scaling.mean.tolist(),
            None if scaling is None else scaling.variance.tolist(),
            None if scaling is None else scaling.return_variance,
            None if scaling is None else scaling.samples,
        )
        content = io.BytesIO()
        write_weights(self.algorithm, content)
        with zipfile.ZipFile(content, "a") as archive:
            archive.writestr(DOCUMENT, json_text(to_json_values(document)))
        with atomic_file(path) as file:
            file.write(content.getvalue())


def read_policy_document(path: str | os.PathLike[str]) -> PolicyDocument:
    """Read what a file of a policy says about itself.

    Raises ArgumentError for a file that is no policy of dynx.
    """
    where = shown(os.fspath(path), 300)
    if not Path(path).is_file():
        if Path(path, "final.zip").is_file():
            raise ArgumentError(f"{where} is the folder of a run; its policy is {Path(path, 'final.zip')}")
        raise ArgumentError(f"{where}: {irregularity(path) or 'there is no such file'}")
    try:
        with zipfile.ZipFile(path) as archive:
            if DOCUMENT not in archive.namelist():
                raise ArgumentError(f"{where} was not written by dynx train: it does not name its task")
            if archive.getinfo(DOCUMENT).file_size > MAX_DOCUMENT:
                raise ArgumentError(f"{where}: {DOCUMENT} is larger than {MAX_DOCUMENT:,} bytes")
            document = json.loads(archive.read(DOCUMENT))
    except (zipfile.BadZipFile, OSError, ValueError, RecursionError, NotImplementedError) as error:
        if isinstance(error, ArgumentError):
            raise
        raise ArgumentError(f"{where} is damaged, or no policy: {' '.join(str(error).split())}") from error
    try:
        return convert_document(document, PolicyDocument)
    except ArgumentError as error:
        raise ArgumentError(f"{where}: {error}") from error


def load_policy(path: str | os.PathLike[str], task: TaskSpec | None = None) -> Policy:
    """Load a policy, for the task that it was trained on or for `task`, such as the same on another engine.

    Only tensors and JSON are read from the file, so that it runs no code. Raises ArgumentError for a file
    that is no policy, is damaged, or has a policy for other observations or actions.
    """
    document = read_policy_document(path)
    spec = document.spec
    vector = DummyVecEnv([lambda: make(task or spec.task)])
    try:
        with warnings.catch_warnings():
            # Warnings about the number of environments concern training.
            warnings.simplefilter("ignore", UserWarning)
            algorithm = new_algorithm(spec.algorithm, vector, spec.hyperparameters, None)
        with open(path, "rb") as file:
            read_weights(algorithm, file, os.fspath(path))
    except ArgumentError as error:
        if task is None or task.id == spec.task.id:
            raise
        raise ArgumentError(
            f"{error}; it is a policy for {spec.task.id}, whose observations or actions may not be those of "
            f"{task.id}"
        ) from error
    finally:
        vector.close()
    return Policy(algorithm, spec, document.steps_done, scaling_of(document))


def scaling_of(document: PolicyDocument) -> Scaling | None:
    """Return the scaling that a policy was trained with."""
    if document.observation_mean is None or document.observation_variance is None:
        return None
    return Scaling(
        np.array(document.observation_mean),
        np.array(document.observation_variance),
        1.0 if document.return_variance is None else document.return_variance,
        1.0 if document.samples is None else document.samples,
    )

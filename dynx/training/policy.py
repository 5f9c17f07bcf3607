"""A trained policy: its file, and the action that it takes."""

from __future__ import annotations

import io
import os
import warnings
import zipfile
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray

from dynx._version import __version__
from dynx.argument_types import checks_types
from dynx.envs.library import Env
from dynx.errors import ArgumentError, ShapeError, nearest, shown
from dynx.files.documents import convert_document, json_text, parse_json, to_json_values
from dynx.files.reading import irregularity, named_file
from dynx.files.writing import atomic_file
from dynx.model.numbers import MAX_INDEX, real_array, whole_number
from dynx.training.environments import make
from dynx.training.file_tasks import of_earlier_version, task_of_file
from dynx.training.networks import CLIPPED_AT, EPSILON, PolicyNetwork, check_compression, read_network
from dynx.training.specification import POLICY, PolicyDocument, TaskSpec, TrainingSpec

DOCUMENT = "dynx.json"
"""Member of the file of a policy that says what it was trained on; stable-baselines3 ignores it."""

MAX_DOCUMENT = 1_000_000
"""Largest size of that member [bytes]."""


@dataclass(frozen=True)
class Scaling:
    """Running mean and variance of observations, and variance of returns, after a number of samples."""

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    return_variance: float
    samples: float

    def __call__(self, observation: NDArray[Any]) -> NDArray[np.float32]:
        """Scale an observation, or several (n, ...), as in training. Raises ShapeError for another shape."""
        seen, size = real_array("observation", observation), self.mean.ndim
        if seen.shape[max(seen.ndim - size, 0) :] != self.mean.shape:
            wanted = ", ".join(map(str, self.mean.shape))
            raise ShapeError(f"observation has shape {seen.shape}; wanted (..., {wanted})")
        scaled = (seen - self.mean) / np.sqrt(self.variance + EPSILON)
        return np.clip(scaled, -CLIPPED_AT, CLIPPED_AT).astype(np.float32)

    @staticmethod
    def of(vector: Any) -> Scaling | None:
        """Return the scaling of environments; None where they have none."""
        from dynx.training.library import VecNormalize

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

    A call with one observation, or with several (n, ...), returns one action for each: the likeliest action,
    or with ``deterministic=False`` a random one. `algorithm` is an object of stable-baselines3, or the
    network in NumPy, which gives only the likeliest action.
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
        if isinstance(self.algorithm, PolicyNetwork):
            return self.algorithm(seen, deterministic)
        from dynx.training.library import action_of

        return action_of(self.algorithm, seen, deterministic)

    @checks_types
    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the policy to a file, with its origin. stable-baselines3 also loads the file and gives the
        same actions.

        Raises ArgumentError for a policy whose network is in NumPy, because it lacks parts that a file needs.
        """
        if isinstance(self.algorithm, PolicyNetwork):
            raise ArgumentError(
                "the network in NumPy has not all that a file of a policy holds; copy the file, or load it "
                "by load_policy(..., network='torch')"
            )
        from dynx.training.library import write_weights

        scaling = self.scaling
        document = PolicyDocument(
            POLICY,
            __version__,
            self.spec,
            self.steps_done,
            None if scaling is None else scaling.mean.tolist(),
            None if scaling is None else scaling.variance.tolist(),
            None if scaling is None else scaling.return_variance,
            None if scaling is None else scaling.samples,
        )
        content = io.BytesIO()
        write_weights(self.algorithm, content, None if scaling is None else (scaling.mean, scaling.variance))
        with zipfile.ZipFile(content, "a") as archive:
            archive.writestr(DOCUMENT, json_text(to_json_values(document)))
        with atomic_file(path) as file:
            file.write(content.getvalue())


def read_policy_document(path: str | os.PathLike[str]) -> PolicyDocument:
    """Read what a file of a policy says about itself, which may be anything: `task_of_file` checks its task.

    A policy of an earlier dynx has the options with which its task means the same today. Raises ArgumentError
    for a file that is no policy of dynx.
    """
    where = shown(os.fspath(path), 300)
    if not os.path.isfile(path):
        if os.path.isfile(Path(path, "final.zip")):
            raise ArgumentError(f"{where} is the folder of a run; its policy is {Path(path, 'final.zip')}")
        raise ArgumentError(f"{where}: {irregularity(path) or 'there is no such file'}")
    try:
        with named_file(path) as file, zipfile.ZipFile(file) as archive:
            check_compression(archive)
            if DOCUMENT not in archive.namelist():
                raise ArgumentError(
                    f"{where} was not written by dynx train: it does not name its task; dynx play --unpickle "
                    "and load_stable_baselines read a file of stable-baselines3, which runs the code in it"
                )
            if archive.getinfo(DOCUMENT).file_size > MAX_DOCUMENT:
                raise ArgumentError(f"{where}: {DOCUMENT} is larger than {MAX_DOCUMENT:,} bytes")
            document = parse_json(archive.read(DOCUMENT))
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        if isinstance(error, ArgumentError):
            raise
        raise ArgumentError(f"{where} is damaged, or no policy: {' '.join(str(error).split())}") from error
    try:
        found = convert_document(document, PolicyDocument)
        whole_number("steps_done", found.steps_done, 0, MAX_INDEX)
        return replace(found, spec=of_earlier_version(found.spec, found.schema))
    except ArgumentError as error:
        raise ArgumentError(f"{where}: {error}") from error


Network = Literal["torch", "numpy"]
"""Library that computes the network of a policy."""

NETWORKS: tuple[Network, ...] = ("torch", "numpy")


@checks_types
def load_policy(
    path: str | os.PathLike[str], task: TaskSpec | None = None, *, network: Network | None = None
) -> Policy:
    """Load a policy, for the task that it was trained on or for `task`, such as the same on another engine.

    `network` selects what computes the actions. ``"torch"`` needs PyTorch and stable-baselines3. ``"numpy"``
    needs neither of them, gives only the likeliest action, and differs by rounding in single precision. The
    default is ``"torch"`` if stable-baselines3 is installed, otherwise ``"numpy"``.

    dynx reads only tensors and JSON from the file, so loading it runs no code and opens no other file. The
    file names a registered task, with options that are numbers, words and robots. Give a task of your own, an
    id ``module:Env-v0`` or options that name a file as `task`; it is then the task of the policy. Raises
    ArgumentError for a file that is no policy, is damaged, or has a policy for other observations or actions,
    and for networks that NumPy does not compute.
    """
    if network is not None and network not in NETWORKS:
        raise ArgumentError(f"network is {shown(network)}{nearest(network, NETWORKS)}")
    document = read_policy_document(path)
    spec = _spec_of(document, task, os.fspath(path))
    chosen = network or ("numpy" if find_spec("stable_baselines3") is None else "torch")
    read = _read_network if chosen == "numpy" else _read_algorithm
    env = make(task or spec.task)
    try:
        with named_file(path) as file:
            algorithm = read(file, spec, env, os.fspath(path))
        scaling = scaling_of(document, env.observation_space.shape, os.fspath(path))
    except ArgumentError as error:
        if task is None or task.id == spec.task.id:
            raise
        raise ArgumentError(
            f"{error}; it is a policy for {spec.task.id}, whose observations or actions may not be those of "
            f"{task.id}"
        ) from error
    finally:
        env.close()
    return Policy(algorithm, spec, document.steps_done, scaling)


def _read_network(file: BinaryIO, spec: TrainingSpec, env: Env[Any, Any], source: str) -> PolicyNetwork:
    return read_network(file, spec, env.observation_space, env.action_space, source)


def _read_algorithm(file: BinaryIO, spec: TrainingSpec, env: Env[Any, Any], source: str) -> Any:
    """Return the algorithm of stable-baselines3 with the weights of a file."""
    from dynx.training.algorithms import new_algorithm
    from dynx.training.library import DummyVecEnv, read_weights, weights_of_file

    with warnings.catch_warnings():
        # Warnings about the number of environments concern training.
        warnings.simplefilter("ignore", UserWarning)
        algorithm = new_algorithm(
            spec.algorithm,
            DummyVecEnv([lambda: env]),
            spec.hyperparameters,
            None,
            most_weights=weights_of_file(file),
        )
    read_weights(algorithm, file, source)
    return algorithm


def _spec_of(document: PolicyDocument, task: TaskSpec | None, source: str) -> TrainingSpec:
    """Return what a policy was trained with; the task is the caller's where a file may not name it."""
    try:
        return replace(document.spec, task=task_of_file(document.spec.task, source))
    except ArgumentError:
        if task is None:
            raise
        return replace(document.spec, task=task)


def scaling_of(document: PolicyDocument, shape: tuple[int, ...] | None, source: str) -> Scaling | None:
    """Return the scaling that a policy was trained with, for observations of a shape.

    Raises ArgumentError for numbers of another shape, that are not finite, and for negative variances.
    """
    if document.observation_mean is None and document.observation_variance is None:
        return None
    scaling = Scaling(
        np.array(document.observation_mean, dtype=np.float64),
        np.array(document.observation_variance, dtype=np.float64),
        1.0 if document.return_variance is None else document.return_variance,
        1.0 if document.samples is None else document.samples,
    )
    where = shown(source, 300)
    for name, array in (("observation_mean", scaling.mean), ("observation_variance", scaling.variance)):
        if array.shape != shape:
            raise ArgumentError(f"{where}: {name} has shape {array.shape}; wanted {shape}")
    numbers = np.concatenate([scaling.mean, scaling.variance, [scaling.return_variance, scaling.samples]])
    if not np.isfinite(numbers).all():
        raise ArgumentError(
            f"{where}: the scaling of observations and returns has a number that is not finite"
        )
    if (scaling.variance < 0.0).any() or scaling.return_variance < 0.0 or scaling.samples <= 0.0:
        raise ArgumentError(f"{where}: a variance is negative, or the number of samples is not above 0")
    return scaling

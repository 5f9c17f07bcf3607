"""Files that stable-baselines3 itself wrote. **Reading them runs the code that is in them.**

stable-baselines3 pickles what is no tensor, and the statistics of `VecNormalize`, and a pickle runs any code
when it is read. So nothing of dynx reads such files unless the caller asks for it by `load_stable_baselines`
or ``dynx play --unpickle``. What is loaded is copied to an algorithm of dynx's own making, whose policy is
saved, judged and shown as any other.
"""

from __future__ import annotations

import json
import os
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.files.reading import named_file
from dynx.training.algorithms import ACTIVATIONS, ALGORITHMS, hyperparameters_of, new_algorithm
from dynx.training.environments import make
from dynx.training.library import (
    DummyVecEnv,
    VecNormalize,
)
from dynx.training.networks import CLIPPED_AT, EPSILON
from dynx.training.policy import DOCUMENT, Policy, Scaling
from dynx.training.specification import TaskSpec, TrainingSpec

_OWN_KEYS = {
    "ppo": {"clip_range", "n_epochs"},
    "sac": {"target_entropy"},
    "td3": {"policy_delay"},
    "dqn": {"exploration_fraction"},
    "a2c": {"vf_coef", "gae_lambda"},
}
"""Entries of the data of a file by which an algorithm is known, tried in this order."""

_ADDED = ("optimizer_class", "optimizer_kwargs", "use_sde")
"""Options of networks that the algorithms add themselves."""


@checks_types
def load_stable_baselines(
    path: str | os.PathLike[str],
    task: TaskSpec,
    algorithm: str | None = None,
    statistics: str | os.PathLike[str] | None = None,
) -> Policy:
    """Load a policy that `save` of stable-baselines3 wrote, for a task. **Runs the code that is in the file**
    and in that of `statistics`: use it for files that you trust.

    `algorithm` is ppo, a2c, dqn, sac or td3 (default: the one whose hyperparameters the file has),
    `statistics` the file of `VecNormalize.save` by which observations were scaled. `Policy.save` writes the
    policy as a file that `load_policy` reads, which runs no code. Raises ArgumentError for another file, a
    policy for other observations or actions, networks that dynx does not make, and statistics that scale in
    another way than by default.
    """
    source, where = os.fspath(path), shown(os.fspath(path), 300)
    name = _algorithm_of(source, algorithm)
    with named_file(path) as file, _foreign(where, name):
        loaded = ALGORITHMS[name].load(file, device="cpu")
    with closing(DummyVecEnv([lambda: make(task)])) as vector:
        try:
            hyperparameters = _hyperparameters(loaded, name)
            with warnings.catch_warnings():
                # Warnings about the number of environments concern training.
                warnings.simplefilter("ignore", UserWarning)
                own = new_algorithm(name, vector, hyperparameters, None)
            _require_spaces(loaded, vector, task)
            weights = {
                each: found for each, found in loaded.get_parameters().items() if "optimizer" not in each
            }
            own.set_parameters(weights, exact_match=False, device="cpu")
        except (ArgumentError, RuntimeError, ValueError, KeyError) as error:
            raise ArgumentError(f"{where}: {' '.join(str(error).split())[:300]}") from error
        scaling = None if statistics is None else _scaling(os.fspath(statistics), vector)
    steps = int(loaded.num_timesteps)
    spec = TrainingSpec(
        task,
        name,
        max(steps, 1),
        max(int(loaded.n_envs), 1),
        int(loaded.seed or 0),
        normalize=scaling is not None,
        hyperparameters=hyperparameters,
    )
    return Policy(own, spec, steps, scaling)


def _algorithm_of(path: str, name: str | None) -> str:
    """Return the name of the algorithm of a file; the names of its data are read, and no code is run."""
    if name is not None and name not in ALGORITHMS:
        raise UnknownNameError(f"no algorithm {shown(name)}{nearest(name, ALGORITHMS)}")
    try:
        with named_file(path) as file, zipfile.ZipFile(file) as archive:
            own = DOCUMENT in archive.namelist()
            keys = set(json.loads(archive.read("data")))
    except (zipfile.BadZipFile, KeyError, TypeError, ValueError) as error:
        if isinstance(error, ArgumentError):
            raise
        reason = " ".join(str(error).split())
        raise ArgumentError(f"{shown(path, 300)} is no file of stable-baselines3: {reason}") from error
    if own:
        raise ArgumentError(f"{shown(path, 300)} was written by dynx, which reads it without unpickling")
    found = name or next((each for each, known in _OWN_KEYS.items() if known <= keys), None)
    if found is None:
        raise ArgumentError(f"{shown(path, 300)} is of none of {', '.join(ALGORITHMS)}")
    return found


@contextmanager
def _foreign(where: str, kind: str) -> Iterator[None]:
    """Raise ArgumentError for whatever the code in a file raises."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about versions of Python and of packages
            yield
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ArgumentError(f"{where} cannot be loaded as {kind}: {reason[:300]}") from error


def _hyperparameters(loaded: Any, name: str) -> dict[str, Any]:
    """Return the hyperparameters of a loaded algorithm as `new_algorithm` takes them: numbers and words, and
    the networks.

    Raises ArgumentError for networks that dynx does not make.
    """
    values = {each: getattr(loaded, each, None) for each in hyperparameters_of(name)}
    found = {each: value for each, value in values.items() if isinstance(value, bool | int | float | str)}
    if "buffer_size" in values:
        found["buffer_size"] = 1  # nothing is learned, so that no sample is kept
    networks: dict[str, Any] = {}
    for each, value in loaded.policy_kwargs.items():
        if each in _ADDED:
            continue
        if each == "activation_fn":
            value = next((word for word, kind in ACTIVATIONS.items() if kind is value), value)
        if not isinstance(value, bool | int | float | str | list | tuple | dict):
            raise ArgumentError(f"its networks have {each} {shown(value)}, which dynx does not make")
        networks[each] = value
    return {**found, **({"policy_kwargs": networks} if networks else {})}


def _require_spaces(loaded: Any, vector: Any, task: TaskSpec) -> None:
    for kind in ("observation_space", "action_space"):
        mine, theirs = getattr(vector, kind), getattr(loaded, kind)
        if type(mine) is not type(theirs) or mine.shape != theirs.shape or mine.dtype != theirs.dtype:
            raise ArgumentError(f"its {kind.replace('_', ' ')} is {theirs}, that of {task.name} {mine}")


def _scaling(path: str, vector: Any) -> Scaling | None:
    """Return the scaling of observations by the file of a `VecNormalize`; None if it scales rewards alone."""
    where = shown(path, 300)
    with named_file(path):
        pass
    with _foreign(where, "statistics of VecNormalize"):
        found = VecNormalize.load(path, vector)
        if not isinstance(found, VecNormalize):
            raise TypeError(f"it has a {type(found).__name__}")
        scales, limits = bool(found.norm_obs), (float(found.clip_obs), float(found.epsilon))
        scaling = Scaling.of(found)
    if not scales or scaling is None:
        return None
    if limits != (CLIPPED_AT, EPSILON):
        raise ArgumentError(
            f"{where} clips scaled observations at {limits[0]:g} and adds {limits[1]:g} to their variance; "
            f"dynx scales as stable-baselines3 does by default, with {CLIPPED_AT:g} and {EPSILON:g}"
        )
    if scaling.mean.shape != vector.observation_space.shape or not np.isfinite(scaling.variance).all():
        raise ArgumentError(f"{where} has statistics of other observations, or numbers that are not finite")
    return scaling

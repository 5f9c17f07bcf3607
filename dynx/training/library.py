"""The one import of stable-baselines3 and PyTorch: what they learn on, and their files of weights.

Weights are read without unpickling anything (`set_parameters` loads tensors alone), so that a policy from
somebody else runs no code of theirs; numbers of a file are finite, and fit the algorithm and the memory.
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Iterator, Mapping
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from dynx.envs.library import spaces
from dynx.errors import ArgumentError, importing, shown
from dynx.training.networks import CLIPPED_AT, EPSILON, check_archive

with importing("training needs stable-baselines3: pip install 'dynx[train]'"):
    import torch
    from stable_baselines3 import A2C, DQN, PPO, SAC, TD3
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.logger import configure
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.save_util import load_from_zip_file
    from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, FlattenExtractor
    from stable_baselines3.common.utils import explained_variance
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv, VecMonitor, VecNormalize

__all__ = [
    "A2C",
    "DQN",
    "PPO",
    "SAC",
    "TD3",
    "BaseCallback",
    "DummyVecEnv",
    "Monitor",
    "SubprocVecEnv",
    "VecEnv",
    "VecMonitor",
    "VecNormalize",
    "action_of",
    "explained_variance",
    "log_to",
    "read_weights",
    "replay_arrays",
    "restore_replay",
    "set_threads",
    "torch",
    "weights_of_file",
    "write_weights",
]

_REPLAYED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def action_of(algorithm: Any, observation: Any, deterministic: bool) -> Any:
    """Return the action of the policy of an algorithm for one observation, or those for several (n, ...)."""
    # PyTorch divides even layers of 64 units among all cores, whose waiting for one another takes ten times
    # as long as the layer, and some hundred times where other programs run.
    restore = set_threads(1)
    try:
        action, _ = algorithm.predict(observation, deterministic=deterministic)
    except (ValueError, AssertionError) as error:  # of a distribution whose parameters are no numbers, say
        reason = " ".join(str(error).split())[:300]
        raise ArgumentError(
            f"the policy has no action for this observation, {shown(observation)}: {reason}"
        ) from error
    finally:
        restore()
    return action


class ScaledFeatures(BaseFeaturesExtractor):  # type: ignore[misc]  # stable-baselines3 is not followed
    """Observations as features, scaled by the mean and the variance of those of training.

    A policy that learned on scaled observations has it in its file, so that it acts in stable-baselines3 on
    those of the task as in dynx. Files name this class: it keeps its place.
    """

    def __init__(self, observation_space: spaces.Space[Any]) -> None:
        super().__init__(observation_space, int(spaces.flatdim(observation_space)))
        shape = observation_space.shape or ()
        self.register_buffer("mean", torch.zeros(shape, dtype=torch.float64))
        self.register_buffer("variance", torch.ones(shape, dtype=torch.float64))

    def forward(self, observations: Any) -> Any:
        """Return the features (n, size) of observations (n, ...), with the bits of
        `dynx.training.policy.Scaling`."""
        scaled = (observations.double() - self.mean) / torch.sqrt(self.variance + EPSILON)
        return torch.flatten(torch.clamp(scaled, -CLIPPED_AT, CLIPPED_AT).float(), 1)


_SCALED = ("features_extractor.mean", "features_extractor.variance")
"""Ends of the names of the numbers of `ScaledFeatures` in a file, which dynx has in its own document."""


def write_weights(
    algorithm: Any, file: BinaryIO, scaling: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
) -> None:
    """Write an algorithm, as its own `save` does: stable-baselines3 alone reads the file, too.

    `scaling` are the mean and the variance of the observations on which it learned; what stable-baselines3
    loads scales the observations by them.
    """
    if scaling is None:
        algorithm.save(file)
        return
    scaled = ScaledFeatures(algorithm.observation_space)
    scaled.mean, scaled.variance = (torch.from_numpy(each.copy()) for each in scaling)
    plain = [
        (parent, name, part)
        for parent in algorithm.policy.modules()
        for name, part in parent._modules.items()  # `named_children` names a shared one once
        if isinstance(part, FlattenExtractor)
    ]
    options = algorithm.policy_kwargs
    try:
        algorithm.policy_kwargs = {**options, "features_extractor_class": ScaledFeatures}
        for parent, name, _ in plain:
            setattr(parent, name, scaled)
        algorithm.save(file)
    finally:
        algorithm.policy_kwargs = options
        for parent, name, part in plain:
            setattr(parent, name, part)


def read_weights(algorithm: Any, file: BinaryIO, source: str) -> None:
    """Read weights and the state of the optimizer into an algorithm of the same kind and size.

    Raises ArgumentError for a file with other weights, weights that are not finite, and a file that is
    larger when it is expanded.
    """
    try:
        check_archive(file)
        _, weights, variables = load_from_zip_file(file, device="cpu", load_data=False)
        for each in _tensors([weights, variables]):
            _check_tensor(each)
        networks = weights.get("policy", {})
        for name in [each for each in networks if each.endswith(_SCALED)]:
            del networks[name]
        modules, others = algorithm._get_torch_save_params()
        options = {name: _options_of(_part_of(algorithm, name)) for name in modules}
        algorithm.set_parameters(weights, device="cpu")
        for name in modules:
            _check_optimizer(_part_of(algorithm, name), options[name])
        _set_variables(algorithm, others, variables or {})
    except Exception as error:  # torch raises whatever a damaged or foreign file leads to
        reason = " ".join(str(error).split())[:300]
        if isinstance(error, pickle.UnpicklingError):  # PyTorch tells how to run the code of the file
            reason = "it has other objects than tensors, which are not unpickled"
        raise ArgumentError(f"{shown(source, 300)} has no weights that fit: {reason}") from error


def weights_of_file(file: BinaryIO) -> int:
    """Return a number of weights that a file of a policy cannot exceed."""
    return file.seek(0, os.SEEK_END) // 4


def _tensors(value: object) -> Iterator[Any]:
    """Yield the tensors in nested dictionaries and lists, which a file can let share their parts."""
    waiting, seen = [value], set[int]()
    while waiting:
        each = waiting.pop()
        if id(each) in seen:
            continue
        seen.add(id(each))
        if isinstance(each, torch.Tensor):
            yield each
        elif isinstance(each, Mapping):
            waiting += each.values()
        elif isinstance(each, list | tuple):
            waiting += each


def _check_tensor(tensor: Any) -> None:
    """Raise ValueError for a tensor that repeats its numbers, has no plain layout, or is not finite.

    Repeated numbers (a stride of 0) take no space in a file, and any space where they are computed with.
    """
    if tensor.layout is not torch.strided or tensor.is_quantized or tensor.device.type != "cpu":
        raise ValueError("a tensor has another layout than plain numbers in memory")
    if tensor.numel() * tensor.element_size() > tensor.untyped_storage().nbytes():
        raise ValueError("a tensor is larger than its numbers")
    if not bool(torch.isfinite(tensor).all()):
        raise ValueError("a number is not finite")


def _part_of(algorithm: Any, path: str) -> Any:
    """Return what an algorithm calls ``policy.optimizer``."""
    found = algorithm
    for name in path.split("."):
        found = getattr(found, name)
    return found


def _options_of(part: Any) -> list[dict[str, Any]]:
    """Return the options of an optimizer by group of parameters; none of a network."""
    if not isinstance(part, torch.optim.Optimizer):
        return []
    return [{name: value for name, value in group.items() if name != "params"} for group in part.param_groups]


def _check_optimizer(part: Any, before: list[dict[str, Any]]) -> None:
    """Raise ValueError for a loaded optimizer whose options or moments are of another kind or shape."""
    for group, known in zip(_options_of(part), before, strict=True):
        if group.keys() != known.keys():
            raise ValueError("the optimizer has other options")
        for name, value in group.items():
            if not _alike(value, known[name]):
                raise ValueError(f"{name} of the optimizer is {shown(value)}")
    if isinstance(part, torch.optim.Optimizer):
        for parameter, state in part.state.items():
            if any(each.ndim > 0 and each.shape != parameter.shape for each in _tensors(state)):
                raise ValueError("the state of the optimizer has another shape")


def _alike(value: object, known: object) -> bool:
    """Check whether an option is of the kind of another; numbers must be finite, and may be of any kind."""
    if isinstance(known, list | tuple):
        return isinstance(value, list | tuple) and all(_is_number(each) for each in value)
    return _is_number(value) if _is_number(known) else type(value) is type(known)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def _set_variables(algorithm: Any, names: list[str], variables: Mapping[str, Any]) -> None:
    """Set tensors that belong to no network, such as the entropy coefficient of SAC.

    Raises ValueError for others than those of the algorithm, and for other shapes.
    """
    if set(variables) != set(names):
        raise ValueError(
            f"its variables are {shown(sorted(map(str, variables)))}; wanted {shown(sorted(names))}"
        )
    for name, value in variables.items():
        own = getattr(algorithm, name)
        if not isinstance(value, torch.Tensor) or value.shape != own.shape:
            raise ValueError(f"{name} has another shape")
        own.data = value.data


def replay_arrays(algorithm: Any) -> dict[str, NDArray[Any]] | None:
    """Return the arrays of the replay buffer; None for an algorithm that has none."""
    buffer = getattr(algorithm, "replay_buffer", None)
    if buffer is None:
        return None
    end = buffer.buffer_size if buffer.full else buffer.pos
    arrays = {name: getattr(buffer, name)[:end] for name in _REPLAYED}
    return {**arrays, "pos": np.array(buffer.pos), "full": np.array(buffer.full)}


def restore_replay(algorithm: Any, arrays: Mapping[str, NDArray[Any]], source: str) -> None:
    """Fill the replay buffer of an algorithm with arrays of `replay_arrays`.

    Raises ArgumentError for arrays that another buffer had, or that are not finite.
    """
    buffer: Any = getattr(algorithm, "replay_buffer", None)
    found = {name: arrays.get(name, np.empty(0)) for name in (*_REPLAYED, "pos", "full")}
    pos, full = found["pos"], found["full"]
    fits = (
        buffer is not None and pos.shape == full.shape == () and pos.dtype.kind == "i" and full.dtype == bool
    )
    count = 0
    if fits:
        count = buffer.buffer_size if full else int(pos)
        fits = 0 <= int(pos) < buffer.buffer_size
        for name in _REPLAYED:
            own, given = getattr(buffer, name), found[name]
            fits = fits and given.dtype == own.dtype and given.shape == (count, *own.shape[1:])
            fits = fits and bool(np.isfinite(given).all())
    if not fits:
        raise ArgumentError(f"{shown(source, 300)} is not the replay buffer of this run")
    for name in _REPLAYED:
        getattr(buffer, name)[:count] = found[name]
    buffer.pos, buffer.full = int(pos), bool(full)


def log_to(algorithm: Any, folder: str) -> None:
    """Have an algorithm write its curves for TensorBoard into a folder.

    Raises NotInstalledError without TensorBoard.
    """
    with importing("curves for TensorBoard need it: pip install 'dynx[train]'", AssertionError):
        algorithm.set_logger(configure(folder, ["tensorboard"]))


def set_threads(count: int) -> Callable[[], None]:
    """Let PyTorch use `count` threads; the function returned sets the number back."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    return lambda: torch.set_num_threads(before)

"""The one import of stable-baselines3: its algorithms, what it learns on, and its files of weights.

Weights are read without unpickling anything (`set_parameters` loads tensors alone), so that a policy from
somebody else runs no code of theirs; numbers of a file are finite, and fit the algorithm and the memory.
"""

from __future__ import annotations

import inspect
import os
import pickle
import sys
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from dynx.envs.library import spaces
from dynx.errors import ArgumentError, UnknownNameError, importing, nearest, shown
from dynx.training.networks import CLIPPED_AT, EPSILON, check_archive
from dynx.training.ppo import ThreadedPPO
from dynx.training.schedules import SCHEDULED, SteadyDivergence, schedule_of

with importing("training needs stable-baselines3: pip install 'dynx[train]'"):
    import torch
    from stable_baselines3 import A2C, DQN, SAC, TD3
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.logger import configure
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.save_util import load_from_zip_file
    from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, FlattenExtractor
    from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv, VecMonitor, VecNormalize

__all__ = [
    "ALGORITHMS",
    "BaseCallback",
    "DummyVecEnv",
    "Monitor",
    "SubprocVecEnv",
    "VecEnv",
    "VecMonitor",
    "VecNormalize",
    "action_of",
    "hyperparameters_of",
    "log_to",
    "new_algorithm",
    "read_weights",
    "replay_arrays",
    "restore_replay",
    "set_threads",
    "weights_of_file",
    "write_weights",
]

ALGORITHMS: dict[str, type[Any]] = {"ppo": ThreadedPPO, "a2c": A2C, "dqn": DQN, "sac": SAC, "td3": TD3}
"""Algorithms by the name that `dynx train --algo` takes."""

ACTIVATIONS = {
    "tanh": torch.nn.Tanh,
    "relu": torch.nn.ReLU,
    "elu": torch.nn.ELU,
    "gelu": torch.nn.GELU,
    "silu": torch.nn.SiLU,
}
"""Activation functions by the name that ``policy_kwargs={"activation_fn": ...}`` takes."""

_GIVEN = ("self", "policy", "env", "seed", "verbose", "tensorboard_log", "device", "_init_setup_model")
"""Parameters of an algorithm that training sets itself."""

_OF_NUMBERS, _OF_CHOICES = ("sac", "td3"), ("dqn",)
_REFUSED_ACTIONS: dict[str, type[Any]] = {
    **dict.fromkeys(_OF_NUMBERS, spaces.Discrete),
    **dict.fromkeys(_OF_CHOICES, spaces.Box),
}
"""Actions that an algorithm cannot learn."""

_OF_SEVERAL_KINDS = ("train_freq",)
"""Hyperparameters whose default is a number, and which may also be something else."""

_FRACTIONS = ("gamma", "gae_lambda", "tau")
"""Hyperparameters between 0 and 1; the algorithms accept others, with which nothing is learned."""

_REPLAYED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


_BYTES_PER_WEIGHT = 24
"""Memory for a weight of a network and its optimizer, and for a copy (a target network) [bytes]."""

_ALGORITHM_REFUSES = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    MemoryError,
    RuntimeError,
    TypeError,
    ValueError,
)
"""Exceptions of stable-baselines3 and PyTorch for values of hyperparameters."""


def hyperparameters_of(name: str) -> list[str]:
    """Return the names of the hyperparameters of an algorithm."""
    parameters = inspect.signature(ALGORITHMS[name].__init__).parameters
    return [each for each in parameters if each not in _GIVEN]


def new_algorithm(
    name: str,
    env: VecEnv,
    hyperparameters: dict[str, Any],
    seed: int | None,
    *,
    most_weights: int | None = None,
) -> Any:
    """Make an algorithm with new weights, at most `most_weights` in a network.

    Raises UnknownNameError for an algorithm or a hyperparameter that does not exist, ArgumentError for a
    value that the algorithm refuses, an action space that it cannot use, and networks or buffers that are
    larger than the memory.
    """
    if name not in ALGORITHMS:
        raise UnknownNameError(f"no algorithm {shown(name)}{nearest(name, ALGORITHMS)}")
    algorithm = ALGORITHMS[name]
    known = hyperparameters_of(name)
    for each in hyperparameters:
        if each not in known:
            raise UnknownNameError(f"{name} has no hyperparameter {shown(each)}{nearest(each, known)}")
    for each, value in hyperparameters.items():
        _check_kind(each, value, inspect.signature(algorithm.__init__).parameters[each].default)
    if isinstance(env.action_space, _REFUSED_ACTIONS.get(name, ())):
        others = [
            each for each in ALGORITHMS if not isinstance(env.action_space, _REFUSED_ACTIONS.get(each, ()))
        ]
        kind = "numbers" if name in _OF_NUMBERS else "choices"
        raise ArgumentError(
            f"{name} learns actions that are {kind}, and those of the task are {env.action_space}; wanted "
            f"{', '.join(others)}"
        )
    for each in _FRACTIONS:
        value = hyperparameters.get(each, 1.0)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
            raise ArgumentError(f"{each} is {value!r}; wanted a number between 0 and 1")
    values = {each: schedule_of(each, value) for each, value in hyperparameters.items()}
    if name != "ppo" and isinstance(values.get("learning_rate"), SteadyDivergence):
        raise ArgumentError(f"learning_rate is {hyperparameters['learning_rate']}, which ppo alone has")
    if "policy_kwargs" in values:
        values["policy_kwargs"] = _policy_options(values["policy_kwargs"])
        _check_weights(values["policy_kwargs"], env, most_weights)
    _check_buffers(hyperparameters, env)
    try:
        return algorithm("MlpPolicy", env, seed=seed, device="cpu", **values)
    except _ALGORITHM_REFUSES as error:
        raise ArgumentError(f"{name} refuses: {str(error) or type(error).__name__}") from error


def _memory() -> int:
    """Return the memory of this machine [bytes]; where it is not known, the largest number of bytes."""
    if sys.platform == "win32" or "SC_PHYS_PAGES" not in os.sysconf_names:
        return 2**63
    return int(os.sysconf("SC_PAGE_SIZE")) * int(os.sysconf("SC_PHYS_PAGES"))


MAX_LAYERS = 1000
"""Largest number of layers of networks; each takes a tenth of a millisecond in every call."""


def _check_weights(options: Mapping[str, Any], env: VecEnv, most: int | None) -> None:
    """Raise ArgumentError for layers that are no numbers, or have more weights than `most` or the memory."""
    layers = options.get("net_arch", [])
    lists = [*layers.values()] if isinstance(layers, dict) else [layers]
    critics = options.get("n_critics", 1)
    for each in [*lists, [critics]]:
        if not isinstance(each, list | tuple) or not all(type(width) is int and width > 0 for width in each):
            raise ArgumentError(
                "net_arch is a list of the widths of layers, or one for each network, and n_critics a "
                f"number, all above 0; got {shown(options)}"
            )
    inputs = int(spaces.flatdim(env.observation_space)) + int(spaces.flatdim(env.action_space))
    if critics * max(map(len, lists), default=0) > MAX_LAYERS:
        raise ArgumentError(f"net_arch has more than {MAX_LAYERS} layers; wanted fewer")
    weights = critics * max((sum(a * b for a, b in pairwise([inputs, *each])) for each in lists), default=0)
    if most is not None and weights > most:
        raise ArgumentError(f"net_arch describes {weights:,} weights, more than the file holds")
    if weights * _BYTES_PER_WEIGHT > _memory():
        raise ArgumentError(f"net_arch describes {weights:,} weights, which the memory does not hold")


def _check_buffers(hyperparameters: Mapping[str, Any], env: VecEnv) -> None:
    """Raise ArgumentError for a buffer of samples that is larger than the memory."""
    one = 2 * _bytes_of(env.observation_space) + _bytes_of(env.action_space)
    for name, copies in (("buffer_size", 1), ("n_steps", env.num_envs), ("batch_size", 1)):
        count = hyperparameters.get(name, 0)
        if isinstance(count, int) and count * copies * one > _memory():
            raise ArgumentError(
                f"{name} is {count:,}: the samples need {count * copies * one:,} bytes of memory"
            )


def _bytes_of(space: Any) -> int:
    """Return the size of an element of a space in a buffer [bytes]."""
    if space.shape is None or space.dtype is None:
        return 0
    return int(np.prod(space.shape)) * int(space.dtype.itemsize)


def _check_kind(name: str, value: object, default: object) -> None:
    """Refuse a value of another kind than the default of a hyperparameter, where that tells the kind."""
    wanted = None
    if name in SCHEDULED:
        return
    if isinstance(default, bool):
        wanted = None if isinstance(value, bool) else "true or false"
    elif isinstance(default, int) and name not in _OF_SEVERAL_KINDS:
        wanted = None if isinstance(value, int) and not isinstance(value, bool) else "a whole number"
    elif isinstance(default, float):
        wanted = None if isinstance(value, int | float) and not isinstance(value, bool) else "a number"
    if wanted is not None:
        raise ArgumentError(f"{name} is {value!r:.100}; wanted {wanted}")


def _policy_options(options: object) -> dict[str, Any]:
    if not isinstance(options, dict):
        raise ArgumentError(
            f"policy_kwargs is a table such as {{'net_arch': [64, 64]}}; got {shown(options)}"
        )
    word = options.get("activation_fn")
    if not isinstance(word, str):
        return {**options}  # A2C adds its optimizer to them, which no file of a run could have
    if word not in ACTIVATIONS:
        raise UnknownNameError(f"no activation function {shown(word)}{nearest(word, ACTIVATIONS)}")
    return {**options, "activation_fn": ACTIVATIONS[word]}


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

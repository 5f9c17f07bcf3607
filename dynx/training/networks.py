"""The network of a trained policy in NumPy, read from its file without PyTorch.

A file of PyTorch is an archive of numbers, with a pickle that says which of them are which tensor. Nothing is
unpickled here: the few instructions that PyTorch writes for tensors are followed, and any other is refused.
"""

from __future__ import annotations

import io
import math
import pickletools
import zipfile
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.envs.library import Space, spaces
from dynx.errors import ArgumentError, shown
from dynx.training.specification import TrainingSpec

CLIPPED_AT = 10.0
"""Bound of scaled observations and rewards, in deviations."""

EPSILON = 1e-8
"""Number added to a variance before its root is taken, as in stable-baselines3."""

CLIPPED_MEAN = 2.0
"""Bound of the mean of SAC with state-dependent exploration, before it is squashed."""

Row = NDArray[np.float32]


class PolicyNetwork(NamedTuple):
    """The layers that compute the likeliest action of a policy, in single precision."""

    algorithm: str
    weights: tuple[tuple[Row, Row], ...]
    """Matrix (outputs, inputs) and offset (outputs,) of each layer."""
    activation: Callable[[Row], Row]
    action_space: Space[Any]
    clipped_mean: bool

    def __call__(self, observation: NDArray[Any], deterministic: bool = True) -> Any:
        """Return the action for one observation, or those for several (n, ...).

        Raises ArgumentError where random actions are wanted, and for observations of another shape.
        """
        if not deterministic:
            raise ArgumentError(
                "the network in NumPy has the likeliest action alone; wanted load_policy(..., "
                "network='torch') for random ones"
            )
        rows = np.asarray(observation, dtype=np.float32)
        inputs = self.weights[0][0].shape[1]
        one = rows.size == inputs
        if rows.size % inputs or (not one and rows[0].size != inputs):
            raise ArgumentError(
                f"the observation has shape {rows.shape}; wanted {inputs} numbers, or rows of as many"
            )
        rows = rows.reshape(-1, inputs)
        for matrix, offset in self.weights[:-1]:
            rows = self.activation(rows @ matrix.T + offset)
        matrix, offset = self.weights[-1]
        actions = self._actions(rows @ matrix.T + offset)
        return actions[0] if one and np.ndim(observation) < 2 else actions

    def _actions(self, found: Row) -> NDArray[Any]:
        """Return the actions by the outputs of the last layer (n, outputs)."""
        space = self.action_space
        if not isinstance(space, spaces.Box):
            return np.asarray(found.argmax(axis=1))
        if self.clipped_mean:
            found = np.clip(found, -CLIPPED_MEAN, CLIPPED_MEAN)
        found = found.reshape(-1, *space.shape)
        if self.algorithm in ("ppo", "a2c"):
            return np.clip(found, space.low, space.high)
        return np.asarray(space.low + 0.5 * (np.tanh(found) + 1.0) * (space.high - space.low))


def _gelu(x: Row) -> Row:
    return np.asarray(0.5 * x * (1.0 + np.vectorize(math.erf)(x / math.sqrt(2.0))), dtype=np.float32)


def _silu(x: Row) -> Row:
    return np.asarray(x * (0.5 + 0.5 * np.tanh(0.5 * x)), dtype=np.float32)


ACTIVATION_FUNCTIONS: Mapping[str, Callable[[Row], Row]] = {
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, np.float32(0.0)),
    "elu": lambda x: np.where(x > 0.0, x, np.expm1(np.minimum(x, np.float32(0.0)))),
    "gelu": _gelu,
    "silu": _silu,
}
"""Activation functions by the names that ``policy_kwargs={"activation_fn": ...}`` takes."""

_LAYERS: Mapping[str, tuple[str, ...]] = {
    "ppo": ("mlp_extractor.policy_net", "action_net"),
    "a2c": ("mlp_extractor.policy_net", "action_net"),
    "dqn": ("q_net.q_net",),
    "sac": ("actor.latent_pi", "actor.mu"),
    "td3": ("actor.mu",),
}
"""Beginnings of the names of the layers of a policy, from the observation to the action."""

_WITHOUT_EFFECT = ("net_arch", "activation_fn", "ortho_init", "log_std_init", "n_critics", "full_std")
"""Options of networks that change nothing of the likeliest action but by the weights."""


def read_network(
    file: BinaryIO, spec: TrainingSpec, observation_space: Space[Any], action_space: Space[Any], source: str
) -> PolicyNetwork:
    """Read the network of a policy, which was trained by `spec`, for these observations and actions.

    Raises ArgumentError for a damaged file, weights of another shape or that are not finite, and for
    networks, observations and actions that only PyTorch computes.
    """
    where, algorithm = shown(source, 300), spec.algorithm
    options = spec.hyperparameters.get("policy_kwargs", {})
    unusual = sorted(set(options) - set(_WITHOUT_EFFECT)) if isinstance(options, dict) else [shown(options)]
    if algorithm not in _LAYERS:
        raise ArgumentError(f"{where}: algorithm is {shown(algorithm)}; wanted one of {', '.join(_LAYERS)}")
    name: object = {"ppo": "tanh", "a2c": "tanh"}.get(algorithm, "relu")
    if isinstance(options, dict):
        name = options.get("activation_fn", name)
    if unusual or not isinstance(name, str) or name not in ACTIVATION_FUNCTIONS:
        raise ArgumentError(
            f"{where}: its networks have {shown(unusual or name)}, which only PyTorch computes; wanted "
            "load_policy(..., network='torch')"
        )
    if not isinstance(observation_space, spaces.Box) or observation_space.dtype == np.uint8:
        raise ArgumentError(
            f"{where}: observations are {observation_space}; the network in NumPy takes numbers (Box)"
        )
    if not isinstance(action_space, spaces.Box | spaces.Discrete):
        raise ArgumentError(
            f"{where}: actions are {action_space}; the network in NumPy gives Box and Discrete ones"
        )
    try:
        check_archive(file)
        with zipfile.ZipFile(file) as archive:
            tensors = _read_tensors(archive.read("policy.pth"))
        weights = tuple(pair for part in _LAYERS[algorithm] for pair in _layers(tensors, part))
        inputs, outputs = spaces.flatdim(observation_space), spaces.flatdim(action_space)
        _check_shapes(weights, inputs, outputs)
    except (zipfile.BadZipFile, LookupError, TypeError, ValueError, OverflowError) as error:
        reason = " ".join(str(error).split())[:300]
        raise ArgumentError(f"{where} has no weights that fit: {reason}") from error
    clipped = algorithm == "sac" and bool(spec.hyperparameters.get("use_sde"))
    return PolicyNetwork(algorithm, weights, ACTIVATION_FUNCTIONS[name], action_space, clipped)


def _layers(tensors: Mapping[str, NDArray[Any]], part: str) -> list[tuple[Row, Row]]:
    """Return the matrices and offsets of a part of a network: one layer, or several by their numbers."""
    names = [each[: -len(".weight")] for each in tensors if each.endswith(".weight")]
    own = [each for each in names if each == part or each.rpartition(".")[0] == part]
    own.sort(key=lambda each: 0 if each == part else int(each.rpartition(".")[2]))
    return [
        (tensors[f"{each}.weight"].astype(np.float32), tensors[f"{each}.bias"].astype(np.float32))
        for each in own
    ]


def _check_shapes(weights: Sequence[tuple[Row, Row]], inputs: int, outputs: int) -> None:
    """Raise ValueError for layers that do not lead from `inputs` numbers to `outputs`, or are not finite."""
    shapes = [(matrix.shape, offset.shape) for matrix, offset in weights]
    if not shapes or any(len(a) != 2 or b != a[:1] for a, b in shapes):
        raise ValueError(f"its layers have the shapes {shown(shapes)}")
    ends = (shapes[0][0][1], shapes[-1][0][0])
    if ends != (inputs, outputs) or any(a[0][0] != b[0][1] for a, b in pairwise(shapes)):
        raise ValueError(
            f"its layers have the shapes {shown(shapes)}; wanted from {inputs} to {outputs} numbers"
        )
    if not all(np.isfinite(each).all() for pair in weights for each in pair):
        raise ValueError("a number is not finite")


def check_compression(archive: zipfile.ZipFile) -> None:
    """Raise ValueError for an archive with members that grow without bound as they are read.

    `zipfile` expands what bzip2 and LZMA compressed in one piece, whatever size the member states.
    """
    for part in archive.infolist():
        if part.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{shown(part.filename)} is compressed in another way than by deflate")


def check_archive(file: BinaryIO) -> None:
    """Raise ValueError for an archive, or one inside it, that is larger when it is expanded."""
    size = file.seek(0, io.SEEK_END)
    with zipfile.ZipFile(file) as archive:
        check_compression(archive)
        parts = archive.infolist()
        if sum(part.file_size for part in parts) > size:
            raise ValueError("it is compressed: its members are larger than the file")
        for part in parts:
            if part.filename.endswith(".pth"):
                with zipfile.ZipFile(io.BytesIO(archive.read(part))) as inner:
                    check_compression(inner)
                    if sum(each.file_size for each in inner.infolist()) > part.file_size:
                        raise ValueError(f"{part.filename} is compressed: its members are larger than it")
    file.seek(0)


_STORAGES = {
    "DoubleStorage": "f8",
    "FloatStorage": "f4",
    "HalfStorage": "f2",
    "LongStorage": "i8",
    "IntStorage": "i4",
    "BoolStorage": "?",
}
"""Kind of number of a storage of PyTorch."""

_DICTIONARY, _TENSOR = "collections OrderedDict", "torch._utils _rebuild_tensor_v2"

_MARK = object()


def _read_tensors(content: bytes) -> dict[str, NDArray[Any]]:
    """Return the tensors of a file of PyTorch by name.

    Raises ValueError for other objects, and for tensors that are no plain part of their numbers; LookupError
    for numbers that are missing.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        names = archive.namelist()
        recipe = next((each for each in names if each.endswith("/data.pkl")), None)
        if recipe is None:
            raise ValueError("policy.pth has no tensors")
        folder = recipe[: -len("data.pkl")]
        order = archive.read(f"{folder}byteorder") if f"{folder}byteorder" in names else b"little"
        sign = ">" if order == b"big" else "<"

        def numbers(identity: object) -> NDArray[Any]:
            _, kind, key, *_ = _parts(identity)
            if not isinstance(kind, str) or kind.removeprefix("torch ") not in _STORAGES:
                raise ValueError(f"numbers of the kind {shown(kind)}")
            dtype = np.dtype(sign + _STORAGES[kind.removeprefix("torch ")])
            return np.frombuffer(archive.read(f"{folder}data/{key}"), dtype)

        found = _follow(archive.read(recipe), numbers)
    if not isinstance(found, dict):
        raise ValueError(f"policy.pth has {shown(found)}; wanted tensors by name")
    return {str(name): each for name, each in found.items() if isinstance(each, np.ndarray)}


def _follow(recipe: bytes, numbers: Callable[[object], NDArray[Any]]) -> object:
    """Return the object of a pickle of tensors; `numbers` returns those of a storage by its identity."""
    stack: list[Any] = []
    known: dict[int, Any] = {}

    def since_mark() -> list[Any]:
        at = max(k for k, each in enumerate(stack) if each is _MARK)
        taken = stack[at + 1 :]
        del stack[at:]
        return taken

    value: Any
    for instruction, value, _ in pickletools.genops(recipe):
        name = instruction.name
        if name in ("PROTO", "FRAME"):
            continue
        if name == "STOP":
            return stack.pop()
        if name in ("BINUNICODE", "SHORT_BINUNICODE", "BININT", "BININT1", "BININT2", "LONG1", "GLOBAL"):
            stack.append(value)
        elif name in ("BINPUT", "LONG_BINPUT"):
            known[value] = stack[-1]
        elif name in ("BINGET", "LONG_BINGET"):
            stack.append(known[value])
        elif name in _CONSTANTS:
            stack.append(_CONSTANTS[name])
        elif name == "EMPTY_DICT":
            stack.append({})
        elif name == "MARK":
            stack.append(_MARK)
        elif name == "TUPLE":
            stack.append(tuple(since_mark()))
        elif name in ("TUPLE1", "TUPLE2", "TUPLE3"):
            count = int(name[-1])
            stack[-count:] = [tuple(stack[-count:])]
        elif name == "BINPERSID":
            stack.append(numbers(stack.pop()))
        elif name == "REDUCE":
            arguments, function = stack.pop(), stack.pop()
            stack.append(_called(function, arguments))
        elif name == "BUILD":  # attributes of a dictionary, which say nothing about tensors
            stack.pop()
        elif name in ("SETITEM", "SETITEMS"):
            items = since_mark() if name == "SETITEMS" else [stack.pop(-2), stack.pop()]
            if not stack or not isinstance(stack[-1], dict) or len(items) % 2:
                raise ValueError("items of something that is no dictionary")
            stack[-1].update(zip(items[::2], items[1::2], strict=True))
        else:
            raise ValueError(f"it has other objects than tensors ({name}), which are not unpickled")
    raise ValueError("policy.pth ends too early")


_CONSTANTS: Mapping[str, Any] = {"EMPTY_TUPLE": (), "NONE": None, "NEWTRUE": True, "NEWFALSE": False}


def _called(function: object, arguments: object) -> object:
    """Return what a pickle of tensors has a function return: an empty dictionary, or a tensor."""
    if not isinstance(function, str) or not isinstance(arguments, tuple):
        raise ValueError(f"it calls {shown(function)}; only tensors are read")
    if function == _DICTIONARY and not arguments:
        return {}
    if function != _TENSOR:
        raise ValueError(f"it names {shown(function)}; only tensors are read")
    numbers, first, shape, strides, *_ = arguments
    shape, strides = _parts(shape), _parts(strides)
    if not isinstance(numbers, np.ndarray) or not all(
        type(each) is int and each >= 0 for each in (first, *shape, *strides)
    ):
        raise ValueError("a tensor without numbers")
    size = math.prod(shape)
    plain = [math.prod(shape[k + 1 :]) for k in range(len(shape))]
    if first + size > len(numbers):
        raise ValueError("a tensor is larger than its numbers")
    if any(a != b and side > 1 for a, b, side in zip(strides, plain, shape, strict=True)):
        raise ValueError("a tensor has another layout than plain numbers in memory")
    return numbers[first : first + size].reshape(shape)


def _parts(value: object) -> tuple[Any, ...]:
    if not isinstance(value, tuple):
        raise ValueError(f"{shown(value)} where a tuple was wanted")
    return value

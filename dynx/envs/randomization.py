"""`Randomization`: the parameters that an environment draws for each episode (domain randomisation).

`Variation` draws them, and the noise of observations and actions, with one row for each environment.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from dynx.argument_types import checks_types
from dynx.envs.library import Space, spaces
from dynx.errors import ArgumentError, UnknownNameError, UnsupportedFeatureError, nearest, shown
from dynx.model.numbers import MAX_MAGNITUDE, is_real, positive_seconds
from dynx.spatial.scalar import Floats
from dynx.steppers.random import BLOCK_STEPS, Purpose, StepNumbers, Streams, step_normals

Range = float | Sequence[float] | Mapping[str, Sequence[float]]
"""One number; ``(low, high)`` for uniform numbers between them; ``{"log_uniform": (low, high)}``, or
``{"normal": (mean, deviation)}``, whose numbers are clamped at three deviations."""

UNIFORM, LOG_UNIFORM, NORMAL = "uniform", "log_uniform", "normal"
KINDS = (UNIFORM, LOG_UNIFORM, NORMAL)

ANY, NOT_NEGATIVE, POSITIVE = "of any sign", "of at least 0", "above 0"
"""Numbers that a parameter can have."""

MAX_DEVIATIONS = 3.0
"""Distance from the mean, in deviations, at which normal numbers are clamped."""


@dataclass(frozen=True)
class Distribution:
    """A distribution of one of the `KINDS` with its two numbers."""

    kind: str
    first: float
    second: float

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and greatest number that can be drawn."""
        if self.kind == NORMAL:
            reach = MAX_DEVIATIONS * self.second
            return self.first - reach, self.first + reach
        return self.first, self.second

    def numbers(self, random: Floats) -> Floats:
        """Return numbers (...) from standard normal ones for `NORMAL`, else from those uniform in [0, 1)."""
        if self.kind == NORMAL:
            return np.asarray(self.first + self.second * np.clip(random, -MAX_DEVIATIONS, MAX_DEVIATIONS))
        if self.kind == LOG_UNIFORM:
            return np.asarray(self.first * (self.second / self.first) ** random)
        return self.first + (self.second - self.first) * random


def is_distribution(given: object) -> bool:
    """Check whether a value is meant as a distribution, and not as one for each of several names."""
    return not isinstance(given, Mapping) or (len(given) == 1 and next(iter(given)) in KINDS)


def read_distribution(name: str, given: Any, valid: str = NOT_NEGATIVE) -> Distribution:
    """Return the distribution that a user gave, whose numbers are `valid`: `ANY`, `NOT_NEGATIVE`, `POSITIVE`.

    Raises ArgumentError, which names the parameter, for anything else.
    """
    kind, pair = UNIFORM, (given, given) if is_real(given) else given
    if isinstance(given, Mapping):
        if len(given) != 1:
            raise ArgumentError(
                f"{name} is {shown(given)}; wanted one of {', '.join(KINDS)} with two numbers"
            )
        ((kind, pair),) = given.items()
        if kind not in KINDS:
            raise UnknownNameError(f"{name} has no distribution {shown(kind)}{nearest(kind, KINDS)}")
    if (
        not isinstance(pair, Sequence | np.ndarray)
        or isinstance(pair, str)
        or getattr(pair, "ndim", 1) != 1
        or len(pair) != 2
        or not all(is_real(x) and abs(x) < MAX_MAGNITUDE for x in pair)
    ):
        raise ArgumentError(
            f"{name} is {shown(given)}; wanted a number, (low, high), or {{'log_uniform': (low, high)}} or "
            "{'normal': (mean, deviation)}"
        )
    found = Distribution(kind, float(pair[0]), float(pair[1]))
    low, high = found.bounds
    if low > high:
        fault = "a deviation below 0" if kind == NORMAL else "a lower bound above the upper one"
        raise ArgumentError(f"{name} is {shown(given)}, with {fault}")
    if kind == LOG_UNIFORM:
        valid = POSITIVE
    if (valid != ANY and low < 0.0) or (valid == POSITIVE and low == 0.0):
        raise ArgumentError(f"{name} is {shown(given)}, which reaches {low:g}; wanted numbers {valid}")
    return found


Ranges = Range | Mapping[str, Range]
"""One distribution for all parts, of which an episode draws one number; or one for each named part."""

OF_ALL_PARTS = ("gain_scale", "motor_strength", "gravity_scale", "delay")
"""Fields with one distribution, which no part has alone."""

PAYLOAD_FIELDS = ("frame", "mass", "center")
PUSH_FIELDS = ("speed", "interval", "duration")
PUSH_DURATION = 0.1
"""Duration of a push [s] unless another is given."""
MAX_INTERVAL = 2.0**40
"""Largest number of control steps in an interval of pushes; more are as many, since no episode is as long."""
AXES = ("x", "y", "z")


@checks_types
@dataclass(frozen=True)
class Randomization:
    """Parameters that each episode draws; a field that is None keeps the value of the task.

    A distribution is a number, ``(low, high)`` for uniform numbers, ``{"log_uniform": (low, high)}``, or
    ``{"normal": (mean, deviation)}`` clamped at three deviations. A mapping from names to distributions draws
    a number for each part that it names.

    The robot that moves has the drawn parameters; the task computes with the nominal ones (a torque of
    gravity, for example), as a controller does. Raises ArgumentError (and its subclasses) for numbers that no
    robot has.
    """

    mass_scale: Ranges | None = None
    """Factor on mass and inertia of links, by name; in worlds also of bodies."""
    payload: Mapping[str, Any] | None = None
    """Point mass fixed to a frame: ``{"frame": "tool0", "mass": (0.0, 2.0), "center": (0.0, 0.0, 0.05)}``,
    with a distribution of the mass [kg] and one of each coordinate in the frame [m]."""
    joint_damping: Ranges | None = None
    """Viscous damping of joints, by name [N m s/rad or N s/m]."""
    joint_friction: Ranges | None = None
    """Dry friction of joints, by name [N m or N]."""
    friction_scale: Ranges | None = None
    """Factor on the coefficients of contact friction of links and bodies, by name; in worlds only."""
    gain_scale: Range | None = None
    """Factor on the gains of motors; in worlds only."""
    motor_strength: Range | None = None
    """Factor on the torques of motors and on their limits; in worlds only."""
    gravity_scale: Range | None = None
    """Factor on gravity; in worlds only."""
    pushes: Mapping[str, Any] | None = None
    """Pushes of the robots to horizontal directions at random: ``{"speed": (0.0, 1.0), "interval": 5.0}``. In
    each ``interval`` [s] of an episode a force that is proportional to its mass acts on every link. It begins
    at a random time and acts for the ``duration`` [s], by default 0.1. A robot on which nothing else acts
    gets the ``speed`` [m/s], which each push draws anew. In worlds only."""
    delay: Range | None = None
    """Time from an action until it acts [s]."""
    observation_noise: Range | Mapping[int | str, Range] | None = None
    """Standard deviation of Gaussian noise on observations: of all entries, or by the index of the entry."""
    action_noise: Range | Mapping[int | str, Range] | None = None
    """Standard deviation of Gaussian noise on the numbers of actions, which are clamped to their space."""

    def __post_init__(self) -> None:
        for each in fields(self):
            self.distributions(each.name)
        if not any(getattr(self, each.name) is not None for each in fields(self)):
            known = ", ".join(each.name for each in fields(self))
            raise ArgumentError(f"randomize names no parameter; known: {known}")

    @classmethod
    def read(cls, randomize: Randomization | Mapping[str, Any]) -> Randomization:
        """Return a randomization given itself, or as a mapping of its fields.

        Raises UnknownNameError for a field that does not exist, with the nearest one.
        """
        if isinstance(randomize, Randomization):
            return randomize
        if not isinstance(randomize, Mapping):
            raise ArgumentError(
                f"randomize is {shown(randomize)}; wanted a dict such as {{'mass_scale': (0.8, 1.2)}}"
            )
        known = [each.name for each in fields(cls)]
        for name in randomize:
            if name not in known:
                raise UnknownNameError(f"randomize has no parameter {shown(name)}{nearest(name, known)}")
        return cls(**randomize)

    @checks_types
    def distributions(self, name: str) -> dict[str | None, Distribution]:
        """Return the distributions of a field by the name of the part, which is None for all parts."""
        known = [each.name for each in fields(self)]
        if name not in known:
            raise UnknownNameError(f"randomize has no parameter {shown(name)}{nearest(name, known)}")
        given = getattr(self, name)
        if given is None:
            return {}
        if name == "payload":
            return _payload(given)
        if name == "pushes":
            return {"speed": _push_speed(given)}
        valid = POSITIVE if name == "mass_scale" else NOT_NEGATIVE
        if is_distribution(given) or name in OF_ALL_PARTS:
            return {None: read_distribution(name, given, valid)}
        if not given:
            raise ArgumentError(f"{name} names no part; wanted a distribution, or one for each of some names")
        return {
            str(part): read_distribution(f"{name} of {shown(part)}", each, valid)
            for part, each in given.items()
        }

    @property
    def payload_frame(self) -> str | None:
        """Frame to which the payload is fixed."""
        return None if self.payload is None else str(self.payload["frame"])


def _push_speed(given: Mapping[str, Any]) -> Distribution:
    """Return the distribution of the speed of pushes. Raises ArgumentError and UnknownNameError for pushes
    that are not valid."""
    for name in given:
        if name not in PUSH_FIELDS:
            raise UnknownNameError(f"pushes has no {shown(name)}{nearest(name, PUSH_FIELDS)}")
    for name in PUSH_FIELDS[:2]:
        if name not in given:
            raise ArgumentError(f"pushes has no {name}: {shown(given)}")
    interval = positive_seconds("the interval of pushes", given["interval"])
    duration = positive_seconds("the duration of pushes", given.get("duration", PUSH_DURATION))
    if duration > interval:
        raise ArgumentError(
            f"pushes last {duration:g} s; wanted at most the interval of {interval:g} s, which has one push"
        )
    return read_distribution("the speed of pushes", given["speed"])


def _payload(given: Any) -> dict[str | None, Distribution]:
    """Return the distributions of the mass and of the coordinates x, y and z of a payload."""
    if not isinstance(given, Mapping):
        raise ArgumentError(f"payload is {shown(given)}; wanted {{'frame': name, 'mass': (low, high)}}")
    for name in given:
        if name not in PAYLOAD_FIELDS:
            raise UnknownNameError(f"payload has no {shown(name)}{nearest(name, PAYLOAD_FIELDS)}")
    for name in PAYLOAD_FIELDS[:2]:
        if name not in given:
            raise ArgumentError(f"payload has no {name}: {shown(given)}")
    if not isinstance(given["frame"], str):
        raise ArgumentError(
            f"the frame of the payload is {shown(given['frame'])}; wanted the name of a frame"
        )
    center = given.get("center", (0.0, 0.0, 0.0))
    if not isinstance(center, Sequence) or isinstance(center, str) or len(center) != len(AXES):
        raise ArgumentError(f"the center of the payload is {shown(center)}; wanted three numbers or ranges")
    found: dict[str | None, Distribution] = {
        "mass": read_distribution("the mass of the payload", given["mass"])
    }
    for axis, each in zip(AXES, center, strict=True):
        found[axis] = read_distribution(f"{axis} of the payload", each, ANY)
    return found


class Parameter(NamedTuple):
    """A parameter that episodes draw."""

    field: str
    """Field of `Randomization`."""
    part: str | None
    """Link, joint, body or entry that has it; None for all of them."""
    distribution: Distribution
    step: float = 0.0
    """Distance of the values to which it is rounded; 0 for none."""

    @property
    def name(self) -> str:
        """Name in `info`, such as ``mass_scale.pole``."""
        return self.field if self.part is None else f"{self.field}.{self.part}"


def parameters_of(
    randomization: Randomization,
    fields: Iterable[str],
    require: Callable[[str, str], str] = lambda _, part: part,
    delay_step: float = 0.0,
) -> tuple[Parameter, ...]:
    """Return the parameters of these fields; a delay is rounded to multiples of `delay_step`.

    ``require(field, part)`` returns the name of a part, or raises.
    """
    return tuple(
        Parameter(
            field,
            None if part is None else require(field, part),
            distribution,
            delay_step if field == "delay" else 0.0,
        )
        for field in fields
        for part, distribution in randomization.distributions(field).items()
    )


def require_name(kind: str, name: str, known: Sequence[str]) -> str:
    """Return the name. Raises UnknownNameError for one that is not known."""
    if name not in known:
        raise UnknownNameError(f"no {kind} {shown(name)}{nearest(name, known)}")
    return name


class Draws:
    """Values of parameters in the episodes of environments."""

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        self.parameters = tuple(parameters)
        self.names = tuple(each.name for each in parameters)
        # By the name, so that a value does not depend on what else is drawn.
        self._lanes = [crc32(name.encode()) for name in self.names]

    def values(self, streams: Streams, row: int, block: int) -> Floats:
        """Return the values (BLOCK_STEPS, k) in the episodes of a block, in the environment number `row`."""
        values, random = np.empty((BLOCK_STEPS, len(self.parameters))), np.empty(BLOCK_STEPS)
        for column, (each, lane) in enumerate(zip(self.parameters, self._lanes, strict=True)):
            draw = streams.normal if each.distribution.kind == NORMAL else streams.uniform
            draw(Purpose.PARAMETERS, lane, block, random, row)
            drawn = each.distribution.numbers(random)
            values[:, column] = np.round(drawn / each.step) * each.step if each.step else drawn
        return values


def first_seed(seed: int | None, rng: np.random.Generator) -> int:
    """Return the seed of the first environment: that of Gymnasium's generator `rng`, or one drawn from it
    where it is unknown (None or below 0)."""
    return int(rng.integers(2**63)) if seed is None or seed < 0 else seed


class Pushes:
    """Pushes of robots in `count` environments, drawn a block of intervals at a time."""

    def __init__(self, pushes: Mapping[str, Any], control_dt: float, count: int) -> None:
        """`pushes` are those of a `Randomization`; interval and duration are rounded to control steps."""
        self._speed = _push_speed(pushes)
        self._interval = max(1, round(min(pushes["interval"] / control_dt, MAX_INTERVAL)))
        duration = pushes.get("duration", PUSH_DURATION) / control_dt
        self._duration = max(1, round(min(duration, self._interval)))
        self._control_dt = control_dt
        self._numbers = StepNumbers(count, 3, self._draw)

    def forget(self) -> None:
        """Draw anew, after the seeds have changed."""
        self._numbers.forget()

    def at(
        self,
        streams: Streams,
        rows: NDArray[np.intp],
        episodes: NDArray[np.int64],
        steps: NDArray[np.int64],
    ) -> Floats:
        """Return the accelerations (n, 2) [m/s^2] along x and y of the world, of environments `rows` (n,) in
        `steps` (n,) of their `episodes`."""
        intervals, step = np.divmod(steps, self._interval)
        drawn = self._numbers.at(streams, rows, episodes, intervals)
        begin = drawn[:, 0]
        pushed = (begin <= step) & (step < begin + self._duration)
        return np.where(pushed[:, None], drawn[:, 1:], 0.0)

    def _draw(self, streams: Streams, row: int, episode: int, block: int, out: Floats) -> None:
        """Draw the first step and the acceleration of the pushes in a block of intervals."""
        random, speed = np.empty((BLOCK_STEPS, 2)), np.empty(BLOCK_STEPS)
        streams.uniform(Purpose.PUSH, episode, block, random, row)
        draw = streams.normal if self._speed.kind == NORMAL else streams.uniform
        draw(Purpose.PUSH_SPEED, episode, block, speed, row)
        angle = 2.0 * np.pi * random[:, 1]
        acceleration = self._speed.numbers(speed) / (self._duration * self._control_dt)
        out[:, 0] = np.floor(random[:, 0] * (self._interval - self._duration + 1))
        out[:, 1:] = acceleration[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


class Variation:
    """Drawn values, noise and pushes of `count` environments.

    Environment k has the seed of the first plus k. Its values depend on that seed, the number of the episode
    since the seed was set, and the name of the parameter; its noise and pushes also on the step of the
    episode.
    """

    def __init__(
        self,
        randomization: Randomization,
        motion: Sequence[Parameter],
        observation_space: Space[Any],
        action_space: Space[Any],
        control_dt: float,
        count: int = 1,
    ) -> None:
        """`motion` are the parameters other than noise and pushes. Raises UnsupportedFeatureError and
        ArgumentError for noise that the spaces cannot have."""
        on_observations = noise_parameters(randomization, "observation_noise", observation_space)
        on_actions = noise_parameters(randomization, "action_noise", action_space)
        first, second = len(motion), len(motion) + len(on_observations)
        self._draws = Draws((*motion, *on_observations, *on_actions))
        self.observation_noise = make_noise(
            Purpose.OBSERVATION, observation_space, on_observations, first, count
        )
        self.action_noise = make_noise(Purpose.ACTION, action_space, on_actions, second, count)
        pushes = randomization.pushes
        self.pushes = None if pushes is None else Pushes(pushes, control_dt, count)
        self.motion_size = len(motion)
        self.values: Floats = np.zeros((count, len(self._draws.names)))
        """Values (count, k) of the present episodes; the first `motion_size` are those of the motion."""
        self._seeds = [0] * count
        self._streams = Streams(*self._seeds)
        self._episodes = np.full(count, -1)
        self._steps = np.zeros(count, dtype=np.int64)
        self._everywhere, self._dtype = np.arange(count), observation_space.dtype
        self._ahead: Floats = np.zeros((count, BLOCK_STEPS, len(self._draws.names)))

    def seed(self, seeds: Sequence[int], rows: NDArray[np.intp] | None = None) -> None:
        """Seed some environments, by default all: each with its own of `seeds` (count,). The next episode of
        each is its first."""
        chosen = self._everywhere if rows is None else rows
        for row in chosen.tolist():
            self._seeds[row] = seeds[row]
        self._streams = Streams(*self._seeds)
        self._episodes[chosen] = -1
        for noise in (self.observation_noise, self.action_noise):
            if noise is not None:
                noise.numbers.forget()
        if self.pushes is not None:
            self.pushes.forget()

    def start(self, rows: NDArray[np.intp] | None = None) -> None:
        """Draw the values of the next episodes of some environments, by default of all."""
        chosen = self._everywhere if rows is None else rows
        self._episodes[chosen] += 1
        self._steps[chosen] = 0
        place = self._episodes[chosen] % BLOCK_STEPS
        for row in chosen[place == 0].tolist():
            block = int(self._episodes[row]) // BLOCK_STEPS
            self._ahead[row] = self._draws.values(self._streams, row, block)
        self.values[chosen] = self._ahead[chosen, place]

    def restart(self) -> None:
        """Count the steps of all episodes from 0 again."""
        self._steps[:] = 0

    def count_step(self) -> None:
        """Note that a step was taken."""
        self._steps += 1

    def noisy_observations(self, observations: Floats, rows: NDArray[np.intp] | None = None) -> Floats:
        """Return observations (n, size) with the noise of the present steps of some environments; without it
        they have the precision of the observation space."""
        noise = self.observation_noise
        if noise is None:
            return observations
        observations = observations.astype(self._dtype).astype(np.float64)
        return noise.added(observations, self._numbers(noise, self._everywhere if rows is None else rows))

    def noise_on_actions(self) -> Floats:
        """Return the noise (count, size) of the actions of the next steps; no entries without any."""
        if self.action_noise is None:
            return np.zeros((len(self.values), 0))
        return self._numbers(self.action_noise, self._everywhere)

    def accelerations(self) -> Floats:
        """Return the accelerations (count, 2) [m/s^2] along x and y by pushes during the next steps."""
        if self.pushes is None:
            return np.zeros((len(self.values), 2))
        return self.pushes.at(self._streams, self._everywhere, self._episodes, self._steps)

    def _numbers(self, noise: SpaceNoise, rows: NDArray[np.intp]) -> Floats:
        drawn = noise.numbers.at(self._streams, rows, self._episodes[rows], self._steps[rows])
        return noise.scaled(drawn, self.values[rows])

    def by_name(self, rows: NDArray[np.intp] | None = None) -> dict[str, Floats]:
        """Return the values of some environments (n,) by the names of the parameters."""
        found = self.values if rows is None else self.values[rows]
        return {name: found[:, k].copy() for k, name in enumerate(self._draws.names)}


class SpaceNoise:
    """Noise on the entries of a `Box` space, by parameters in some columns of the drawn values."""

    def __init__(
        self, purpose: Purpose, space: spaces.Box, parameters: Sequence[Parameter], first: int, count: int
    ) -> None:
        size = int(np.prod(space.shape))
        self._columns = {
            None if each.part is None else int(each.part): first + k for k, each in enumerate(parameters)
        }
        self.numbers = step_normals(purpose, count, size)
        """Standard normal numbers of `count` environments."""
        self._low, self._high = (each.ravel().astype(np.float64) for each in (space.low, space.high))

    def scaled(self, noise: Floats, values: Floats) -> Floats:
        """Return the noise (n, size) from standard normal numbers and the drawn values (n, k)."""
        if None in self._columns:
            return noise * values[:, self._columns[None], None]
        deviations = np.zeros_like(noise)
        for entry, column in self._columns.items():
            deviations[:, entry] = values[:, column]
        return noise * deviations

    def added(self, numbers: Floats, noise: Floats) -> Floats:
        """Return numbers (n, size) with noise, clamped to the space."""
        return np.asarray(np.clip(numbers + noise, self._low, self._high))


def noise_parameters(randomization: Randomization, name: str, space: Space[Any]) -> tuple[Parameter, ...]:
    """Return the parameters of the noise on a space: of observations or of actions.

    Raises UnsupportedFeatureError for choices, ArgumentError for an entry that the space does not have.
    """
    size = int(np.prod(space.shape)) if isinstance(space, spaces.Box) else 0

    def require(_: str, part: str) -> str:
        if not part.isdecimal() or int(part) >= size:
            raise ArgumentError(
                f"{name} names entry {part}; wanted the number of an entry from 0 to {size - 1}"
            )
        return str(int(part))

    if randomization.distributions(name) and not isinstance(space, spaces.Box):
        raise UnsupportedFeatureError(f"{name} needs a Box space of numbers; that of this task is {space}")
    return parameters_of(randomization, (name,), require)


def make_noise(
    purpose: Purpose, space: Space[Any], parameters: Sequence[Parameter], first: int, count: int
) -> SpaceNoise | None:
    """Return the noise of `count` environments with these parameters, whose columns begin at `first`; None
    without any."""
    if not parameters or not isinstance(space, spaces.Box):
        return None
    return SpaceNoise(purpose, space, parameters, first, count)

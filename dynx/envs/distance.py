"""How far apart the engines are on one task: the same seeds and the same actions on each of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.envs.environment import Act
from dynx.envs.library import Env
from dynx.errors import ArgumentError
from dynx.model.numbers import whole_number
from dynx.world.record import Channel, Record
from dynx.world.separation import separation


@dataclass(frozen=True, eq=False)
class EpisodeRecord:
    """One episode on one engine; it ends where the task ends it or the actions are at an end."""

    engine: str
    seed: int
    observations: NDArray[np.float64]
    """Observations (steps + 1, size), the first of them from `reset`."""
    rewards: NDArray[np.float64]
    """Rewards (steps,)."""
    terminated: bool

    @property
    def record(self) -> Record:
        """Entries of the observation over the number of the step."""
        entries = tuple(map(str, range(self.observations.shape[1])))
        channel = Channel(self.observations, entries, ("",) * len(entries))
        return Record(self.engine, np.arange(float(len(self.observations))), {"observation": channel})

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.rewards)

    @property
    def episode_return(self) -> float:
        """Sum of the rewards."""
        return float(self.rewards.sum())


@dataclass(frozen=True, eq=False)
class EpisodeDifference:
    """Difference of the observations of two engines, in the episode of one seed."""

    engines: tuple[str, str]
    seed: int
    step: int | None
    """First step at which they differ by more than the tolerance; None if they never do."""
    entry: int | None
    """The entry of the observation that differs most at that step."""
    largest: float
    """Largest difference of an entry over the steps that both have."""
    returns: tuple[float, float]
    lengths: tuple[int, int]


@dataclass(frozen=True, eq=False)
class EngineDistance:
    """Episodes of the same seeds and actions on several engines, and how each two of them differ."""

    engines: tuple[str, ...]
    tolerance: float
    records: tuple[EpisodeRecord, ...]
    differences: tuple[EpisodeDifference, ...]
    observation_names: tuple[str, ...] = ()
    """Names of the entries of the observation; empty where the environment does not name them."""

    def entry_name(self, entry: int | None) -> str | None:
        """Return the name of an entry of the observation, or ``entry 3`` without names; None for None."""
        if entry is None:
            return None
        names = self.observation_names
        return names[entry] if entry < len(names) else f"entry {entry}"

    def of(self, a: str, b: str) -> list[EpisodeDifference]:
        """Return the differences of two engines, one for each seed."""
        return [each for each in self.differences if each.engines == (a, b)]

    def __repr__(self) -> str:
        different = sum(each.step is not None for each in self.differences)
        return (
            f"<EngineDistance of {', '.join(self.engines)}: {different} of {len(self.differences)} pairs "
            f"of episodes differ by more than {self.tolerance:g}>"
        )


def engine_distance(
    make: Callable[[str], Env[Any, Any]],
    engines: Sequence[str],
    *,
    seeds: Sequence[int] = tuple(range(10)),
    steps: int = 200,
    tolerance: float = 1e-6,
    policy: Act | None = None,
    progress: Callable[[int], object] = lambda _: None,
) -> EngineDistance:
    """Run episodes with the same actions on each engine, and compare the observations step by step.

    ``make(engine)`` makes the environment. The actions of a seed are at most `steps`: random ones of the
    action space, drawn from the seed, or those that `policy` takes on the first engine; every engine gets
    these, so that a difference is one of the engines and not of the policy. Differences are absolute, in the
    units of the observation. `progress` is called with the number of episodes that are done.

    Raises ArgumentError for fewer than two engines, one that is named twice, and a tolerance that is no
    positive number.
    """
    if len(engines) < 2 or len(set(engines)) < len(engines):
        raise ArgumentError(f"wanted two engines or more, each once; got {', '.join(engines) or 'none'}")
    if not (np.isfinite(tolerance) and tolerance > 0.0):
        raise ArgumentError(f"tolerance is {tolerance}; wanted a positive number")
    whole_number("steps", steps, 1)
    records: list[EpisodeRecord] = []
    actions: dict[int, list[Any]] = {}
    names: tuple[str, ...] = ()
    for engine in engines:
        env = make(engine)
        try:
            names = getattr(env.unwrapped, "observation_names", names)
            for seed in seeds:
                record, taken = _run(env, engine, seed, steps, actions.get(seed), policy)
                actions.setdefault(seed, taken)
                records.append(record)
                progress(len(records))
        finally:
            env.close()
    by_name = {(each.engine, each.seed): each for each in records}
    differences = tuple(
        _difference(by_name[a, seed], by_name[b, seed], tolerance)
        for a, b in combinations(engines, 2)
        for seed in seeds
    )
    return EngineDistance(tuple(engines), tolerance, tuple(records), differences, names)


def _run(
    env: Env[Any, Any],
    engine: str,
    seed: int,
    steps: int,
    given: Sequence[Any] | None,
    policy: Act | None,
) -> tuple[EpisodeRecord, list[Any]]:
    """Run one episode with the actions `given`, or with chosen ones; return it and the actions taken."""
    env.action_space.seed(seed)
    observation, _ = env.reset(seed=seed)
    observations, rewards, terminated = [_numbers(observation)], [], False
    taken: list[Any] = []
    for k in range(steps if given is None else len(given)):
        if given is not None:
            action = given[k]
        elif policy is None:
            action = env.action_space.sample()
        else:
            action = policy(np.asarray(observation)[None])[0]
        taken.append(action)
        observation, reward, terminated, truncated, _ = env.step(action)
        observations.append(_numbers(observation))
        rewards.append(float(reward))
        if terminated or truncated:
            break
    return EpisodeRecord(engine, seed, np.array(observations), np.array(rewards), bool(terminated)), taken


def _numbers(observation: Any) -> NDArray[np.float64]:
    return np.asarray(observation, dtype=np.float64).ravel()


def _difference(a: EpisodeRecord, b: EpisodeRecord, tolerance: float) -> EpisodeDifference:
    """Compare two episodes over the steps that both have; one that ends earlier differs where it ends."""
    common = min(a.steps, b.steps)
    apart = separation(a.record, b.record)
    beyond = np.flatnonzero(apart.distance > tolerance)
    step: int | None = int(beyond[0]) if beyond.size else None
    entry = int(np.argmax(apart.distances[step])) if step is not None else None
    # Only an end by the task is a difference: the first engine's episode has as many steps as actions.
    if step is None and (a.steps != b.steps or a.terminated != b.terminated):
        step = common
    return EpisodeDifference(
        (a.engine, b.engine),
        a.seed,
        step,
        entry,
        apart.largest,
        (a.episode_return, b.episode_return),
        (a.steps, b.steps),
    )

"""Judging a policy: returns of whole episodes, and how well their mean is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.argument_types import checks_types
from dynx.envs.environment import DIVERGED, Act
from dynx.envs.library import Env
from dynx.errors import ArgumentError
from dynx.model.numbers import checked_seed, whole_number

MAX_EPISODES = 10**7
"""Largest number of episodes of one evaluation."""

CONFIDENCE = 0.95
"""Probability with which an interval holds the true mean."""

AT_ONCE = 8
"""Number of environments that are judged together; a policy takes little longer for all of them."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Returns and lengths (episodes,) of whole episodes; episode k began with seed ``seed + k``."""

    returns: NDArray[np.float64]
    lengths: NDArray[np.int64]
    seed: int
    diverged: int = 0
    """Number of episodes that were truncated because a step diverged."""

    @property
    def mean(self) -> float:
        """Mean of the returns."""
        return float(self.returns.mean())

    @property
    def deviation(self) -> float:
        """Standard deviation of the returns over the episodes."""
        return float(self.returns.std())

    @property
    def interval(self) -> tuple[float, float]:
        """Interval that holds the true mean with 95 % confidence (Student's t)."""
        return confidence_interval(self.returns)

    def __repr__(self) -> str:
        low, high = self.interval
        diverged = f", {self.diverged} of which diverged" if self.diverged else ""
        return (
            f"<Evaluation: return {self.mean:.4g} +/- {self.deviation:.3g} over {len(self.returns)} "
            f"episodes{diverged}, mean within {low:.4g} to {high:.4g}>"
        )


@checks_types
def evaluate(
    act: Act,
    envs: Sequence[Env[Any, Any]],
    episodes: int = 100,
    seed: int = 0,
    progress: Callable[[int], object] = lambda _: None,
) -> Evaluation:
    """Run whole episodes in several environments of one task; each starts in the first environment that is
    free.

    Episode k begins with ``reset(seed=seed + k)``, the same on every engine. Every episode counts, long or
    short. `progress` is called with the number of episodes that have ended.
    """
    whole_number("episodes", episodes, 1, MAX_EPISODES)
    seed = checked_seed("seed", seed)
    if not envs:
        raise ArgumentError("envs is empty; wanted at least one environment to judge the policy in")
    returns, lengths = np.zeros(episodes), np.zeros(episodes, dtype=np.int64)
    running: dict[int, tuple[int, Any]] = {}
    begun = ended = diverged = 0
    while ended < episodes:
        for k in range(len(envs)):
            if k not in running and begun < episodes:
                running[k] = begun, envs[k].reset(seed=seed + begun)[0]
                begun += 1
        places = sorted(running)
        actions = act(np.stack([running[k][1] for k in places]))
        for k, action in zip(places, actions, strict=True):
            number = running[k][0]
            observation, reward, terminated, truncated, info = envs[k].step(action)
            returns[number] += float(reward)
            lengths[number] += 1
            running[k] = number, observation
            if terminated or truncated:
                del running[k]
                ended += 1
                diverged += DIVERGED in info
                progress(ended)
    return Evaluation(returns, lengths, seed, diverged)


def confidence_interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return the interval of Student's t that holds the true mean with the probability `CONFIDENCE`;
    unbounded for one value."""
    from scipy.stats import t  # takes half a second to import

    mean, count = float(values.mean()), len(values)
    if count < 2:
        return -np.inf, np.inf
    reach = float(t.ppf(0.5 + 0.5 * CONFIDENCE, count - 1)) * float(values.std(ddof=1)) / np.sqrt(count)
    return mean - reach, mean + reach


def mean_of_runs(means: Sequence[float]) -> tuple[float, tuple[float, float]]:
    """Return the mean over runs with several seeds, and its 95 % interval: each run counts once."""
    values = np.array(means)
    return float(values.mean()), confidence_interval(values)

"""Steps a second of vector environments: dynx, Gymnasium and EnvPool, on one thread.

    python -m benchmarks.environments [--repetitions 5]

The implementations take turns; the best of all repetitions counts, in processor time of the whole process, so
that other programs disturb it less and threads of an implementation are counted. Actions are drawn before.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from typing import Any, NamedTuple

import gymnasium
import numpy as np

import dynx.envs  # noqa: F401  (registers the environments)

SIZES = (1024, 16384)
MIN_SECONDS = 0.2
"""Processor time of one measurement [s]."""

DRAWN = 16
"""Number of arrays of actions, which are used in turn."""

VECTOR = "vector_entry_point"


class Case(NamedTuple):
    """An implementation of a task."""

    task: str
    name: str
    n: int
    make: Callable[[], Any]


def cases() -> Iterator[Case]:
    """Yield all implementations."""
    for n in SIZES:
        for copy in (True, False):
            suffix = "" if copy else ", copy=False"
            yield Case("CartPole", f"dynx{suffix}", n, _dynx("dynx/CartPole-v0", n, copy=copy))
        yield Case("CartPole", "Gymnasium, CartPoleVectorEnv", n, _gymnasium("CartPole-v1", n, VECTOR))
        if find_spec("envpool"):
            yield Case("CartPole", "EnvPool", n, _envpool("CartPole-v1", n))
    yield Case("CartPole", "Gymnasium, SyncVectorEnv", 64, _gymnasium("CartPole-v1", 64, "sync"))
    for name in ("Pendulum", "Acrobot"):
        yield Case(name, "dynx", SIZES[0], _dynx(f"dynx/{name}-v0", SIZES[0]))
        if find_spec("envpool"):
            yield Case(name, "EnvPool", SIZES[0], _envpool(f"{name}-v1", SIZES[0]))
        yield Case(name, "Gymnasium, SyncVectorEnv", 64, _gymnasium(f"{name}-v1", 64, "sync"))
    for n in SIZES:
        yield Case("Reach on UR5", "dynx, copy=False", n, _dynx("dynx/Reach-v0", n, copy=False))


def _dynx(env_id: str, n: int, **options: Any) -> Callable[[], Any]:
    return lambda: gymnasium.make_vec(env_id, num_envs=n, vectorization_mode=VECTOR, **options)


def _gymnasium(env_id: str, n: int, mode: str) -> Callable[[], Any]:
    return lambda: gymnasium.make_vec(env_id, num_envs=n, vectorization_mode=mode)


def _envpool(env_id: str, n: int) -> Callable[[], Any]:
    def make() -> Any:
        import envpool

        return envpool.make_gymnasium(env_id, num_envs=n, batch_size=n, num_threads=1)

    return make


class Timing:
    """Repeated measurements of one case."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self._env = case.make()
        single = getattr(self._env, "single_action_space", self._env.action_space)
        rng = np.random.default_rng(0)
        self._actions: list[Any] = [_draw(single, case.n, rng) for _ in range(DRAWN)]
        self._env.reset()
        self._take(DRAWN)
        self._steps, self.best = DRAWN, np.inf
        while self._take(self._steps) < MIN_SECONDS:
            self._steps *= 2

    def repeat(self) -> None:
        """Measure once more."""
        self.best = min(self.best, self._take(self._steps) / (self._steps * self.case.n))

    def _take(self, steps: int) -> float:
        env, actions = self._env, self._actions
        started = time.process_time()
        for k in range(steps):
            env.step(actions[k % DRAWN])
        return time.process_time() - started

    def close(self) -> None:
        """Close the environments."""
        self._env.close()


def _draw(space: Any, n: int, rng: np.random.Generator) -> Any:
    if hasattr(space, "n"):
        return rng.integers(0, space.n, n)
    return rng.uniform(space.low, space.high, (n, *space.shape)).astype(np.float32)


def main(given: Sequence[str] | None = None) -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--task", action="append", help="name of a task; by default all")
    chosen = parser.parse_args(given)
    timings = [Timing(case) for case in cases() if not chosen.task or case.task in chosen.task]
    for _ in range(chosen.repetitions):
        for timing in timings:
            timing.repeat()
    print("| task | implementation | environments | million steps a second |")
    print("|---|---|---|---|")
    for timing in timings:
        task, name, n, _ = timing.case
        print(f"| {task} | {name} | {n:,} | {1e-6 / timing.best:.3g} |")
        timing.close()


if __name__ == "__main__":
    main()

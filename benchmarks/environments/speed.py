"""Steps a second of vector environments: dynx, Gymnasium and EnvPool, on one thread.

    python -m benchmarks.environments [--repetitions 5]

The implementations take turns; the best of all repetitions counts, in processor time of the whole process, so
that other programs disturb it less and threads of an implementation are counted. Actions are drawn before.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from importlib.util import find_spec
from typing import Any, NamedTuple

import gymnasium
import numpy as np

import dynx.envs  # noqa: F401  (registers the environments)
from dynx.bench.timing import interleaved

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


def fastest(chosen: Sequence[Case], repetitions: int) -> list[float]:
    """Return the million steps a second of each case, all cases in turn."""
    with ExitStack() as closing_all:
        calls = [_steps(case, closing_all.enter_context(closing(case.make()))) for case in chosen]
        times = interleaved(calls, repetitions, time.process_time, least_seconds=MIN_SECONDS)
    return [1e-6 * DRAWN * case.n / each.least for case, each in zip(chosen, times, strict=True)]


def _steps(case: Case, env: Any) -> Callable[[], None]:
    """Return a call that makes a step with each of the drawn actions."""
    single = getattr(env, "single_action_space", env.action_space)
    rng = np.random.default_rng(0)
    actions: list[Any] = [_draw(single, case.n, rng) for _ in range(DRAWN)]
    env.reset()

    def call() -> None:
        for action in actions:
            env.step(action)

    return call


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
    wanted = [case for case in cases() if not chosen.task or case.task in chosen.task]
    speeds = fastest(wanted, chosen.repetitions)
    print("| task | implementation | environments | million steps a second |")
    print("|---|---|---|---|")
    for (task, name, n, _), speed in zip(wanted, speeds, strict=True):
        print(f"| {task} | {name} | {n:,} | {speed:.3g} |")


if __name__ == "__main__":
    main()

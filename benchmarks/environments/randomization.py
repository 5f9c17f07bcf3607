"""Steps a second of vector CartPole with parameters of its own in each environment.

python -m benchmarks.environments.randomization [--repetitions 5]
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium

from benchmarks.environments.speed import SIZES, VECTOR, Case, Timing

MASSES = {"mass_scale": {"pole": (0.5, 2.0), "cart": (0.8, 1.2)}}
FRICTION = {"joint_damping": (0.0, 0.1), "joint_friction": (0.0, 0.1), "delay": (0.0, 0.04)}
DRAWN: Mapping[str, Mapping[str, Any] | None] = {
    "none": None,
    "two masses": MASSES,
    "two masses, damping, friction, delay": {**MASSES, **FRICTION},
    "observation noise": {"observation_noise": 0.01},
}


def main(given: Sequence[str] | None = None) -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--repetitions", type=int, default=5)
    repetitions = parser.parse_args(given).repetitions
    timings = {
        (name, n): Timing(Case("CartPole", name, n, _maker(n, drawn)))
        for name, drawn in DRAWN.items()
        for n in SIZES
    }
    for _ in range(repetitions):
        for timing in timings.values():
            timing.repeat()
    print(f"| drawn | {' | '.join(f'{n:,} environments' for n in SIZES)} |")
    print("|---|" + "---|" * len(SIZES))
    for name in DRAWN:
        print(f"| {name} | {' | '.join(f'{1e-6 / timings[name, n].best:.3g}' for n in SIZES)} |")
    for timing in timings.values():
        timing.close()


def _maker(n: int, drawn: Mapping[str, Any] | None) -> Any:
    return lambda: gymnasium.make_vec(
        "dynx/CartPole-v0", num_envs=n, vectorization_mode=VECTOR, randomize=drawn
    )


if __name__ == "__main__":
    main()

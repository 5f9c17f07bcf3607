"""Steps a second of vector environments with parameters of its own in each of them.

python -m benchmarks.environments.randomization [--repetitions 5]
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium

from benchmarks.environments.speed import SIZES, VECTOR, Case, fastest

MASSES = {"mass_scale": {"pole": (0.5, 2.0), "cart": (0.8, 1.2)}}
FRICTION = {"joint_damping": (0.0, 0.1), "joint_friction": (0.0, 0.1), "delay": (0.0, 0.04)}
PAYLOAD = {"payload": {"frame": "tool0", "mass": (0.0, 3.0), "center": (0.0, 0.0, 0.05)}}
CASES: Mapping[tuple[str, str], Mapping[str, Any] | None] = {
    ("CartPole", "none"): None,
    ("CartPole", "two masses"): MASSES,
    ("CartPole", "two masses, damping, friction, delay"): {**MASSES, **FRICTION},
    ("CartPole", "observation noise"): {"observation_noise": 0.01},
    ("Reach", "none"): None,
    ("Reach", "payload, damping, friction, delay"): {**PAYLOAD, **FRICTION},
}
"""Drawn parameters by task and name."""


def main(given: Sequence[str] | None = None) -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--repetitions", type=int, default=5)
    repetitions = parser.parse_args(given).repetitions
    cases = [
        Case(task, name, n, _maker(task, n, drawn)) for (task, name), drawn in CASES.items() for n in SIZES
    ]
    speeds = iter(fastest(cases, repetitions))
    print(f"| task | drawn | {' | '.join(f'{n:,} environments' for n in SIZES)} |")
    print("|---|---|" + "---|" * len(SIZES))
    for task, name in CASES:
        print(f"| {task} | {name} | {' | '.join(f'{next(speeds):.3g}' for _ in SIZES)} |")


def _maker(task: str, n: int, drawn: Mapping[str, Any] | None) -> Any:
    return lambda: gymnasium.make_vec(
        f"dynx/{task}-v0", num_envs=n, vectorization_mode=VECTOR, randomize=drawn
    )


if __name__ == "__main__":
    main()

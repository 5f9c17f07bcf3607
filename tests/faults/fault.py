"""Planted fault: one deliberate mistake in the source of dynx and the test that must notice it."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass

OPTIONAL = {
    "pybullet": "pybullet",
    "pinocchio": "pinocchio",
    "mujoco": "mujoco",
    "drake": "pydrake",
    "tests/training/": "stable_baselines3",
    "tests/viewer/": "viser",
}
"""Part of the name of a module or test -> the top-level module that it then needs, and that may be absent."""


@dataclass(frozen=True)
class Fault:
    """One deliberate mistake: in `module`, `right` becomes `wrong`, and a test must then fail.

    `right` must occur exactly once in the source of the module, so that the catalogue follows the code.
    """

    name: str
    module: str
    right: str
    wrong: str
    test_file: str
    test: str

    @property
    def caught_by(self) -> str:
        """Test that must fail, as pytest names it."""
        return f"{self.test_file}::{self.test}"

    @property
    def needs(self) -> str | None:
        """Top-level module that the fault or its test needs and that may be absent, or None."""
        for part, top_level in OPTIONAL.items():
            if part in self.module or part in self.caught_by:
                return top_level
        return None

    @property
    def can_be_tried(self) -> bool:
        """Whether what it needs is installed."""
        return self.needs is None or importlib.util.find_spec(self.needs) is not None

    def faulty_source(self, source: str) -> str:
        """Return the source with the mistake in it; raise ValueError unless it fits exactly once."""
        count = source.count(self.right)
        if count != 1:
            raise ValueError(f"fault {self.name}: its text occurs {count} times in {self.module}, not once")
        return source.replace(self.right, self.wrong)

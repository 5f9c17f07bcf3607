"""Planted fault: one deliberate mistake in the source of dynx and the test that must notice it."""

from __future__ import annotations

from dataclasses import dataclass

ENGINES = {"pybullet": "pybullet", "pinocchio": "pinocchio", "mujoco": "mujoco", "drake": "pydrake"}
"""Name of an engine in modules and tests -> the top-level module that it is imported as."""


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
    def engine(self) -> str | None:
        """Module to import for the engine that the fault or its test needs, or None."""
        for engine, top_level in ENGINES.items():
            if engine in self.module or engine in self.caught_by:
                return top_level
        return None

    def faulty_source(self, source: str) -> str:
        """Return the source with the mistake in it; raise ValueError unless it fits exactly once."""
        count = source.count(self.right)
        if count != 1:
            raise ValueError(f"fault {self.name}: its text occurs {count} times in {self.module}, not once")
        return source.replace(self.right, self.wrong)

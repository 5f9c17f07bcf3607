"""What a planted fault is."""

from __future__ import annotations

from dataclasses import dataclass

_ENGINES = {
    "pybullet": ("pybullet", "bullet_"),
    "pinocchio": ("pinocchio",),
    "mujoco": ("mujoco",),
    "pydrake": ("drake",),
}
"""Top-level module of an engine -> what marks a module or a test as needing it."""


@dataclass(frozen=True)
class Fault:
    """One deliberate mistake: in `module`, `right` becomes `wrong`; `caught_by` must then fail.

    `right` must occur exactly once in the module's source, so that the catalogue follows the code.
    """

    name: str
    module: str
    right: str
    wrong: str
    caught_by: str

    @property
    def engine(self) -> str | None:
        """The engine without which the fault, or the test that catches it, is not there."""
        for engine, marks in _ENGINES.items():
            if any(mark in self.module or mark in self.caught_by for mark in marks):
                return engine
        return None

    def planted(self, source: str) -> str:
        """The source with the fault in it."""
        count = source.count(self.right)
        if count != 1:
            raise ValueError(f"fault {self.name}: its text occurs {count} times in {self.module}, not once")
        return source.replace(self.right, self.wrong)

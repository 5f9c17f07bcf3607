"""What a planted fault is."""

from __future__ import annotations

from dataclasses import dataclass


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

    def planted(self, source: str) -> str:
        """The source with the fault in it."""
        count = source.count(self.right)
        if count != 1:
            raise ValueError(f"fault {self.name}: its text occurs {count} times in {self.module}, not once")
        return source.replace(self.right, self.wrong)

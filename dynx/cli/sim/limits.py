"""Limits that a motion breaks, told apart on one line, with what can be done about them."""

from __future__ import annotations

from dynx.cli.shell.terminal import counted
from dynx.errors import LimitError, LimitViolation, shown

IGNORE = "--ignore-limits follows it all the same"
SLOWER = "a longer --duration is slower"


def limits_said(error: LimitError, robot: str, *, ignorable: bool) -> str:
    """The message of `error` for the command line; `ignorable` where the command has --ignore-limits."""
    if not error.violations:  # of a limit, but not of the motion
        return str(error)
    listed = "; ".join(map(_violation, error.violations))
    too_fast = any(each.quantity == "velocity" for each in error.violations)
    hints = [SLOWER] * too_fast + [IGNORE] * ignorable
    hint = f" ({'; '.join(hints)})" if hints else ""
    return f"the motion breaks {counted(len(error.violations), 'limit')} of {robot}: {listed}{hint}"


def _violation(broken: LimitViolation) -> str:
    return (
        f"{broken.quantity} of {shown(broken.joint)} is {broken.value:.6g} at {broken.time:.6g} s, "
        f"beyond {broken.limit:.6g}"
    )

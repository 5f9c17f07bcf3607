"""Checks of a robot: each quantity and each identity of `dynx.agree`.

The agreement of a robot on a base is measured once per run of pytest. Each test reads its part of the report,
and shows how to reproduce a difference.
"""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from dynx.agreement import AgreementReport, Comparison, IdentityCheck, WorstSample, agree, refused_report
from dynx.agreement.compared_quantities import compared_quantities
from dynx.agreement.identities import IDENTITIES
from dynx.errors import DynxError
from dynx.model.loading import load
from dynx.model.tree import Base

CHECKS: tuple[str, ...] = (
    *(quantity.name for quantity in compared_quantities()),
    "forward_dynamics",
    "inverse_kinematics",
    *(identity.name for identity in IDENTITIES),
    "inverse dynamics of forward dynamics",
)
"""Names of the tests of a robot on a base: the quantities and identities of an agreement report."""

Key = tuple[str, Base, "tuple[str, ...] | None"]
_MEASURED = pytest.StashKey[dict[Key, AgreementReport]]()


class Disagreement(AssertionError):
    """Engines differ on a robot; shown by its message alone, without a traceback."""


def measured_agreement(
    config: pytest.Config, robot: str, base: Base, backends: Sequence[str] | None
) -> AgreementReport:
    """Return the agreement of a robot, which is measured by the first call in the run of `config`."""
    known = config.stash.setdefault(_MEASURED, {})
    key = (robot, base, None if backends is None else tuple(backends))
    if key not in known:
        try:
            known[key] = agree(load(robot, base=base), backends)
        except DynxError as error:
            known[key] = refused_report(robot, error, base=base)
    return known[key]


def require_agreement(report: AgreementReport, check: str, label: str) -> None:
    """Raise Disagreement where a check fails; skip the test where the report does not have it."""
    head = f"{check} of {label}, {report.base} base"
    if report.error is not None:
        raise Disagreement(f"{head}: not measured\n  {report.error.type}: {report.error.message}")
    rows: list[Comparison | IdentityCheck] = [row for row in report.quantities if row.quantity == check]
    rows += [row for row in report.identities if row.identity == check]
    if not rows:
        pytest.skip(f"{head}: nothing to compare ({', '.join(report.backends)}; nv {report.nv})")
    wrong = [row for row in rows if not row.agree]
    if not wrong:
        return
    suspects = [suspect for suspect in report.suspects if suspect.quantity == check]
    lines = [head, *(line for row in wrong for line in _row(row))]
    lines += [f"  suspect: {each.backend} ({'; '.join(each.evidence)})" for each in suspects]
    chosen = ",".join(report.backends)
    lines.append(f"  to see it again: dynx agree {label} --base {report.base} --backends {chosen}")
    raise Disagreement("\n".join(lines))


def _row(row: Comparison | IdentityCheck) -> list[str]:
    if isinstance(row, Comparison):
        who, error = row.pair, row.max_rel_error
    else:
        who, error = row.backend, row.max_error
    note = "" if row.note is None else f" ({row.note})"
    lines = [f"  {who}: relative error {error:.2e}, tolerance {row.tolerance:.2e}{note}"]
    return lines if row.worst_sample is None else lines + _sample(row.worst_sample)


def _sample(worst: WorstSample) -> list[str]:
    frame = "" if worst.frame is None else f", frame {worst.frame}"
    reference = "" if worst.reference is None else f" ({worst.reference})"
    lines = [f"    worst sample: number {worst.index} ({worst.kind}){frame}{reference}"]
    return lines + [f"      {name} = {list(getattr(worst, name))}" for name in ("q", "v", "a", "tau")]

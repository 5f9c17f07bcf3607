"""The outcome of a comparison, and its JSON form (schema 1).

    {"schema": 1, "dynx": version, "results": [...], "summary": {...}, "not_done": [...],
     "left_out": [...]}

``summary`` counts the ``robots`` that have an entry, and those among them that ``agree``, ``differ`` and are
``refused``; ``not_done`` counts the robots without an entry; it is 0 unless ``dynx agree`` was interrupted.
``left_out`` are robots in xacro below a directory, which are not compared.

One entry of ``results`` per robot:

    robot, source, base      its name, where it was read from, "fixed" or "floating"
    backends                 names of the backends compared
    nq, nv, samples, seed    numbers (null for a robot that was refused)
    agree                    whether every quantity and every identity is within tolerance
    error                    null, or {"type", "message"}: why the robot could not be used
    seconds                  wall-clock time
    quantities               [{quantity, pair, max_abs_error, max_rel_error, tolerance, agree,
                             worst_sample, note}], pair being "a~b", "a~referee" or "a~derived"
    identities               [{identity, backend, max_error, tolerance, agree, worst_sample, note}]
    suspects                 [{backend, quantity, evidence}] where something differs
    notes                    sentences about the description and the comparison

An error without a finite value (a refusal, a NaN, a wrong shape) is null, and `note` describes it.
``dynx agree --json`` writes a summary (`summarized`), and all rows with ``--json-samples``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from dynx._version import __version__
from dynx.agreement.comparison import DERIVED, REFEREE, Comparison
from dynx.agreement.identities import IdentityCheck
from dynx.argument_types import checks_types
from dynx.errors import DynxError, UnknownNameError, nearest, shown
from dynx.files.documents import document_of
from dynx.files.pages import html_grid

# Backends that are probably wrong where results differ, and the evidence against them.


@dataclass(frozen=True)
class Suspect:
    """A backend that is probably wrong about something, and the evidence."""

    backend: str
    quantity: str
    evidence: tuple[str, ...]


def find_suspects(
    quantities: Sequence[Comparison], identities: Sequence[IdentityCheck], backends: Sequence[str]
) -> tuple[Suspect, ...]:
    """Find, for each quantity whose results differ, the backends with the strongest evidence against them.

    The strongest evidence is an error against the 50-digit referee. Next comes a backend that differs from
    all others while they agree, then one that differs from what is derived from its own poses and inverse
    dynamics, or breaks an identity of mechanics. Without any evidence all backends that differ are named.
    """
    suspects = []
    for quantity in dict.fromkeys(comparison.quantity for comparison in quantities):
        failed = [c for c in quantities if c.quantity == quantity and not c.agree]
        if not failed:
            continue
        rows = [c for c in quantities if c.quantity == quantity]
        evidence = {name: _evidence(name, rows, identities, backends) for name in backends}
        differing = [name for name in backends if any(name in c.names for c in failed)]
        max_weight = max(evidence[name][0] for name in differing)
        for name in differing:
            weight, reasons = evidence[name]
            if weight == max_weight:
                no_evidence = ("differs, and nothing shows which side is wrong",)
                suspects.append(Suspect(name, quantity, tuple(reasons) or no_evidence))
    named = {suspect.backend for suspect in suspects}
    for check in identities:
        if not check.agree and check.backend not in named:
            reason = f"breaks the identity: {check.identity} ({_figures(check.max_error, check.tolerance)})"
            suspects.append(Suspect(check.backend, check.identity, (reason,)))
    return tuple(suspects)


def _evidence(
    name: str,
    rows: Sequence[Comparison],
    identities: Sequence[IdentityCheck],
    backends: Sequence[str],
) -> tuple[int, list[str]]:
    """Return the weight of the evidence against a backend in one quantity, and its sentences.

    The weight is 3 if it differs from the referee, 2 if from all other backends, 1 if from what is derived
    from its own results, 0 without evidence.
    """
    weight, reasons = 0, []
    against = [c for c in rows if name in c.names and not c.agree]
    for row in against:
        other = row.names[1] if row.names[0] == name else row.names[0]
        if other == REFEREE:
            weight = 3
            figures = _figures(row.max_rel_error, row.tolerance)
            reasons.append(f"differs from the 50-digit result by {figures}")
        elif other == DERIVED:
            weight = max(weight, 1)
            reasons.append("differs from what follows from its own poses and inverse dynamics")
    others = [other for other in backends if other != name]
    among = [c for c in rows if set(c.names) <= set(others)]
    differs = {n for c in against for n in c.names} & set(others)
    if len(others) >= 2 and differs == set(others) and among and all(c.agree for c in among):
        weight = max(weight, 2)
        reasons.append("differs from " + " and ".join(others) + ", which agree")
    for check in identities:
        if check.backend == name and not check.agree:
            weight = max(weight, 1)
            figures = _figures(check.max_error, check.tolerance)
            reasons.append(f"breaks the identity: {check.identity} ({figures})")
    return weight, reasons


def _figures(error: float, tolerance: float) -> str:
    return f"{error:.2g}, allowed {tolerance:.1g}"


SCHEMA = 1


@dataclass(frozen=True)
class LoadFailure:
    """The error because of which a robot, or a backend of a robot, could not be used."""

    type: str
    message: str

    def __str__(self) -> str:
        return f"{self.type}: {self.message}"


@dataclass(frozen=True, repr=False)
class AgreementReport:
    """The agreement of backends on one robot; true in a condition if they agree.

    - `quantities`: comparisons of results
    - `identities`: checks of each backend alone
    - `suspects`: the backends that are probably wrong if results differ
    - `error`: why the robot was refused. Then nothing is compared
    """

    robot: str
    source: str | None = None
    base: str | None = None
    backends: tuple[str, ...] = ()
    nq: int | None = None
    nv: int | None = None
    samples: int | None = None
    seed: int | None = None
    quantities: tuple[Comparison, ...] = ()
    identities: tuple[IdentityCheck, ...] = ()
    suspects: tuple[Suspect, ...] = ()
    notes: tuple[str, ...] = ()
    error: LoadFailure | None = None
    seconds: float = field(default=0.0, compare=False)

    @property
    def agree(self) -> bool:
        """True if the robot was compared and everything is within tolerance."""
        rows: list[Comparison | IdentityCheck] = [*self.quantities, *self.identities]
        return self.error is None and all(row.agree for row in rows)

    def __bool__(self) -> bool:
        return self.agree

    @property
    def differences(self) -> tuple[Comparison, ...]:
        """The comparisons that are out of tolerance."""
        return tuple(comparison for comparison in self.quantities if not comparison.agree)

    @checks_types
    def worst(self, quantity: str) -> float:
        """Return the largest relative error of a quantity over all pairs.

        Raises UnknownNameError for a quantity that was not compared.
        """
        found = [row.max_rel_error for row in self.quantities if row.quantity == quantity]
        if not found:
            compared = dict.fromkeys(row.quantity for row in self.quantities)
            raise UnknownNameError(f"no quantity {shown(quantity)} was compared{nearest(quantity, compared)}")
        return max(found)

    def __str__(self) -> str:
        """Return the verdict in a line, then a line for each difference, failed identity and suspect."""
        head = f"{self.robot}, {self.base} base: " if self.base else f"{self.robot}: "
        if self.error is not None:
            return f"{head}refused ({self.error.type}: {self.error.message})"
        lines = [head + ", ".join(self.backends) + (" agree" if self.agree else " do not agree")]
        lines += [
            f"  {row.quantity}, {row.pair}: error {row.max_rel_error:.1e}, tolerance {row.tolerance:.1e}"
            + (f" ({row.note})" if row.note else "")
            for row in self.differences
        ]
        lines += [
            f"  {check.identity}, {check.backend}: "
            f"error {check.max_error:.1e}, tolerance {check.tolerance:.1e}"
            for check in self.identities
            if not check.agree
        ]
        lines += [f"  suspect: {suspect.backend} in {suspect.quantity}" for suspect in self.suspects]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<AgreementReport {str(self).splitlines()[0]}>"

    def _repr_html_(self) -> str:
        title, *lines = str(self).splitlines()
        return html_grid(title, (), ([line] for line in lines))

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of this robot in ``results``, which has only numbers, strings and lists."""
        return document_of(AgreementEntry, replace(self, seconds=round(self.seconds, 4)))


@dataclass(frozen=True)
class AgreementEntry:
    """One robot in the JSON document of ``dynx agree``; numbers are null for a robot that was refused."""

    robot: str
    source: str | None
    base: str | None
    backends: tuple[str, ...]
    nq: int | None
    nv: int | None
    samples: int | None
    seed: int | None
    agree: bool
    error: LoadFailure | None
    seconds: float
    quantities: tuple[Comparison, ...]
    identities: tuple[IdentityCheck, ...]
    suspects: tuple[Suspect, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class AgreementSummary:
    """Numbers of robots: with an entry, with each verdict, and without an entry (`not_done`)."""

    robots: int
    agree: int
    differ: int
    refused: int
    not_done: int


@dataclass(frozen=True)
class AgreementDocument:
    """The JSON document of ``dynx agree``."""

    schema: int
    dynx: str
    results: tuple[AgreementEntry, ...]
    summary: AgreementSummary
    not_done: tuple[str, ...]
    """The robots that an interrupted run left out."""
    left_out: tuple[str, ...]
    """The robots in xacro below a directory, which are not compared."""


@checks_types
def refused_report(
    robot: str,
    error: DynxError,
    *,
    source: str | None = None,
    base: str | None = None,
    backends: Iterable[str] = (),
    seconds: float = 0.0,
) -> AgreementReport:
    """Return the report of a robot that could not be used."""
    return AgreementReport(
        robot=robot,
        source=source,
        base=base,
        backends=tuple(backends),
        error=LoadFailure(type(error).__name__, str(error)),
        seconds=seconds,
    )


@checks_types
def results_document(
    reports: Iterable[AgreementReport], not_done: Sequence[str] = (), left_out: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the JSON document of many reports, as `dynx agree --json` writes it.

    `not_done` names the robots of an interrupted run that have no report. `left_out` names the xacro files
    below a directory, which are not examined.
    """
    results = [report.to_dict() for report in reports]
    refused = sum(result["error"] is not None for result in results)
    agreeing = sum(result["agree"] for result in results)
    return {
        "schema": SCHEMA,
        "dynx": __version__,
        "results": results,
        "summary": {
            "robots": len(results),
            "agree": agreeing,
            "differ": len(results) - agreeing - refused,
            "refused": refused,
            "not_done": len(not_done),
        },
        "not_done": list(not_done),
        "left_out": list(left_out),
    }


def summarized(document: dict[str, Any]) -> dict[str, Any]:
    """Return a `results_document` without the samples of rows that agree, and of these rows only the one with
    the largest error of each quantity and of each identity."""
    results = [
        {
            **entry,
            "quantities": _summary_rows(entry["quantities"], "quantity", "max_rel_error"),
            "identities": _summary_rows(entry["identities"], "identity", "max_error"),
        }
        for entry in document["results"]
    ]
    return {**document, "results": results}


def _summary_rows(rows: Sequence[dict[str, Any]], name: str, error: str) -> list[dict[str, Any]]:
    largest: dict[str, int] = {}
    for number, row in enumerate(rows):
        before = largest.get(row[name])
        if row["agree"] and (before is None or (row[error] or 0.0) > (rows[before][error] or 0.0)):
            largest[row[name]] = number
    return [
        {**row, "worst_sample": None} if row["agree"] else row
        for number, row in enumerate(rows)
        if not row["agree"] or largest[row[name]] == number
    ]

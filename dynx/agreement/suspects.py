"""Backends that are probably wrong where results differ, and the evidence against them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dynx.agreement.comparison import Comparison
from dynx.agreement.identities import IdentityCheck
from dynx.agreement.results import DERIVED, REFEREE


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

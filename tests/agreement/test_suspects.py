from __future__ import annotations

from dynx.agreement.comparison import Comparison
from dynx.agreement.identities import IdentityCheck
from dynx.agreement.report import find_suspects


def row(pair: str, agree: bool) -> Comparison:
    return Comparison("mass_matrix", pair, 0.0, 0.0 if agree else 1.0, 1e-13, agree)


def names(quantities: list[Comparison], identities: list[IdentityCheck], backends: list[str]) -> list[str]:
    return [suspect.backend for suspect in find_suspects(quantities, identities, backends)]


def test_nobody_is_suspected_where_all_agree() -> None:
    assert not names([row("a~b", True), row("a~referee", True)], [], ["a", "b"])


def test_the_referee_outweighs_a_majority() -> None:
    rows = [row("a~b", False), row("a~c", False), row("b~c", True)]
    rows += [row("a~referee", True), row("b~referee", False), row("c~referee", False)]
    assert names(rows, [], ["a", "b", "c"]) == ["b", "c"]


def test_without_referee_the_one_that_differs_from_all_others_is_named() -> None:
    rows = [row("a~b", False), row("a~c", True), row("b~c", False)]
    assert names(rows, [], ["a", "b", "c"]) == ["b"]


def test_without_referee_and_majority_an_identity_or_the_derivation_decides() -> None:
    rows = [row("a~b", False)]
    broken = IdentityCheck("mass matrix is symmetric", "b", 1.0, 1e-13, False)
    assert names(rows, [broken], ["a", "b"]) == ["b"]
    assert names([*rows, row("a~derived", False)], [], ["a", "b"]) == ["a"]


def test_without_evidence_both_backends_are_named() -> None:
    found = find_suspects([row("a~b", False)], [], ["a", "b"])
    assert [suspect.backend for suspect in found] == ["a", "b"]
    assert all("nothing shows" in suspect.evidence[0] for suspect in found)


def test_a_failed_identity_names_its_backend_where_nothing_differs() -> None:
    broken = IdentityCheck("mass matrix is symmetric", "b", 1.0, 1e-13, False)
    assert names([row("a~b", True)], [broken], ["a", "b"]) == ["b"]

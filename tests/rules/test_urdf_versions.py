"""What a ``<limit>`` needs depends on the version of URDF that the robot states."""

from __future__ import annotations

import pytest

from dynx.doctor.diagnosis import diagnose
from dynx.loaded import installed_engines
from tests.rules.documents import LIMIT, case_of, joint, link


@pytest.mark.skipif("pinocchio" not in installed_engines(), reason="only Pinocchio reads the version")
@pytest.mark.parametrize(
    ("version", "missing", "rules"),
    [
        ("1.1", "effort", {"DX204"}),
        ("1.1", "lower", set()),
        ("1.2", "effort", set()),
        ("1.2", "lower", {"DX222"}),
        ("2.0", "effort", {"DX204", "DX416"}),
        ("2.0", "lower", {"DX416"}),
    ],
)
def test_each_version_has_its_own_rule(version: str, missing: str, rules: set[str]) -> None:
    """URDF 1.2 requires both ends and no effort; a version that does not exist counts as its remedy."""
    limit = LIMIT.replace(f'{missing}="', 'other="')
    text = case_of(link("a"), link("b"), joint("j", "a", "b", limit=limit)).source.text
    text = text.replace("<robot ", f'<robot version="{version}" ')
    report = diagnose(text, engines=["pinocchio"], counterexamples=False)
    assert {each.rule for each in report.findings if each.kind == "difference"} == rules
    assert all(each.proved for each in report.differences)
    assert report.explained

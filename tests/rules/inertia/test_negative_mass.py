"""A negative mass is reported at its line, and mended as the user chooses."""

from __future__ import annotations

import pytest

import dynx
from dynx.doctor import diagnose
from dynx.errors import DescriptionError
from dynx.rules.registry import find_trap


@pytest.mark.parametrize(("choice", "mass"), [(None, 1.5), ("absolute", 1.5), ("zero", 0.0)])
def test_the_sign_is_removed_or_the_mass_zero(choice: str | None, mass: float) -> None:
    with pytest.raises(DescriptionError, match="wanted at least 0"):
        dynx.load(find_trap("DX120"))
    choose = None if choice is None else {"DX120": choice}
    report = diagnose(find_trap("DX120"), engines=["pinocchio"], samples=1, choose=choose)
    [finding] = [each for each in report.findings if each.rule == "DX120"]
    assert (finding.link, finding.line, finding.proved) == ("lower", 20, True)
    assert report.explained
    assert report.mended is not None
    assert dynx.load(report.mended).inertial("lower").mass == mass
    assert any("DX120=" in each and "otherwise --choose" in each for each in report.choices)

"""The table of `benchmarks.dry_friction`, on a few steps."""

from __future__ import annotations

import pytest

from benchmarks import dry_friction


def test_a_table_has_a_row_for_each_plant(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dry_friction, "STEPS", 5)
    monkeypatch.setattr(dry_friction, "BATCH", 16)
    monkeypatch.setattr(dry_friction, "MAX_RATIO", 1e9)
    assert dry_friction.main(["six_axis_arm", "--rounds", "1", "--batch"]) == 0
    printed = capsys.readouterr().out
    assert all(f"six_axis_arm on {plant}" in printed for plant in dry_friction.PLANTS)
    assert "six_axis_arm, batch" in printed
    monkeypatch.setattr(dry_friction, "MAX_RATIO", 0.0)
    assert dry_friction.main(["six_axis_arm", "--rounds", "1", "--plant", "compiled"]) == 1

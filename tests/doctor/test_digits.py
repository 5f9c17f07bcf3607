"""A mended file changes nothing for effects below its own tolerance, and has no more digits than it needs."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from dynx import diagnose
from dynx.cli.shell.main import cli
from dynx.errors import ArgumentError
from dynx.loaded import installed_engines
from dynx.model.xml.source import XmlSource
from tests.rules.documents import case_of, joint, link

needs_pybullet = pytest.mark.skipif("pybullet" not in installed_engines(), reason="PyBullet differs")


def robot(product: str, axis: str = "0 0 1") -> str:
    """Write a robot of two joints whose first link has a product of inertia."""
    arm = link("arm", mass="2", moments=(0.11, 0.23, 0.31), center=(0.1, 0.2, 0.3)).replace(
        'ixy="0"', f'ixy="{product}" ixz="0.007"', 1
    )
    arm = arm.replace(' ixz="0"', "", 1)
    return case_of(
        link("base", mass="1", moments=(0.1, 0.1, 0.1)),
        arm,
        link("hand", mass="1", moments=(0.1, 0.2, 0.15), center=(0.3, 0.1, 0.2)),
        joint("j", "base", "arm").replace("0 0 1", axis),
        joint("k", "arm", "hand").replace("0 0 1", "0 1 0"),
    ).source.text


def digits(word: str) -> int:
    """Count the significant digits of a number."""
    return len(re.sub(r"[eE].*|[-+.]", "", word).lstrip("0"))


def new_numbers(text: str, mended: str) -> set[str]:
    """Return the numbers that only the mended text has."""
    found = [set(re.findall(r"[-+]?[0-9.]+(?:e[-+]?[0-9]+)?", each)) for each in (text, mended)]
    return found[1] - found[0]


@needs_pybullet
@pytest.mark.parametrize("axis", ["0 0 1", "1 2 3", "0.3 0.4 0.5"])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_new_numbers_have_no_more_digits_than_the_tolerance_needs(tolerance: float, axis: str) -> None:
    text = robot("0.02", axis)
    full = diagnose(text, base="floating", counterexamples=False)
    short = diagnose(text, base="floating", counterexamples=False, fix_tolerance=tolerance)
    assert short.explained
    assert short.residual == full.residual
    assert [each.rule for each in short.findings] == [each.rule for each in full.findings]
    if short.mended is None:
        assert short.remaining <= tolerance
        return
    assert short.remaining <= 0.1 * tolerance
    largest = {1e-6: 9, 1e-9: 13}[tolerance]
    assert all(digits(word) <= largest for word in new_numbers(text, short.mended))
    within = f"wrote new numbers with the fewest digits that keep every engine within {0.1 * tolerance:g}"
    assert any(each.endswith(within) for each in short.choices)
    again = diagnose(short.mended, base="floating", counterexamples=False, tolerance=tolerance)
    assert again.alike


@needs_pybullet
def test_a_cause_below_the_tolerance_of_the_mended_file_is_left_and_named() -> None:
    text = robot("0.02")
    effects = {
        each.rule: each.effect.relative_error
        for each in diagnose(text, counterexamples=False).findings
        if each.effect is not None
    }
    largest = max(effects.values())
    report = diagnose(text, counterexamples=False, fix_tolerance=min(0.5, 20.0 * largest))
    assert report.mended is None
    assert report.explained
    assert report.withheld is None
    assert any(each.startswith("left DX105 where") for each in report.choices)
    assert not any(each.rule == "DX105" for each in report.changes)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, 1.0, float("nan")])
def test_a_tolerance_of_the_mended_file_is_between_0_and_1(tolerance: float) -> None:
    with pytest.raises(ArgumentError, match="fix_tolerance"):
        diagnose(robot("0"), fix_tolerance=tolerance)


@needs_pybullet
def test_the_command_mends_to_its_own_tolerance(tmp_path: Path) -> None:
    path, out = tmp_path / "in.urdf", tmp_path / "out.urdf"
    path.write_text(robot("0.02"), encoding="utf-8")
    lengths = []
    for options in ([], ["--tolerance", "1e-12"]):
        command = ["doctor", str(path), "--base", "floating", "--jobs", "1", "--fix", str(out), *options]
        CliRunner().invoke(cli, command)
        assert XmlSource(out.read_bytes()).root.tag == "robot"
        new = new_numbers(path.read_text(encoding="utf-8"), out.read_text(encoding="utf-8"))
        lengths.append(max(map(digits, new), default=0))
    assert lengths[0] < lengths[1]

"""Diagnosis with an engine whose faults are known, so that the correct report is known too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dynx.doctor import DoctorReport, diagnose
from dynx.doctor.examination import LOADING, TORQUE
from dynx.loaded import LoadedRobot
from dynx.model import Inertial
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from tests.doctor.faulty_engine import HEAVY, NAME, SECRET, FaultyEngine
from tests.rules.documents import case_of, joint, link

FRAMES = case_of(
    *(link("base"), link("arm", center=(0.1, 0.2, 0.3)), '<link name="flange"/>', '<link name="camera"/>'),
    joint("j", "base", "arm"),
    joint("k", "arm", "flange", '<origin xyz="2 0 0"/>', type="fixed"),
    joint("l", "arm", "camera", '<origin xyz="0 1 0"/>', type="fixed"),
)


def diagnose_with(monkeypatch: pytest.MonkeyPatch, engine: type[LoadedRobot], text: str) -> DoctorReport:
    """Diagnose a file with that engine alone."""
    for module in ("examination", "diagnosis"):
        monkeypatch.setattr(f"dynx.doctor.{module}.loader_class", lambda name: engine)
    return diagnose(text, engines=[NAME], counterexamples=False)


class OnlyFlanges(FaultyEngine):
    """Reads a flange as a body, and no other frame."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        model = self.right.model
        links = (
            replace(each, inertial=Inertial()) if each.name != "flange" and each.inertial == HEAVY else each
            for each in model.links
        )
        self.right = ReferenceBackend(replace(model, links=tuple(links)))


class ElbowOff(FaultyEngine):
    """Torques of the second joint are off by 1e-9 of their size."""

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        return super().inverse_dynamics(q, v, a) * [1.0, 1.0 + 1e-9]


def test_only_the_place_that_matters_is_mended(monkeypatch: pytest.MonkeyPatch) -> None:
    report = diagnose_with(monkeypatch, OnlyFlanges, FRAMES.source.text)
    assert report.explained
    assert [each.link for each in report.differences] == ["flange"]
    assert [each.link for each in report.findings if each.rule == "DX101"] == ["flange", "camera"]
    assert report.mended is not None
    assert '<link name="camera"/>' in report.mended
    assert '<link name="flange"/>' not in report.mended


def test_every_place_that_matters_is_mended_and_the_file_is_then_alike(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    report = diagnose_with(monkeypatch, FaultyEngine, FRAMES.source.text)
    assert [(each.link, each.proved) for each in report.differences] == [("flange", True), ("camera", True)]
    (engine,) = report.engines
    assert max(engine.before.values()) > report.tolerance >= max(engine.after.values()) == report.residual
    assert diagnose_with(monkeypatch, FaultyEngine, report.mended or "").alike


def test_a_small_difference_that_no_rule_explains_is_said_with_its_joint(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    links = (link(name, center=(0.1, 0.2, 0.3)) for name in ("base", "upper", "lower"))
    case = case_of(*links, joint("j", "base", "upper"), joint("k", "upper", "lower"))
    report = diagnose_with(monkeypatch, ElbowOff, case.source.text)
    (left,) = report.unexplained
    assert (left.quantity, left.joint) == (TORQUE, "k")
    assert 1e-10 < left.relative_error <= 1e-9
    assert not report.explained
    assert not report.alike


def test_a_file_that_is_refused_to_the_end_is_not_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    report = diagnose_with(monkeypatch, FaultyEngine, case_of(link("base"), f"<!-- {SECRET} -->").source.text)
    (left,) = report.unexplained
    assert left.quantity == LOADING
    assert report.engines[0].refused_after == report.engines[0].refused == f"robot.urdf is a {SECRET}"
    assert not report.explained


def test_meshes_that_are_nowhere_are_no_cause(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    mesh = f'<visual><geometry><mesh filename="{tmp_path.name}/none.stl"/></geometry></visual>'
    report = diagnose_with(monkeypatch, FaultyEngine, case_of(link("base", mesh)).source.text)
    assert report.alike
    assert report.mended is None

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings

from dynx.agreement import AgreementReport, agree
from dynx.agreement.tolerances import BAR
from dynx.backends import installed_backends
from dynx.errors import ArgumentError, ClosedError, UnknownBackendError
from dynx.model import Model
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.testing.strategies import models
from tests.agreement.robots import DEFECTS, Broken, arm, massless_chain, massless_finger, pendulum, rock

BASES: list[Base] = ["fixed", "floating"]


def differing(report: AgreementReport) -> set[str]:
    return {row.quantity for row in report.differences}


@pytest.mark.parametrize("base", BASES)
def test_every_installed_backend_agrees_about_an_arm_with_a_mimic_joint(base: Base) -> None:
    report = agree(arm(base))
    assert report.agree
    assert report
    assert report.backends == installed_backends()
    assert not report.suspects
    assert not report.differences
    assert report.worst("inverse_dynamics") <= BAR


def test_backends_are_paired_with_each_other_the_referee_and_their_derivation() -> None:
    report = agree(arm(), ["reference", "pinocchio"])
    pairs = {row.pair for row in report.quantities}
    assert pairs == {
        "reference~pinocchio",
        "reference~referee",
        "pinocchio~referee",
        "reference~derived",
        "pinocchio~derived",
    }
    assert {check.backend for check in report.identities} == {"reference", "pinocchio"}


def test_no_tolerance_exceeds_the_promised_error() -> None:
    for row in agree(arm("floating"), ["reference"]).quantities:
        promised = {"inverse_dynamics_component": 1e-10, "inverse_kinematics": 1.1e-6}
        assert row.tolerance <= promised.get(row.quantity, 1e-12), row


@pytest.mark.parametrize(("defect", "quantity"), DEFECTS, ids=[d.__name__ for d, _ in DEFECTS])
@pytest.mark.parametrize("base", BASES)
def test_a_defect_is_seen_and_its_backend_is_named(defect: type[Broken], quantity: str, base: Base) -> None:
    model = arm(base)
    report = agree(model, [ReferenceBackend(model), defect(model)], samples=8)
    assert not report.agree
    assert quantity in differing(report)
    named = {suspect.backend for suspect in report.suspects if suspect.quantity == quantity}
    assert named == {"broken"}


@pytest.mark.parametrize(("defect", "quantity"), DEFECTS, ids=[d.__name__ for d, _ in DEFECTS])
def test_a_defect_shows_without_another_backend(defect: type[Broken], quantity: str) -> None:
    report = agree(arm(), [defect(arm())], samples=8)
    assert not report.agree
    assert {suspect.backend for suspect in report.suspects} == {"broken"}


def test_equal_seeds_give_equal_reports() -> None:
    first, again = (agree(arm(), ["reference"], samples=4, seed=7) for _ in range(2))
    other = agree(arm(), ["reference"], samples=4, seed=8)
    assert first == again
    assert first.quantities != other.quantities


def test_a_singular_mass_matrix_is_refused_alike_and_noted() -> None:
    report = agree(massless_finger())
    assert report.agree
    rows = [row for row in report.quantities if row.quantity == "forward_dynamics"]
    assert rows
    assert all("refused alike" in (row.note or "") for row in rows)
    assert any("point" in note and "singular" in note for note in report.notes)


@pytest.mark.parametrize(("n_joints", "listed"), [(6, "'joint5' moves"), (7, "'joint5' and 1 more moves")])
def test_at_most_six_joints_without_inertia_are_listed(n_joints: int, listed: str) -> None:
    notes = agree(massless_chain(n_joints), ["reference"], samples=1).notes
    assert any(f"'joint4', {listed}" in note for note in notes)


@pytest.mark.parametrize("base", BASES)
def test_a_robot_without_joints(base: Base) -> None:
    report = agree(rock(base))
    assert report.agree
    assert report.nv == (6 if base == "floating" else 0)


def test_a_point_mass_pendulum_whose_inertia_vanishes_about_its_own_axis() -> None:
    assert agree(pendulum(2.0, 0.5)).agree


def test_a_single_sample_without_referee() -> None:
    report = agree(arm(), ["reference"], samples=1, referee_samples=0)
    assert report.agree
    assert not any("referee" in row.pair for row in report.quantities)


def test_text_of_a_urdf_is_taken() -> None:
    assert agree(arm().to_urdf(), ["reference"], samples=2).robot == "arm"


@pytest.mark.parametrize(
    ("description", "kind"),
    [
        ("no_such_robot_at_all", "RobotNotFoundError"),
        ("<robot name='x'><link name='a'/><link name='b'/></robot>", "DescriptionError"),
        ("<robot", "DescriptionError"),
    ],
)
def test_an_unreadable_description_gives_a_report_with_the_error(description: str, kind: str) -> None:
    report = agree(description, ["reference"])
    assert not report.agree
    assert report.error is not None
    assert report.error.type == kind
    assert report.error.message
    assert not report.quantities


def test_a_missing_file_gives_a_report_with_the_error(tmp_path: Path) -> None:
    assert agree(tmp_path / "none.urdf", ["reference"]).error is not None


def test_a_backend_that_refuses_the_robot_gives_a_report_with_the_error() -> None:
    closed = ReferenceBackend(arm())
    closed.close()
    report = agree(arm(), [closed], samples=2)
    assert not report.agree
    assert report.suspects or report.error
    with pytest.raises(ClosedError):
        closed.mass_matrix(arm().neutral())


def test_a_backend_given_ready_is_left_open() -> None:
    with ReferenceBackend(arm()) as engine:
        agree(arm(), [engine], samples=2)
        assert engine.mass_matrix(arm().neutral()).shape == (3, 3)


def test_invalid_arguments_are_refused() -> None:
    counts: tuple[Any, ...] = (0, -1, True, 2.5)
    for samples in counts:
        with pytest.raises(ArgumentError, match="samples"):
            agree(arm(), ["reference"], samples=samples)
    with pytest.raises(ArgumentError, match="seed"):
        agree(arm(), ["reference"], seed=-1)
    with pytest.raises(ArgumentError, match="at least one"):
        agree(arm(), [])
    number: Any = 3
    with pytest.raises(ArgumentError, match="wanted a name or a Backend"):
        agree(arm(), [number])
    with pytest.raises(ArgumentError, match="another model"):
        agree(arm(), [ReferenceBackend(rock())])
    with pytest.raises(UnknownBackendError, match="pinocchio"):
        agree(arm(), ["pinochio"])


def test_progress_is_called_with_every_step() -> None:
    steps: list[str] = []
    agree(arm(), ["reference", "pinocchio"], samples=2, progress=steps.append)
    assert steps[0] == "reference~pinocchio"
    assert "referee" in steps
    assert "identities of pinocchio" in steps


def test_two_backends_of_one_name_are_numbered() -> None:
    model = arm()
    report = agree(model, [ReferenceBackend(model), ReferenceBackend(model)], samples=2)
    assert report.backends == ("reference", "reference#2")


def test_the_json_holds_no_number_that_json_lacks() -> None:
    report = agree(arm(), [ReferenceBackend(arm()), DEFECTS[-1][0](arm())], samples=2)
    text = json.dumps(report.to_dict(), allow_nan=False)
    assert json.loads(text)["agree"] is False


# Every engine meets such robots in `tests.properties`; what counts here is the referee, which is slow.
@settings(max_examples=40)
@given(models(physical=False))
def test_reference_and_pinocchio_agree_about_random_robots(model: Model) -> None:
    report = agree(model, ["reference", "pinocchio"], samples=3, referee_samples=1)
    assert report.error is None
    assert report.agree, (report.differences, report.suspects)


@pytest.mark.parametrize(("n", "listed"), [(6, "'joint5' moves"), (8, "'joint5' and 2 more moves")])
def test_a_long_list_of_joints_that_move_nothing_is_cut(n: int, listed: str) -> None:
    report = agree(massless_chain(n), backends=["reference"], samples=1)
    assert any(listed in note for note in report.notes)

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

from dynx.agreement import AgreementReport, agree
from dynx.agreement.agreement import AgreementTask, measure
from dynx.agreement.comparison import Comparison
from dynx.agreement.identities import IdentityCheck
from dynx.agreement.report import find_suspects
from dynx.agreement.tolerances import BAR
from dynx.backends import installed_backends
from dynx.errors import ArgumentError, ClosedError, UnknownBackendError
from dynx.model import Model
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
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


@pytest.mark.long_cases
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


@pytest.mark.parametrize(
    ("n_joints", "listed"),
    [(6, "'joint5' moves"), (7, "'joint5' and 1 more moves"), (8, "'joint5' and 2 more moves")],
)
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
    with pytest.raises(
        ArgumentError, match=r"backends is '\[3\]', of type list; wanted Sequence\[str \| Backend\]"
    ):
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


def test_a_task_is_the_comparison_with_its_options() -> None:
    report = measure(AgreementTask("ur5", "floating", (("elbow_joint", 0.5),), ("reference",), 2, 7))
    wanted = agree(load("ur5", base="floating", lock={"elbow_joint": 0.5}), ["reference"], samples=2, seed=7)
    assert report.quantities == wanted.quantities
    assert (report.robot, report.base, report.samples, report.seed) == ("ur5", "floating", 2, 7)


def test_a_robot_that_cannot_be_used_is_a_report_of_its_error() -> None:
    report = measure(AgreementTask("nowhere", "fixed", (), None, 2, 0))
    assert report.error is not None
    assert not report.agree


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


MODEL = load("double_pendulum")


class Single(ReferenceBackend):
    """A backend that evaluates one sample at a time, like most engines."""

    vectorized = False


class WrongShape(Single):
    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        return super()._inverse_dynamics(q, v, a)[..., :-1]


class Raises(Single):
    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        raise RuntimeError("the engine is on fire")


class ReturnsAList(Single):
    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Any:
        return super()._inverse_dynamics(q, v, a).tolist()


class NotANumber(Single):
    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        return np.full_like(v, np.nan)


class TooFewFrames(Single):
    def _frame_placements(self, q: Floats) -> Floats:
        return super()._frame_placements(q)[..., :1, :, :]


@pytest.mark.parametrize("kind", [WrongShape, Raises, NotANumber, TooFewFrames])
def test_a_broken_backend_differs_and_has_a_note(kind: type[Single]) -> None:
    broken = kind(MODEL)
    report = agree(MODEL, ["reference", broken], samples=2, referee_samples=1)
    assert report.error is None
    assert not report.agree
    assert all(row.note for row in report.differences if not np.isfinite(row.max_rel_error))
    assert {suspect.backend for suspect in report.suspects} == set(report.backends[1:])


def test_a_list_of_the_right_numbers_is_accepted() -> None:
    report = agree(MODEL, ["reference", ReturnsAList(MODEL)], samples=2, referee_samples=1)
    assert report.error is None


def test_a_report_prints_its_verdict_and_what_differs() -> None:
    good = agree(MODEL, ["reference"], samples=2, referee_samples=1)
    assert str(good).splitlines()[0].endswith("reference agree")
    bad = str(agree(MODEL, ["reference", NotANumber(MODEL)], samples=2, referee_samples=1))
    assert "do not agree" in bad
    assert "inverse_dynamics" in bad
    assert "suspect" in bad
    assert len(repr(good)) < 200


def test_a_quantity_that_was_not_compared_has_no_worst_error() -> None:
    report = agree(MODEL, ["reference"], samples=2, referee_samples=1)
    assert report.worst("mass_matrix") < 1.0
    with pytest.raises(LookupError, match="mass_matrix"):
        report.worst("mass matrix")

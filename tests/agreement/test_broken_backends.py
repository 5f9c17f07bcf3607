"""Backends of other packages that break their contract give differences in the report, not exceptions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.agreement import agree
from dynx.model.loading import load
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

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

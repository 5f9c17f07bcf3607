from __future__ import annotations

import json
from dataclasses import replace

import numpy as np

from dynx._version import __version__
from dynx.agreement import AgreementReport, Comparison, agree, refused_report, results_document
from dynx.agreement.report import summarized
from dynx.errors import DescriptionError
from dynx.reference.backend import ReferenceBackend
from tests.agreement.robots import GravityUpsideDown, arm

RESULT_KEYS = {
    "robot",
    "source",
    "base",
    "backends",
    "nq",
    "nv",
    "samples",
    "seed",
    "agree",
    "error",
    "seconds",
    "quantities",
    "identities",
    "suspects",
    "notes",
}
QUANTITY_KEYS = {
    "quantity",
    "pair",
    "max_abs_error",
    "max_rel_error",
    "tolerance",
    "agree",
    "worst_sample",
    "note",
}
IDENTITY_KEYS = {"identity", "backend", "max_error", "tolerance", "agree", "worst_sample", "note"}


def test_the_document_has_the_form_that_is_documented() -> None:
    fine = agree(arm(), ["reference"], samples=2)
    wrong = agree(arm(), [ReferenceBackend(arm()), GravityUpsideDown(arm())], samples=2)
    refused = refused_report("shell", DescriptionError("the robot has no link", source="a.urdf", line=3))
    document = json.loads(json.dumps(results_document([fine, wrong, refused]), allow_nan=False))
    assert set(document) == {"schema", "dynx", "results", "summary", "not_done", "left_out"}
    assert document["schema"] == 1
    assert document["dynx"] == __version__
    assert document["summary"] == {"robots": 3, "agree": 1, "differ": 1, "refused": 1, "not_done": 0}
    for result in document["results"]:
        assert set(result) == RESULT_KEYS
        assert all(set(entry) == QUANTITY_KEYS for entry in result["quantities"])
        assert all(set(entry) == IDENTITY_KEYS for entry in result["identities"])
    assert document["results"][1]["suspects"][0]["backend"] == "broken"
    assert document["results"][2]["error"] == {
        "type": "DescriptionError",
        "message": "a.urdf:3: the robot has no link",
    }


def test_the_worst_sample_reproduces_the_error() -> None:
    model = arm("floating")
    backends = ReferenceBackend(model), GravityUpsideDown(model)
    report = agree(model, backends, samples=4)
    row = next(row for row in report.differences if row.quantity == "gravity_torque")
    assert row.worst_sample is not None
    q = np.array(row.worst_sample.q)
    again = np.max(np.abs(backends[0].gravity_torque(q) - backends[1].gravity_torque(q)))
    assert again <= row.max_abs_error
    assert again > 0.0


def test_the_worst_sample_of_a_frame_names_frame_and_reference() -> None:
    report = agree(arm(), ["reference", "pinocchio"], samples=3)
    row = next(row for row in report.quantities if row.quantity == "jacobian")
    assert row.worst_sample is not None
    assert row.worst_sample.frame in arm().frame_names
    assert row.worst_sample.reference in ("local", "world", "local_world_aligned")


def test_an_infinite_error_is_null() -> None:
    row = Comparison("mass_matrix", "a~b", np.inf, np.nan, 1e-13, False, note="refused")
    entry = AgreementReport("x", quantities=(row,)).to_dict()["quantities"][0]
    assert entry["max_abs_error"] is None
    assert entry["max_rel_error"] is None
    assert entry["tolerance"] == 1e-13


def test_a_refused_robot_does_not_agree() -> None:
    assert not refused_report("x", DescriptionError("bad"))


def test_reports_are_equal_however_long_they_took() -> None:
    report = agree(arm(), ["reference"], samples=1)
    assert replace(report, seconds=report.seconds + 1.0) == report
    assert replace(report, seed=report.samples) != report


def test_a_summary_has_the_largest_error_of_each_quantity_and_all_that_differs() -> None:
    report = agree(arm(), ["reference", "compiled"], samples=2, referee_samples=1)
    whole = results_document([report])
    short = summarized(whole)
    (entry,), (full,) = short["results"], whole["results"]
    assert len(json.dumps(short)) < len(json.dumps(whole)) / 5
    assert {row["quantity"] for row in entry["quantities"]} == {row["quantity"] for row in full["quantities"]}
    for row in entry["quantities"]:
        same = [each["max_rel_error"] for each in full["quantities"] if each["quantity"] == row["quantity"]]
        assert row["max_rel_error"] == max(same)
        assert row["worst_sample"] is None
    full["quantities"][3]["agree"] = False
    assert full["quantities"][3] in summarized(whole)["results"][0]["quantities"]

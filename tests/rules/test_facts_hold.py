"""Facts about engines in the catalogue, measured on the installed engines.

A rule names the versions of an engine in which its cause shows. Here the engine loads the rule's trap: it
must be wrong before the remedy and right after it, and where the installed version is not among those
named, right before it. So a release of an engine that behaves otherwise fails here by name.
"""

from __future__ import annotations

from functools import cache
from math import isfinite
from typing import Any

import pytest
from packaging.specifiers import SpecifierSet

from dynx.agreement.tolerances import BAR
from dynx.doctor.examination import Examination, Examiner, ReferenceValues
from dynx.doctor.mending import mend
from dynx.errors import ModelError
from dynx.loaded import VARIANTS, engine_of, installed_engines, loader_class
from dynx.rules import Case, Rule, all_rules
from dynx.rules.registry import trap_case

STATES, SEED = 3, 0

VERSIONS = {engine: loader_class(engine).engine_version() for engine in installed_engines()}

VARIANT_VERSIONS = {name: VERSIONS[engine_of(name)] for name in VARIANTS if engine_of(name) in VERSIONS}
"""Versions of the loading variants, which only the rules that name them are tested on."""

# Engines that are wrong on a trap for a second cause that the trap must contain: the reason.
WRONG_FOR_SECOND_CAUSE: dict[tuple[str, str], str] = {
    ("DX210", "mujoco"): "its three joints for a planar one have the same motion and other names",
    ("DX511", "mujoco"): "DX304: followers of a follower are followers",
    ("DX511", "drake"): "DX304: followers of a follower are followers",
    ("DX512", "mujoco"): "DX304: a follower that leaves its limits follows",
    ("DX512", "drake"): "DX304: a follower that leaves its limits follows",
    ("DX618", "pybullet"): "DX619: the base that is fixed floats",
    ("DX708", "drake"): "DX711: the file that is included is named by a model",
    ("DX711", "pybullet"): "DX708: a file is included",
    ("DX720", "pybullet"): "DX708: a file is included",
    ("DX624", "pybullet"): "DX610: the mass is that of the shapes, without this one",
    ("DX716", "pybullet"): "DX709: several links are the child of no joint",
}


def rules_and_engines(named: bool) -> list[Any]:
    """Pair each rule with the installed engines that it names, or does not name."""
    return [
        pytest.param(rule, engine, id=f"{rule.id}-{engine}-{version}")
        for rule in all_rules()
        for engine, version in (VERSIONS | VARIANT_VERSIONS if named else VERSIONS).items()
        if (engine in rule.engines) == named
    ]


@cache
def examiner(engine: str) -> Examiner:
    """Make the examiner of one engine."""
    return Examiner([engine], STATES, SEED)


def mended_trap(rule: Rule) -> Case | None:
    """Return the trap mended by the first choice that has a remedy; None where none has."""
    trap = trap_case(rule)
    for choice in [None, *rule.choices]:
        case = Case(trap.source, trap.base, choices=None if choice is None else {rule.id: choice})
        remedy = rule.remedy(case, rule.detect(case))
        if remedy is not None:
            return remedy.case
    return None


def reference_of(rule: Rule, engine: str) -> ReferenceValues:
    """Return the reference values of the trap; of the mended trap where dynx refuses the text."""
    try:
        return examiner(engine).reference(trap_case(rule))
    except ModelError:
        mended = mended_trap(rule)
        assert mended is not None
        return examiner(engine).reference(mended)


def description(examination: Examination, engine: str) -> str:
    """Describe the output of an engine for the message of a failure."""
    output = examination.outputs[engine]
    return f"{engine}: {examination.errors(engine)}, refused: {output.refused}, failed: {dict(output.failed)}"


@pytest.mark.parametrize(("rule", "engine"), rules_and_engines(named=True))
def test_fact(rule: Rule, engine: str) -> None:
    before = examiner(engine).examine(trap_case(rule), reference=reference_of(rule, engine))
    if VERSIONS[engine_of(engine)] not in SpecifierSet(rule.engines[engine], prereleases=True):
        assert before.max_error(engine) <= BAR, description(before, engine)
        return
    assert before.max_error(engine) > BAR, description(before, engine)
    case = mended_trap(rule)
    if case is None:
        return
    after = examiner(engine).examine(case)
    if after.max_error(engine) > BAR:
        # A remedy may bring up another cause: links without mass between the halves of a split joint.
        mended = mend(case).case
        after = examiner(engine).examine(mended)
        case = mended
    # What no edit removes, such as numbers in single precision, is left, up to a bound.
    left = [
        other.stated_bound
        for other in all_rules()
        if other.stated and engine in other.engines and isfinite(other.stated_bound) and other.detect(case)
    ]
    assert after.max_error(engine) <= max(left, default=BAR), description(after, engine)


@pytest.mark.parametrize("rule", all_rules(), ids=lambda rule: rule.id)
def test_a_remedy_at_run_time_is_known_to_its_engine(rule: Rule) -> None:
    case = mended_trap(rule)
    calls = frozenset() if case is None else case.calls
    known = {call for engine in VERSIONS | VARIANT_VERSIONS for call in loader_class(engine).CALLS}
    assert {call for call in calls if call.split(".")[0] in VERSIONS} <= known


@pytest.mark.parametrize(("rule", "engine"), rules_and_engines(named=False))
def test_an_engine_that_is_not_named_reads_the_trap_as_dynx_does(rule: Rule, engine: str) -> None:
    if rule.formats[0] not in loader_class(engine).FORMATS:
        pytest.skip(f"{engine} loads no file of this format")
    before = examiner(engine).examine(trap_case(rule), reference=reference_of(rule, engine))
    wrong = before.max_error(engine) > BAR
    assert wrong == ((rule.id, engine) in WRONG_FOR_SECOND_CAUSE), description(before, engine)

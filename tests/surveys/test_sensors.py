"""A sample of ``python -m benchmarks.surveys.sensors``, which measures 30 robots and 1e5 samples of noise."""

from __future__ import annotations

import pytest

from benchmarks.surveys.sensors import (
    BARS,
    BASES,
    DIFFERENT,
    WORLDS,
    Worst,
    errors_in_closed_form,
    export,
    exported_scenes,
    hold_tool,
    motion,
    noise,
    observe,
)
from dynx.model.tree import Base

for package in ("mujoco", "pydrake", "pybullet", "pinocchio"):
    pytest.importorskip(package)

SAMPLE = ("a1", "panda", "talos", "ur5_gripper")
"""A quadruped, an arm with mimic joints and massless links, a humanoid, and an arm with many fixed joints."""


def check(worst: Worst, part: str) -> None:
    """Check all figures that were measured."""
    assert worst
    for what, (figure, where) in worst.items():
        assert figure <= BARS[part] or what == DIFFERENT, (what, figure, where)


@pytest.mark.long_cases
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", SAMPLE)
def test_readings_are_those_of_mujocos_sensors_in_every_engines_motion(name: str, base: Base) -> None:
    worst: Worst = {}
    motion(name, base, 3, worst)
    records = {f"record of {each}" for each in (*WORLDS, "compiled")}
    assert set(worst) == records | {f"world of {each}" for each in WORLDS}
    check(worst, "motion")


def test_random_errors_have_their_mean_variance_and_correlation() -> None:
    worst: Worst = {}
    noise(worst, 20_000)
    check(worst, "noise")


def test_errors_that_are_not_random_are_their_closed_forms() -> None:
    worst: Worst = {}
    errors_in_closed_form(worst, 2_000)
    check(worst, "errors")


@pytest.mark.long_cases
@pytest.mark.parametrize("name", ["a1", "ur5_gripper", "scenes"])
def test_documents_read_in_mujoco_alone_as_in_the_world(name: str) -> None:
    worst: Worst = {}
    for number, (scene_name, scene) in enumerate(exported_scenes([name] if name != "scenes" else [])):
        if (name == "scenes") == scene_name.startswith("scene "):
            export(scene, scene_name, number, worst)
    check(worst, "export")
    assert "documents" in worst


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", ["a1", "ur5_gripper", "so101"])
def test_a_step_on_every_link_is_found_after_5_time_constants(name: str, base: Base) -> None:
    worst: Worst = {}
    observe(name, base, 5, worst)
    check(worst, "observer")


@pytest.mark.long_cases
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", SAMPLE)
def test_nothing_is_left_of_the_weight_of_a_tool(name: str, base: Base) -> None:
    worst: Worst = {}
    hold_tool(name, base, 5, worst)
    check(worst, "tool")

"""Raw engines load mended files alike: each in a process of its own without dynx.

Robots that show each of the causes of PyBullet's and Pinocchio's differences on real files; all of
them are checked by ``python -m docs.survey``.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.surveys.raw_agreement import beside, difference, run_script, task
from dynx.agreement.tolerances import BAR
from dynx.doctor import diagnose
from dynx.loaded import installed_engines
from dynx.model.library import find
from dynx.model.tree import Base

ROBOTS = [
    "allegro_left_hand",
    "anymal_c",
    "hyq",
    "panda",
    "romeo_small",
    "ur5",
    "xarm7",
]

pytestmark = pytest.mark.skipif("pybullet" not in installed_engines(), reason="needs PyBullet")


@pytest.mark.parametrize(("base", "robots"), [("fixed", ROBOTS[::2]), ("floating", ROBOTS[1::2])])
def test_mended_files_are_loaded_alike_by_raw_engines(base: Base, robots: list[str], tmp_path: Path) -> None:
    """A sample of what `python -m benchmarks.surveys.raw_agreement` examines."""
    tasks = []
    for name in robots:
        report = diagnose(
            find(name), base=base, engines=["pinocchio", "pybullet"], samples=3, counterexamples=False
        )
        assert report.explained, (name, report.unexplained)
        text = report.mended or report.text or ""
        tasks.append(task(beside(Path(find(name)), text.encode(), tmp_path / name), base))
    found = {engine: run_script(engine, tasks, tmp_path) for engine in ("pinocchio", "pybullet")}
    apart = {
        name: difference(one, other)
        for name, one, other in zip(robots, found["pinocchio"], found["pybullet"], strict=True)
    }
    assert max(apart.values()) <= BAR, apart


def test_the_scripts_see_what_the_doctor_mends(tmp_path: Path) -> None:
    questions = [task(Path(find(name)), "fixed") for name in ROBOTS if name != "ur5"]
    found = {engine: run_script(engine, questions, tmp_path) for engine in ("pinocchio", "pybullet")}
    apart = [difference(*pair) for pair in zip(found["pinocchio"], found["pybullet"], strict=True)]
    assert min(apart) > BAR

"""The survey of robots in two formats: pairs are found, engines see what differs, and the list is sound."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import pytest

import dynx
from benchmarks.surveys.robot_pairs import (
    LIBRARY,
    MAX_FILES_PER_ROBOT,
    REPOSITORIES,
    Pair,
    RobotFile,
    choose,
    compare,
    describe,
    missed,
    read_pairs,
    without_shapes,
)

ARM = dynx.load("six_axis_arm")


def described(folder: Path, name: str, text: str) -> RobotFile:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    found = describe(("nobody/machines", "c", name, str(path)))
    assert found is not None
    return found


def test_the_list_has_each_file_once() -> None:
    pairs = read_pairs()
    assert len(pairs) >= 60
    assert {each.repository for each in pairs} | {each.other_repository for each in pairs} <= {
        LIBRARY,
        *REPOSITORIES,
    }
    assert min(Counter(each.part for each in pairs).values()) >= 20
    assert len({(each.other_repository, each.other_path) for each in pairs}) == len(pairs)
    taken = Counter(
        (each.repository, each.path, each.other_repository, each.other_path[-3:]) for each in pairs
    )
    assert max(taken.values()) <= MAX_FILES_PER_ROBOT


def test_a_file_gets_the_urdf_file_of_its_robot(tmp_path: Path) -> None:
    urdf = described(tmp_path, "six_axis/arm.urdf", ARM.to_urdf())
    other = described(tmp_path, "planar/planar.urdf", dynx.load("planar_3r").to_urdf())
    mjcf = described(tmp_path, "six_axis/mjcf/arm.xml", ARM.to_mjcf())
    (pair,) = choose([other, urdf, mjcf])
    assert (pair.path, pair.other_path) == (urdf.path, mjcf.path)
    assert describe(("nobody/machines", "c", "none.xml", str(tmp_path / "six_axis/arm.urdf"))) is not None


@pytest.mark.parametrize("part", ["same", "mass", "axis"])
def test_engines_judge_a_report(tmp_path: Path, part: str) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("pinocchio")
    changes = {"same": ("", ""), "mass": ('mass="4.2"', 'mass="4.5"'), "axis": ('pos="0.42 0', 'pos="0.43 0')}
    text = ARM.to_mjcf()
    assert changes[part][0] in text
    paths = [tmp_path / "a.urdf", tmp_path / "b.xml"]
    paths[0].write_text(ARM.to_urdf(), encoding="utf-8")
    paths[1].write_text(text.replace(*changes[part], 1), encoding="utf-8")
    pair = Pair("develop", "o/r", "c", "a.urdf", "", "o/r", "c", "b.xml", "")
    result = compare((pair, str(paths[0]), str(paths[1])))
    assert result.note == ""
    assert not missed(result)
    assert result.engines is not None
    if part == "same":
        assert (result.word, result.engines < 1e-9) == ("same", True)
        return
    assert (result.word, result.engines > 1e-3, result.reinserted, result.unreal) == (
        "different",
        True,
        1,
        (),
    )
    assert result.mended is not None
    assert result.mended < 1e-9


def test_shapes_are_dropped_only_where_inertias_are_written() -> None:
    kept = ElementTree.fromstring(without_shapes(ARM.to_mjcf()))
    assert kept.findall("worldbody//inertial")
    assert not kept.findall("worldbody//geom")
    derived = "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"
    assert without_shapes(derived) == derived

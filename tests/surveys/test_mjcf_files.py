"""The survey of public MJCF files: what it finds out about one file."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.surveys import mjcf_files
from benchmarks.surveys.mjcf_files import EXACT

pytest.importorskip("mujoco")

BODY = '<body pos="1 0 0"><{}/><geom size="0.1" pos="0.2 0 0"/><site name="tip" pos="0 0 1"/></body>'


def word_of(path: Path, world: str, compiler: str = "") -> str:
    path.write_text(f"<mujoco><compiler {compiler}/><worldbody>{world}</worldbody></mujoco>")
    found = mjcf_files.examine(str(path))
    if found.word == "alike":
        assert found.difference <= EXACT
    return found.word


@pytest.mark.parametrize("joint", ["joint", "freejoint", 'joint type="slide" ref="0.3"'])
def test_one_robot_is_read_alike_by_mujoco(tmp_path: Path, joint: str) -> None:
    still = '<body><geom size="1"/></body>'
    assert word_of(tmp_path / "a.xml", still + BODY.format(joint)) == "alike"


def test_other_ends_have_words_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "a.xml"
    free = BODY.format("freejoint")
    assert word_of(path, free, 'alignfree="true"') == "read, not compared"
    assert word_of(path, free + free.replace('"tip"', '"top"')) == "alike as a scene"
    ball = '<body><joint type="ball"/><geom size="1"/></body>'
    assert word_of(path, BODY.format('joint type="ball"')) == "alike"
    assert word_of(path, free + ball) == "alike as a scene"
    cloth = '<flexcomp name="cloth" type="grid" count="3 3 1" spacing="0.1 0.1 0.1" radius="0.01" dim="2"/>'
    assert word_of(path, free + cloth) == "refused"
    assert word_of(path, BODY.format("joint").replace("/>", ' mass="x"/>', 1)).endswith("no robot in MuJoCo")

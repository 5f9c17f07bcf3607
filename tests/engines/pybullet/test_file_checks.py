"""Files that would crash PyBullet are refused with the reason, without asking it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

import dynx
from dynx.engines.pybullet.as_loaded import LoadedPyBullet
from dynx.engines.pybullet.file_checks import MAX_JOINTS, MAX_NAME_LENGTH, require_harmless
from dynx.errors import EngineError, UnusableEngineError
from dynx.model import Joint, Link, Model
from tests.backends.robots import chain
from tests.loaded.files import loaded

bullet = pytest.importorskip("pybullet")

TEXT = chain(2).to_urdf()
CHANGES: dict[str, Callable[[str], str]] = {
    "a <joint> without a name": lambda text: text.replace(' name="joint1"', ""),
    "a <link> without a name": lambda text: text.replace('link name="link2"', 'link name=""'),
    "'%n', has a %": lambda text: text.replace("link2", "%n"),
    "'a%sb', has a %": lambda text: text.replace("joint1", "a%sb"),
    "'100%', has a %": lambda text: text.replace('"chain"', '"100%"'),
    f"has {MAX_NAME_LENGTH + 1} characters": lambda text: text.replace("joint1", "j" * (MAX_NAME_LENGTH + 1)),
    "has 600 characters": lambda text: text.replace("link1", "ü" * 600),
    "joint 'joint1' has no type": lambda text: text.replace('name="joint1" type="revolute"', 'name="joint1"'),
    "two joints have the same name": lambda text: text.replace("joint1", "joint0"),
    "several links are the child of no joint": lambda text: text.replace(
        "<robot ", '<robot version="1" '
    ).replace("  <joint", '  <link name="alone"/>\n  <joint', 1),
    "the <joint> elements of the file are not those of the tree": lambda text: text.replace(
        '<parent link="link1"/>', '<parent link="link2"/>'
    ),
    "document type": lambda text: text.replace("<robot", '<!DOCTYPE robot [<!ENTITY a "b">]><robot', 1),
    "not complete XML": lambda text: text.replace("</robot>", ""),
}


@pytest.mark.parametrize("reason", CHANGES)
def test_files_that_crash_bullet_are_refused(reason: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bullet, "loadURDF", lambda *args, **options: pytest.fail("Bullet was called"))
    text = CHANGES[reason](TEXT)
    assert text != TEXT
    with (
        pytest.raises(
            EngineError, match=r"pybullet (would crash on|cannot load|is not compared on) chain"
        ) as caught,
        loaded(LoadedPyBullet, chain(2), text),
    ):
        pass
    assert reason in str(caught.value)


@pytest.mark.parametrize("axis", ["<axis/>", '<axis xzy="0 0 1"/>'])
def test_an_axis_that_bullet_does_not_initialise_is_refused(axis: str) -> None:
    text = re.sub(r"<axis[^>]*/>", axis, TEXT, count=1)
    assert text != TEXT
    with (
        pytest.raises(UnusableEngineError, match=r"axis of joint 'joint0' from memory .*<axis> has no xyz"),
        loaded(LoadedPyBullet, chain(2), text),
    ):
        pass
    fixed = TEXT.replace('name="joint0" type="revolute"', 'name="joint0" type="fixed"')
    model = dynx.load(fixed)
    with loaded(LoadedPyBullet, model, re.sub(r"<axis[^>]*/>", axis, fixed, count=1)) as robot:
        assert robot.mass_matrix(model.neutral()).shape == (1, 1)


def test_what_is_no_file_is_not_handed_over(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.urdf"):
        with pytest.raises(EngineError, match="no regular file"):
            LoadedPyBullet(path, chain(2))


def test_names_at_the_bound_are_loaded() -> None:
    first, second, joint = "a" * MAX_NAME_LENGTH, "b" * MAX_NAME_LENGTH, "j" * MAX_NAME_LENGTH
    model = Model.build("long", [Link(first), Link(second)], [Joint(joint, "revolute", first, second)])
    with loaded(LoadedPyBullet, model) as robot:
        assert robot.describe().links.keys() == {first, second}


def test_frames_that_dynx_added_count_as_links(tmp_path: Path) -> None:
    model = chain(2).with_frame("tip", "link2")
    path = tmp_path / "robot.urdf"
    path.write_text(model.to_urdf())
    require_harmless(path, model)


def test_joints_beyond_the_limit_of_bullet_are_refused() -> None:
    with (
        pytest.raises(EngineError, match=f"has {MAX_JOINTS + 1} joints, fixed ones included"),
        loaded(LoadedPyBullet, chain(MAX_JOINTS + 1)),
    ):
        pass


def test_joints_that_bullet_reads_as_another_type_are_named() -> None:
    model = chain(2)
    for kind, word in (("floating", "fixed"), ("planar", "planar"), ("spherical", "spherical")):
        text = model.to_urdf().replace('name="joint1" type="revolute"', f'name="joint1" type="{kind}"')
        with pytest.raises(EngineError, match=f"'joint1' .{word}"), loaded(LoadedPyBullet, model, text):
            pass

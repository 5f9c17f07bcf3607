"""Encodings, byte-order marks and line ends of files, as engines load them and in the mended file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from dynx.agreement.tolerances import BAR
from dynx.doctor import diagnose
from dynx.doctor.examination import LOADING, MAX_LIMIT_DISTANCE, draw_states, model_without_mimics
from dynx.loaded import installed_engines
from dynx.model.xml.source import XmlSource
from dynx.rules.registry import find_trap

needs_mujoco = pytest.mark.skipif("mujoco" not in installed_engines(), reason="needs MuJoCo")

BOTH = ["pinocchio", "pybullet"]
TEXT = find_trap("DX101").read_text(encoding="utf-8")
BODY = TEXT[TEXT.index("<robot") :]


@pytest.mark.parametrize(
    "data",
    [
        TEXT.replace("\n", "\r\n").encode(),
        b"\xef\xbb\xbf" + TEXT.encode(),
        b"\n\n " + BODY.encode() + b"\0",
        b"<!-- Gr\xfc\xdfe -->" + BODY.encode(),
    ],
    ids=["carriage_returns", "mark", "ends", "latin_1_undeclared"],
)
def test_a_mended_file_keeps_its_form(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_bytes(data)
    assert XmlSource(data).to_bytes() == data
    report = diagnose(path, engines=BOTH, samples=2, counterexamples=False)
    assert report.explained
    assert report.form is not None
    mended = report.form.encode(report.mended or "")
    lines = mended.splitlines(keepends=True)
    kept = [line for line in data.splitlines(keepends=True) if line in lines]
    assert len(kept) >= len(data.splitlines()) - 1
    ends = {line[len(line.rstrip(b"\r\n")) :] for line in lines[:-1]}
    assert len(ends) == 1
    assert diagnose(mended, engines=BOTH, samples=2).alike


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-32-le"])
def test_text_that_no_engine_reads_is_given_to_them_as_it_is(encoding: str) -> None:
    data = f"\ufeff{BODY}".encode(encoding)
    assert XmlSource(data).to_bytes() == data
    report = diagnose(data, engines=BOTH, samples=2)
    assert all(each.refused is not None for each in report.engines)
    assert "DX440" in {finding.rule for finding in report.differences}
    assert not report.unexplained
    assert json.dumps(report.to_dict(), allow_nan=False)


@needs_mujoco
def test_what_hides_behind_a_refusal_stays_as_it_is() -> None:
    """MuJoCo refuses its own <option> to the end, so that nothing shows what DX411 does to it."""
    option = '<mujoco><option gravity="down"/></mujoco></robot>'
    text = find_trap("DX411").read_text(encoding="utf-8").replace("</robot>", option)
    found = diagnose(text, engines=["mujoco"], samples=2, counterexamples=False)
    assert [(each.quantity, each.engine) for each in found.unexplained] == [(LOADING, "mujoco")]
    (refusal,) = (each.refused_after for each in found.engines)
    assert "gravity" in (refusal or "")
    assert found.mended is None
    assert not found.changes
    again = diagnose(text, engines=["mujoco"], samples=2, counterexamples=False)
    assert {**again.to_dict(), "seconds": 0} == {**found.to_dict(), "seconds": 0}


@needs_mujoco
def test_contacts_that_no_state_showed_need_no_call() -> None:
    sphere = '<collision><geometry><sphere radius="1e-6"/></geometry></collision></link>'
    inertial = (
        '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    )
    links = "".join(f'<link name="{name}">{inertial}{sphere}' for name in "abc")
    joints = "".join(
        f'<joint name="{one}{two}" type="continuous"><parent link="{one}"/><child link="{two}"/>'
        f'<origin xyz="1 0 0"/><axis xyz="0 0 {length}"/></joint>'
        for one, two, length in (("a", "b", 1), ("b", "c", 2))
    )
    bare = '<link name="d"/><joint name="cd" type="fixed"><parent link="c"/><child link="d"/></joint>'
    bare = bare.replace(
        '"d"/>', '"d"><collision><geometry><box size="1e-6 1e-6 1e-6"/></geometry></collision></link>', 1
    )
    report = diagnose(f'<robot name="r">{links}{joints}{bare}</robot>', samples=2, counterexamples=False)
    (contacts,) = (each for each in report.findings if each.rule == "DX308")
    assert report.explained
    assert not report.alike
    assert contacts.effect is None
    assert not [call for call in report.calls if "CONTACT" in call.code]


@pytest.mark.parametrize(("lower", "upper"), [(1.5, 2.0), (-9.0, -4.0), (0.9, 1.8)])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_states_are_within_limits_that_leave_zero_out(kind: str, lower: float, upper: float) -> None:
    text = (
        '<robot name="r"><link name="a"/><link name="b"/>'
        f'<joint name="j" type="{kind}"><parent link="a"/><child link="b"/>'
        f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/></joint></robot>'
    )
    q = draw_states(model_without_mimics(XmlSource(text), "fixed"), 20, 0).q
    assert np.all((lower < q) & (q < upper))
    far = text.replace(f'"{lower}"', f'"{MAX_LIMIT_DISTANCE * 2}"').replace(
        f'"{upper}"', f'"{MAX_LIMIT_DISTANCE * 3}"'
    )
    assert np.all(np.abs(draw_states(model_without_mimics(XmlSource(far), "fixed"), 20, 0).q) <= np.pi)


def test_numbers_that_overflow_end_in_a_report() -> None:
    moments = "".join(
        f' {name}="{value}"' for name, value in (("ixx", 1e308), ("iyy", 1e308), ("izz", 1e300))
    )
    text = (
        '<robot name="r"><link name="a"/><link name="b"><inertial><origin xyz="0 1e155 0"/><mass value="1"/>'
        f'<inertia{moments} ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>'
    )
    with np.errstate(all="ignore"):
        report = diagnose(text, engines=BOTH, samples=2, counterexamples=False)
    assert json.dumps(report.to_dict(), allow_nan=False)
    worst = max((error for each in report.engines for error in each.before.values()), default=0.0)
    assert report.error is not None or report.alike == (worst <= BAR)

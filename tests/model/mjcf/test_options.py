"""Options of MJCF: each flag that MuJoCo knows has its effect or a note, and others are refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import DescriptionError
from dynx.model.mjcf.options import FLAGS
from dynx.world import Scene, read_scene

mujoco = pytest.importorskip("mujoco")

OLDER = {"passive", "sensornoise"}
"""Flags that MuJoCo 4.0 has no longer."""

OFF_AT_FIRST = {"diagexact", "energy", "fwdinv", "invdiscrete", "ipc", "override", "sensornoise", "sleep"} | {
    "speculative"
}
EXACT = {"gravity"}
"""Flags whose effect dynx has without a note; in a scene these, too: contact and filterparent."""


def text(option: str, joint: str = 'damping="0.05" frictionloss="0.2" stiffness="3"') -> str:
    return f"""<mujoco model="m">{option}<worldbody><body name="swing" pos="1 0 1">
      <joint name="s" axis="0 1 0" range="-10 10" {joint}/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/>
    </body></worldbody></mujoco>"""


def flag(name: str, word: str) -> str:
    return f'<option>\n<flag {name}="{word}"/></option>'


def scene_of(content: str, tmp_path: Path) -> Scene:
    (tmp_path / "m.xml").write_text(content)
    return read_scene(tmp_path / "m.xml")


def schema(tag: str) -> set[str]:
    """Return the attributes that MuJoCo's reader knows of an element."""
    found = re.search(
        rf"\n *{tag} \([?*]\)(.*?)\n *\w+ \([?*!R]\)", mujoco.mj_printSchema(False, False), re.S
    )
    assert found is not None
    return set(found[1].split())


def test_the_flags_are_those_that_mujoco_knows() -> None:
    assert schema("flag") == FLAGS - OLDER


@pytest.mark.parametrize("name", sorted(FLAGS))
def test_each_flag_has_its_effect_or_a_note(name: str, tmp_path: Path) -> None:
    word = "enable" if name in OFF_AT_FIRST else "disable"
    plain, found = dynx.load(text("")), dynx.load(text(flag(name, word)))
    added = [note for note in found.notes if note.message not in {each.message for each in plain.notes}]
    if name in EXACT:
        assert not added
        assert found.gravity != plain.gravity
    else:
        assert added
        assert all(note.line == 2 for note in added)
    of_scene = [note for note in scene_of(text(flag(name, word)), tmp_path).notes if note.line == 2]
    assert bool(of_scene) == (name not in {*EXACT, "contact", "filterparent"})


@given(st.sets(st.sampled_from(["damper", "frictionloss", "spring", "constraint", "gravity"])))
def test_passive_forces_are_those_of_mujoco(disabled: set[str]) -> None:
    stated = "".join(f' {name}="disable"' for name in sorted(disabled))
    content = text(
        f"<option><flag{stated}/></option>", 'damping="0.05" frictionloss="0.2" stiffness="3" springref="20"'
    )
    model = dynx.load(content)
    compiled = mujoco.MjModel.from_xml_string(content)
    data = mujoco.MjData(compiled)
    data.qvel[0], data.qpos[0] = 1.5, 0.7
    mujoco.mj_forward(compiled, data)
    dynamics = model.joint("s").dynamics
    passive = -dynamics.damping * 1.5 - dynamics.stiffness * (0.7 - dynamics.spring_reference)
    assert np.isclose(passive, data.qfrc_passive[0], rtol=1e-12, atol=0.0)
    rows = data.efc_frictionloss[: data.nefc]
    assert dynamics.friction == (rows.max() if len(rows) else 0.0)
    weight = dynx.backend("reference", model).gravity_torque(np.zeros(1))
    data.qvel[0] = data.qpos[0] = 0.0
    mujoco.mj_forward(compiled, data)
    assert np.allclose(weight, data.qfrc_bias, rtol=1e-9, atol=1e-12)


def test_the_last_flag_of_a_name_counts() -> None:
    both = f"{flag('damper', 'disable')}{flag('damper', 'enable')}"
    assert dynx.load(text(both)).joint("s").dynamics.damping == 0.05


def test_limits_stay() -> None:
    model = dynx.load(text(flag("limit", "disable")))
    assert np.isfinite(model.joint("s").limits.upper)
    assert any("limits" in note.message for note in model.notes)


def test_couplings_are_not_read_where_they_are_disabled() -> None:
    written = dynx.load(MIMIC).to_mjcf()
    assert dynx.load(written).joint("b").mimic is not None
    option = flag("equality", "disable")
    assert dynx.load(written.replace("<worldbody>", f"{option}<worldbody>", 1)).joint("b").mimic is None


MIMIC = """<robot name="r"><link name="base"/><link name="x"/><link name="y"/>
<joint name="a" type="continuous"><parent link="base"/><child link="x"/></joint>
<joint name="b" type="continuous"><parent link="x"/><child link="y"/><mimic joint="a"/></joint></robot>"""


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ('<option><flag dampr="disable"/></option>', ["dampr", "damper"]),
        ('<option><flag damper="off"/></option>', ["damper", "off", "disable"]),
        ('<option timstep="0.1"/>', ["timstep", "timestep"]),
        ('<option gravity="0 1"/>', ["gravity"]),
    ],
)
def test_misspelt_options_are_refused(option: str, words: list[str]) -> None:
    with pytest.raises(DescriptionError) as caught:
        dynx.load(text(option))
    assert all(word in str(caught.value) for word in words)


def test_a_scene_names_the_settings_of_the_step_in_one_note(tmp_path: Path) -> None:
    option = (
        '<option timestep="0.005" integrator="RK4" cone="pyramidal" impratio="10" iterations="3"'
        ' solver="PGS">'
        '<flag warmstart="disable" energy="enable" sensor="enable"/></option>'
    )
    (note,) = (each for each in scene_of(text(option), tmp_path).notes if "timestep" in each.message)
    for name in ("integrator", "cone", "impratio", "iterations", "solver", "warmstart", "energy", "World"):
        assert name in note.message
    assert "sensor" not in note.message


def test_every_option_of_mujoco_is_read_or_named(tmp_path: Path) -> None:
    for name in sorted(schema("option") - {"gravity"}):
        value = {"wind": "1 0 0", "magnetic": "0 0 1", "integrator": "RK4", "cone": "elliptic"}.get(name, "1")
        notes = scene_of(text(f'<option {name}="{value}"/>'), tmp_path).notes
        assert any(name in note.message for note in notes), name

"""Rules about text: each fault is found where it stands and mended there and nowhere else."""

from __future__ import annotations

import codecs
import importlib.util
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.cli.doctor.files import write_mended
from dynx.doctor import diagnose
from dynx.doctor.task import DoctorTask, examine
from dynx.loaded import installed_engines
from dynx.model.library import find
from dynx.model.loading import load
from dynx.model.xml.source import SourceElement, XmlSource
from dynx.rules import Case, all_rules, find_rule
from dynx.rules.catalogue.document import MAX_LINE_BYTES
from dynx.rules.numbers_in_text import MisspelledNumberRule, NumericAttribute, numeric_attributes
from dynx.rules.registry import trap_case
from dynx.testing.strategies import urdf_text
from tests.rules.documents import LIMIT, case_of, joint, link
from tests.rules.trap_cases import assert_same_robot, changed_lines, mended, only, trap

READING = tuple(rule.id for rule in all_rules() if rule.stage == "reading")
NUMBERS = tuple(rule.id for rule in all_rules() if isinstance(rule, MisspelledNumberRule))
MENDED = {
    "DX401": ("upper", None),
    "DX402": (None, "elbow"),
    "DX403": ("lower", None),
    "DX404": (None, "elbow"),
    "DX405": ("upper", None),
    "DX406": (None, "elbow"),
    "DX408": (None, "elbow"),
    "DX409": ("lower", None),
    "DX410": ("tool", None),
    "DX411": (None, "elbow"),
    "DX412": (None, None),
    "DX413": ("upper", None),
    "DX414": ("lower_50%", None),
    "DX415": (None, None),
    "DX416": (None, None),
    "DX417": ("base", None),
    "DX418": (None, "elbow"),
    "DX419": (None, "elbow"),
    "DX420": (None, "elbow"),
    "DX421": (None, "elbow"),
    "DX424": ("base", None),
    "DX426": (None, None),
}
CHOICES = {"DX420": {"DX420": "guess"}}
"""Choices of those that by default leave what they find as it is."""
SPEC = importlib.util.find_spec("pybullet_data")
BULLET = Path(SPEC.origin).parent if SPEC is not None and SPEC.origin else None


@pytest.mark.parametrize("rule_id", MENDED)
def test_the_place_is_found_and_the_text_becomes_readable(rule_id: str) -> None:
    case = trap(rule_id, **CHOICES.get(rule_id, {}))
    found, remedy = mended(rule_id, case)
    assert (only(found).link, only(found).joint) == MENDED[rule_id]
    line = case.source.text.splitlines()[(only(found).line or 0) - 1]
    assert remedy.case.readable
    assert line.strip() in changed_lines(case, remedy.case)
    if case.readable and rule_id != "DX414":
        assert_same_robot(case.model, remedy.case.model)


def test_all_infinite_limits_of_a_joint_are_found() -> None:
    found, remedy = mended("DX407", trap("DX407"))
    assert {each.joint for each in found} == {"elbow"}
    assert len(found) == 4
    limits = remedy.case.model.joint("elbow").limits
    assert limits == type(limits)()


@pytest.mark.parametrize("rule_id", [*NUMBERS, "DX409", "DX411"])
def test_one_line_changes(rule_id: str) -> None:
    case = trap(rule_id, **CHOICES.get(rule_id, {}))
    assert len(changed_lines(case, mended(rule_id, case)[1].case)) == 1


@given(urdf_text())
def test_text_that_dynx_reads_means_the_same_after_every_remedy(text: str) -> None:
    # `urdf_text` writes numbers among odd white space, leaves out efforts and velocities, and so on.
    case = Case(XmlSource(text))
    for rule in (find_rule(rule_id) for rule_id in READING):
        remedy = rule.remedy(case, rule.detect(case))
        if remedy is not None:
            assert not rule.detect(remedy.case)
            assert remedy.case.model == case.model, rule.id


def _is_drawn(element: SourceElement | None) -> bool:
    return element is not None and (element.tag == "visual" or _is_drawn(element.parent))


@given(st.sampled_from(["six_axis_arm", "cart_pole", "scara"]), st.data())
def test_a_planted_fault_is_found_where_it_is(robot: str, data: st.DataObject) -> None:
    source = XmlSource(find(robot).read_text(encoding="utf-8"))
    # In a shape that is only drawn these faults have no effect.
    places = [each for each in numeric_attributes(source) if not _is_drawn(each.element)]
    place = data.draw(st.sampled_from(places))
    rule_id, written = data.draw(st.sampled_from(list(_faults(place, place.text_in(source)))))
    planted = source.apply(source.attribute_edit(place.element, place.name, written))
    case = Case(planted)
    found, remedy = mended(rule_id, case)
    part = place.element
    while part.parent is not source.root and part.parent is not None:
        part = part.parent
    assert {each.link or each.joint for each in found} == {part.attributes["name"]}
    assert remedy.case.model == load(source.text)
    others = [each for each in NUMBERS if each != rule_id]
    assert not any(find_rule(each).detect(case) for each in others)


def _faults(place: NumericAttribute, text: str) -> list[tuple[str, str]]:
    """Ways to write the same numbers badly, with the rule about each."""
    if place.count == 1:
        ways = [("DX405", f"\u00a0{text}"), ("DX405", f" {text} "), ("DX403", f"{text} kg")]
        ways += [("DX421", text.replace("-", "\u2212"))] if "-" in text else []
        return [*ways, ("DX401", text.replace(".", ","))] if "." in text else ways
    words = text.split()
    ways = [("DX402", ", ".join(words)), ("DX404", f"{text} 7"), ("DX402", "; ".join(words))]
    ways += [("DX421", text.replace("-", "\u2212"))] if "-" in text else []
    return [*ways, ("DX401", text.replace(".", ","))] if "." in text else ways


@pytest.mark.parametrize("blank", ["\t", "\n", "\r\n  ", "\u00a0"])
def test_any_white_space_but_blanks(blank: str) -> None:
    text = trap("DX406").source.text.replace("0.2\t-0.05\t0.25", blank.join(("0.2", "-0.05", "0.25")))
    found, remedy = mended("DX406", Case(XmlSource(text)))
    assert only(found).joint == "elbow"
    assert 'xyz="0.2 -0.05 0.25"' in remedy.case.source.text


@pytest.mark.parametrize(("choice", "mass"), [("decimal", 1.25), ("thousands", 1250.0)])
def test_a_comma_is_read_by_choice(choice: str, mass: float) -> None:
    text = trap("DX401").source.text.replace('"2,5"', '"1,250"')
    remedy = mended("DX401", Case(XmlSource(text), choices={"DX401": choice}))[1]
    assert remedy.case.model.inertial("upper").mass == mass
    assert remedy.choice is not None


def test_a_vector_of_wrong_length_can_count_as_not_given() -> None:
    model = mended("DX404", trap("DX404", DX404="default"))[1].case.model
    assert model.joint("elbow").origin.xyz == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("choice", "mass"), [("point", 0.4), ("weightless", 0.0)])
def test_an_inertial_without_tensor(choice: str, mass: float) -> None:
    text = trap("DX410").source.text.replace("<mass>0.4</mass>", '<mass value="0.4"/>')
    start = text.index("<inertia ", text.index('value="0.4"'))
    text = text[:start] + text[text.index("/>", start) + 2 :]
    found, remedy = mended("DX410", Case(XmlSource(text), choices={"DX410": choice}))
    assert only(found).link == "tool"
    assert remedy.case.model.inertial("tool").mass == mass
    assert not remedy.case.model.inertial("tool").tensor.any()


@pytest.mark.parametrize("mass", ["", "<mass/>", "<mass>heavy</mass>"])
def test_an_inertial_without_mass_weighs_nothing(mass: str) -> None:
    text = trap("DX410").source.text.replace("<mass>0.4</mass>", mass)
    remedy = mended("DX410", Case(XmlSource(text)))[1]
    assert remedy.case.model.inertial("tool").mass == 0.0


@given(st.integers(0, 3 * MAX_LINE_BYTES))
def test_what_pybullet_cuts_is_found_and_mended(padding: int) -> None:
    text = find("six_axis_arm").read_text(encoding="utf-8")
    start = text.index("<link")
    one_line = text[:start] + f"<!--{'x' * padding}-->" + " ".join(text[start:].split())
    case = Case(XmlSource(one_line))
    rule = find_rule("DX413")
    found = rule.detect(case)
    remedy = rule.remedy(case, found)
    assert bool(found) == (_tags(_cut(case.source)) != _tags(case.source))
    if remedy is not None:
        assert not rule.detect(remedy.case)
        assert remedy.case.model == case.model


def _cut(source: XmlSource) -> XmlSource:
    """Return the document as PyBullet reads it: a line break behind every 8191 bytes of a line."""
    lines = source.data.split(b"\n")
    pieces = [
        line[k : k + MAX_LINE_BYTES] for line in lines for k in range(0, max(len(line), 1), MAX_LINE_BYTES)
    ]
    return _Torn(b"\n".join(pieces))


class _Torn(XmlSource):
    """Text that need not be XML any more."""

    def __init__(self, data: bytes) -> None:
        self.data = data


def _tags(source: XmlSource) -> list[bytes]:
    """Return the text of each tag."""
    pieces = source.data.split(b"<")
    return [piece.partition(b">")[0] for piece in pieces if piece.strip()[:1] != b"!"]


@pytest.mark.skipif(BULLET is None, reason="pybullet_data is not installed")
@pytest.mark.parametrize(
    "file",
    [
        "bicycle/bike.urdf",
        "biped/biped2d_pybullet.urdf",
        "humanoid/humanoid.urdf",
        "quadruped/microtaur/microtaur.urdf",
        "spherical_joint_limit.urdf",
    ],
)
def test_files_of_pybullet_that_dynx_refuses_become_readable(file: str) -> None:
    assert BULLET is not None
    case = Case(XmlSource((BULLET / file).read_bytes(), file))
    assert not case.readable
    for rule in (find_rule(rule_id) for rule_id in READING):
        remedy = rule.remedy(case, rule.detect(case))
        case = case if remedy is None else remedy.case
    assert case.readable, case.reading


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ('<mass value="0.4"/>', '<mass valeu="0.4"/>'),
        ('<mass value="0.4"/>', '<mass vale="0.4" unit="kg"/>'),
        ('ixx="0.001"', 'ixxx="0.001"'),
        ('izz="0.003" iyy="0.002"', 'IZZ="0.003" iy="0.002"'),
    ],
)
def test_a_number_under_a_misspelled_name_is_what_was_meant(right: str, wrong: str) -> None:
    tensor = '<inertia ixx="0.001" izz="0.003" iyy="0.002" ixy="0" ixz="0" iyz="0"/>'
    inertial = f'<inertial><mass value="0.4"/>{tensor}</inertial>'
    text = case_of(
        '<link name="base"/>', f'<link name="arm">{inertial}</link>', joint("j", "base", "arm")
    ).source.text
    broken = text.replace(right, wrong)
    assert broken != text
    found, remedy = mended("DX410", Case(XmlSource(broken)))
    assert len(found) == 1
    model, meant = remedy.case.model, Case(XmlSource(text)).model
    assert [link.inertial for link in model.links] == [link.inertial for link in meant.links]


TEXT = trap_case("DX101").source.text
RULE = find_rule("DX422")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\r\r\n", "\r \t\n"])
def test_a_line_end_is_reported_where_text_follows_a_lone_carriage_return(end: str) -> None:
    case = Case(XmlSource(TEXT.replace("\n", end), "robot.urdf"))
    found = RULE.detect(case)
    assert bool(found) == (end == "\r")
    if not found:
        return
    assert [(each.link, each.joint, each.line) for each in found] == [(None, None, 1)]
    remedy = RULE.remedy(case, found)
    assert remedy is not None
    assert remedy.case.source.text == TEXT
    assert not RULE.detect(remedy.case)


def test_a_single_place_is_reported_at_its_line() -> None:
    lines = TEXT.splitlines(keepends=True)
    lines[4] = lines[4].replace("\n", "\r")
    [found] = RULE.detect(Case(XmlSource("".join(lines))))
    assert (found.line, found.message) == (5, "a line ends with a carriage return alone")


def test_faults_of_a_file_with_carriage_returns_have_the_lines_of_the_file_with_line_feeds() -> None:
    engines = [name for name in ("pinocchio", "pybullet") if name in installed_engines()]
    right, found = (diagnose(text, engines=engines, samples=1) for text in (TEXT, TEXT.replace("\n", "\r")))
    places = {(each.rule, each.link, each.line) for each in found.findings if each.rule != "DX422"}
    assert places == {(each.rule, each.link, each.line) for each in right.findings}
    assert found.explained
    if "pybullet" in engines:
        assert found.mended is not None
        assert "\r" not in found.mended
        assert [each.level for each in found.changes if each.rule == "DX422"] == ["safe"]


PLAIN = case_of(link("base"), link("arm"), joint("elbow", "base", "arm")).source.text
NAMED = PLAIN.replace('"arm"', '"größe"').replace('"elbow"', '"öse"')
COMMENTED = PLAIN.replace("<link", "<!-- größe --><link", 1)


def declared(encoding: str, text: str) -> bytes:
    """Return the text, with a declaration of its encoding."""
    return f'<?xml version="1.0" encoding="{encoding}"?>\n{text}'.encode(encoding)


@pytest.mark.parametrize(
    "data",
    [
        NAMED.encode(),
        codecs.BOM_UTF8 + NAMED.encode(),
        declared("UTF-8", NAMED),
        declared("ISO-8859-1", COMMENTED),
        declared("ISO-8859-1", PLAIN),
        COMMENTED.encode("latin-1"),
        declared("Shift_JIS", PLAIN.replace("<link", "<!-- 表示 --><link", 1)),
        b"\n\n" + PLAIN.encode() + b"\0\0",
    ],
)
def test_engines_load_a_file_whose_names_are_utf8(data: bytes) -> None:
    report = diagnose(data, samples=1)
    assert report.alike
    assert not report.findings


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (NAMED.encode("latin-1"), None),
        (declared("ISO-8859-1", NAMED), None),
        (declared("windows-1252", NAMED), None),
        (NAMED.encode("utf-16"), 1),
        (declared("UTF-16", NAMED), 2),
        (PLAIN.encode("utf-16-le"), 1),
        (PLAIN.encode("utf-32"), 1),
    ],
)
def test_other_files_are_saved_in_utf8(data: bytes, line: int | None, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_bytes(data)
    report = examine(DoctorTask(str(path), "fixed", samples=1))
    [finding] = report.differences
    assert (finding.rule, finding.proved) == ("DX440", True)
    assert line in (None, finding.line)
    assert set(finding.engines) == {each.engine for each in report.engines}
    mended = tmp_path / "mended.urdf"
    assert write_mended(str(mended), report, over_input=False)
    text = mended.read_bytes().decode("utf-8")
    assert ("größe" in text) == (finding.line != 1 or "größe".encode("utf-16-le") in data)
    assert "UTF-16" not in text
    assert diagnose(mended, samples=1).alike


@pytest.mark.parametrize("encoding", ["cp037", "idna", "no-such-encoding", "utf-7"])
def test_an_encoding_that_cannot_be_read_is_a_refusal_with_the_reason(encoding: str) -> None:
    try:
        data = f'<?xml version="1.0" encoding="{encoding}"?>{PLAIN}'.encode(encoding)
    except (LookupError, UnicodeError):
        data = f'<?xml version="1.0" encoding="{encoding}"?>{PLAIN}'.encode()
    report = diagnose(data, samples=1)
    assert report.error is None or report.error.type == "DescriptionError"


@pytest.mark.skipif("pinocchio" not in installed_engines(), reason="only Pinocchio reads the version")
@pytest.mark.parametrize(
    ("version", "missing", "rules"),
    [
        ("1.1", "effort", {"DX204"}),
        ("1.1", "lower", set()),
        ("1.2", "effort", set()),
        ("1.2", "lower", {"DX222"}),
        ("2.0", "effort", {"DX204", "DX416"}),
        ("2.0", "lower", {"DX416"}),
    ],
)
def test_each_version_has_its_own_rule(version: str, missing: str, rules: set[str]) -> None:
    """URDF 1.2 requires both ends and no effort; a version that does not exist counts as its remedy."""
    limit = LIMIT.replace(f'{missing}="', 'other="')
    text = case_of(link("a"), link("b"), joint("j", "a", "b", limit=limit)).source.text
    text = text.replace("<robot ", f'<robot version="{version}" ')
    report = diagnose(text, engines=["pinocchio"], counterexamples=False)
    assert {each.rule for each in report.findings if each.kind == "difference"} == rules
    assert all(each.proved for each in report.differences)
    assert report.explained

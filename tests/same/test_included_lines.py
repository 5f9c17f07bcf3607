"""Lines of files that another MJCF file includes: every report names the file."""

from __future__ import annotations

import copy
import json
import pickle
from pathlib import Path

import dynx
from dynx.model.xml.several_files import IncludedLine, file_of_line
from dynx.same import same_robot
from dynx.same.formats.html import html_page
from dynx.same.formats.sarif import sarif_document

WHOLE = """<mujoco model="arm">
  <worldbody><body name="a"><joint name="i"/><geom size="0.1" pos="0.1 0 0"/>
  <include file="part.xml"/></body></worldbody>
</mujoco>"""
PART = """<mujocoinclude>

  <body name="b" pos="0 0 1"><joint name="j" axis="1 0 0" damping="1"/>
    <inertial mass="2" pos="0 0.1 0" diaginertia="1 1 1"/></body>
</mujocoinclude>"""


def written(folder: Path, part: str = PART) -> Path:
    folder.mkdir()
    (folder / "part.xml").write_text(part)
    (folder / "arm.xml").write_text(WHOLE)
    return folder / "arm.xml"


def test_a_line_keeps_its_file() -> None:
    line = IncludedLine(7, "part.xml")
    for each in (line, copy.deepcopy(line), pickle.loads(pickle.dumps(line))):
        assert (each, file_of_line(each), json.dumps(each)) == (7, "part.xml", "7")
    assert file_of_line(7) is None
    assert file_of_line(None) is None


def test_reports_name_the_included_file(tmp_path: Path) -> None:
    first = written(tmp_path / "one")
    second = written(
        tmp_path / "two", PART.replace('mass="2"', 'mass="3"').replace('damping="1"', 'damping="2"')
    )
    report = same_robot(first, second)
    (difference,), (damping,) = report.differences, report.attributes
    part = str(tmp_path / "two" / "part.xml")
    assert (difference.second_line, difference.second_file) == (4, part)
    assert (damping.second_line, damping.second_file) == (3, part)
    assert damping.first_file == str(tmp_path / "one" / "part.xml")
    document = report.to_dict()
    assert document["differences"][0]["second_file"] == part
    results = json.loads(json.dumps(sarif_document(report)))["runs"][0]["results"]
    for each in results:
        assert each["locations"][0]["physicalLocation"]["artifactLocation"]["uri"].endswith("two/part.xml")
        related = each["relatedLocations"][0]["physicalLocation"]["artifactLocation"]["uri"]
        assert related.endswith("one/part.xml")
    assert "<html" in html_page(report)
    assert same_robot(first, first).attributes == ()


def test_parts_of_the_file_itself_name_no_file(tmp_path: Path) -> None:
    model = dynx.load(written(tmp_path / "one"))
    assert [file_of_line(each.line) for each in model.joints] == [None, str(tmp_path / "one" / "part.xml")]
    again = pickle.loads(pickle.dumps(model))
    assert file_of_line(again.joints[1].line) == file_of_line(model.joints[1].line)

"""Encodings of files: what dynx reads in each, and what engines do with it."""

from __future__ import annotations

import codecs
from pathlib import Path

import pytest

from dynx.cli.doctor.files import write_mended
from dynx.doctor import diagnose
from dynx.doctor.task import DoctorTask, examine
from tests.rules.documents import case_of, joint, link

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

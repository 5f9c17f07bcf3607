"""Attacks by tables: logs in CSV that are read, and tables that dynx writes from names of strangers."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from pathlib import Path

from tests.security.attack import Box, Deed, attacks_on, sparse

attack = attacks_on("csv")

GOOD = "t,q:joint\n0,0\n1,1\n2,4\n"


def robot(box: Box, joint: str = "joint") -> str:
    """Write a robot of one joint."""
    from xml.sax.saxutils import quoteattr

    inertial = (
        '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    text = (
        f'<robot name="r"><link name="a"/><link name="b">{inertial}</link><joint name={quoteattr(joint)} '
        'type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/></joint></robot>'
    )
    return box.file("r.urdf", text)


def deed(box: Box, content: str | bytes, ends: tuple[int, ...] = (2,)) -> Deed:
    """Write a table, which the victim compares with itself."""
    name = box.file("log.csv", content)
    return Deed(("compare", name, name, "--robot", robot(box)), ends=ends)


def written(box: Box, joint: str) -> Deed:
    """Write a robot, whose motion the victim writes to a table."""
    return Deed((robot(box, joint), "out.csv"), "saved", (0,), check=_plain_cells(box.here / "out.csv"))


def refused(box: Box, joint: str) -> Deed:
    """Write a robot whose motion is not written to a table."""
    return Deed((robot(box, joint), "out.csv"), "saved")


def _plain_cells(path: Path) -> Callable[[str], str | None]:
    def check(_: str) -> str | None:
        text = path.read_text(encoding="utf-8")
        for separator in ",;\t":
            for row in csv.reader(text.splitlines(keepends=True), delimiter=separator):
                for cell in row:
                    if cell[:1] in ("=", "+", "@") or (cell[:1] == "-" and not _is_number(cell)):
                        return f"a cell that a spreadsheet computes, between {separator!r}: {cell[:50]!r}"
        return None

    return check


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return all(
            part.replace(".", "").replace("e", "").lstrip("-").isdigit() for part in cell.split(",") if part
        )
    return True


@attack("code", "formula in the name of a joint")
def _(box: Box) -> Deed:
    return written(box, "=cmd|'/C calc'!A0")


@attack("code", "formula behind a semicolon")
def _(box: Box) -> Deed:
    return refused(box, "a;=HYPERLINK(1)")


@attack("code", "formula behind a tab")
def _(box: Box) -> Deed:
    return refused(box, "a\t@SUM(1)")


@attack("code", "formula behind quotes")
def _(box: Box) -> Deed:
    return written(box, 'a","=1+1",";')


@attack("link", "link to a file of the system")
def _(box: Box) -> Deed:
    (box.here / "log.csv").symlink_to("/proc/self/mem")
    return Deed(("compare", "log.csv", "log.csv", "--robot", robot(box)))


@attack("device", "endless device")
def _(box: Box) -> Deed:
    (box.here / "log.csv").symlink_to("/dev/zero")
    return Deed(("compare", "log.csv", "log.csv", "--robot", robot(box)))


@attack("device", "pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "log.csv")
    return Deed(("compare", "log.csv", "log.csv", "--robot", robot(box)))


@attack("bomb", "sparse file")
def _(box: Box) -> Deed:
    sparse(box.here / "log.csv", 2**36, GOOD.encode())
    return Deed(("compare", "log.csv", "log.csv", "--robot", robot(box)))


@attack("bomb", "a hundred million empty cells")
def _(box: Box) -> Deed:
    return deed(box, b"t,q:joint\n" + b"," * (6 * 10**7))


@attack("bomb", "thirty million short rows")
def _(box: Box) -> Deed:
    return deed(box, b"t,q:joint\n" + b"1\n" * (3 * 10**7))


@attack("bomb", "quote that never ends")
def _(box: Box) -> Deed:
    return deed(box, b't,q:joint\n"' + b"x" * (6 * 10**7))


@attack("bomb", "million columns of the same name")
def _(box: Box) -> Deed:
    return deed(box, "t," + ",".join(["q:joint"] * 10**6) + "\n0,0\n1,1\n")


@attack("type", "texts that are almost numbers")
def _(box: Box) -> Deed:
    return deed(box, "t,q:joint\n0,0x10\n1,1_0\n2,\u0663\n")


@attack("type", "numbers that are not finite")
def _(box: Box) -> Deed:
    return deed(box, "t,q:joint\n0,nan\n1,1e999\n2,-inf\n")


@attack("type", "zero bytes and other encodings")
def _(box: Box) -> Deed:
    return deed(box, GOOD.encode("utf-16") + b"\0\xff")


@attack("type", "zero bytes in a row")
def _(box: Box) -> Deed:
    return deed(box, "t,q:joint\n0,0\n1,\0\n")


@attack("type", "rows of other lengths")
def _(box: Box) -> Deed:
    return deed(box, "t,q:joint\n0\n1,1,1,1\n,\n2,2\n")


@attack("terminal", "escape sequences in the header")
def _(box: Box) -> Deed:
    return deed(box, "\x1b]0;owned\x07t,\x1b[2Jq:joint,\u202e\n0,0,0\n")


@attack("terminal", "escape sequences in a cell")
def _(box: Box) -> Deed:
    return deed(box, "t,q:joint\n0,\x1b[2J\u202e\n1,1\n")


@attack("printf", "formats in the header and in cells")
def _(box: Box) -> Deed:
    return deed(box, "t,q:joint,%s%n{0.__class__}\n%d%s%n,{t}\n1,1\n")

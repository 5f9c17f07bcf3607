"""DX440 text-not-utf8: The file is not in UTF-8, as which engines read every file.

Engines ignore the encoding that a file declares. In Latin-1 or the like, characters beyond ASCII become bytes
that are no text: without effect in comments, but not in the names of links and joints:

- Pinocchio 4.1 and MuJoCo 4.0 load the file, and raise UnicodeDecodeError when a program reads such a name.
- Drake 1.51 raises that error when it loads the file.
- PyBullet 3.2.7 returns the bytes of such a name, which ``decode()`` refuses.
- All refuse a file in UTF-16 or UTF-32.

dynx reads these files: names by the encoding that is declared, and as Latin-1 where none is declared and
the file is not UTF-8.

What to do: save the file in UTF-8. ``dynx doctor --fix`` writes it so, and the declaration too.
"""

from collections.abc import Iterable, Sequence

from dynx.errors import shown
from dynx.rules import Case, Detection, Remedy, Rule, measured_on
from dynx.rules.rule import found_at

_UTF8 = ("utf-8", "ascii", "us-ascii")

_NOT_ASCII_BASED = ("utf-16", "utf-32", "utf-7", "iso-2022", "hz")
"""Encodings in which the markup itself is not written as in ASCII."""


class TextNotUtf8(Rule):
    stage = "reading"
    advice = "Save the file in UTF-8."
    engines = measured_on("pinocchio", "pybullet", "mujoco", "drake")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first name of a link or joint that engines cannot read, or the root."""
        encoding = case.source.form.encoding.lower()
        if encoding in _UTF8:
            return
        root = case.source.root
        if encoding.startswith(_NOT_ASCII_BASED):
            yield found_at(root, f"the file is in {encoding.upper()}")
            return
        parts = [each for tag in ("link", "joint") for each in root.all(tag)]
        named = [each for each in parts if not each.attributes.get("name", "").isascii()]
        if named:
            first = shown(named[0].attributes["name"])
            others = f", as are {len(named) - 1} other names" if len(named) > 1 else ""
            yield found_at(named[0], f"the name {first} is in {encoding.upper()}{others}")

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the file in UTF-8."""
        return Remedy(case.with_source(case.source.in_utf8()), "saved the file in UTF-8")

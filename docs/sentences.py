"""Count the sentences of the README and the pages that have more words than a reader takes in at once.

    python -m docs.sentences [PAGE ...]

It prints how many sentences of each page have more than 30 words, then each of these with its file and
line. The exit code is 1 if their share exceeds 5 % on a page.

Only prose counts: no code, tables, headings, formulas on lines of their own, lists of publications, and
nothing that a command writes between two marks. Inline code and a formula are one word each; the address
of a link is none.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
MAX_WORDS = 30
MAX_SHARE = 0.05
# Lists that commands write: the catalogue of rules, and causes by robot.
LISTS = ("docs/rules.md", "docs/real_robots.md")

_MARK_OF_ITEM = re.compile(r"\s*(?:[-*+]|\d+[.)])\s+")
_ABBREVIATION = re.compile(
    r"(?:^|[\s(])(?:[A-Z]|e\.g|i\.e|et al|vs|Fig|Eq|Sec|No|Vol|Proc|Trans|Int|Conf|Dr)\.$"
)
_END = re.compile(r"[.!?][\"')\]*_]*(?=\s|$)")
_PUBLICATION = re.compile(r"\((?:1[89]|20)\d\d\)\.?$")


@dataclass(frozen=True)
class Sentence:
    """Sentence of a page, as it is read: `text` without marks of links, at a line of a file below ROOT."""

    file: str
    line: int
    text: str

    @property
    def words(self) -> int:
        """Number of words, of which inline code and a formula are one each."""
        return sum(any(each.isalnum() for each in word) for word in self.text.split())


def pages() -> list[Path]:
    """Return the README and every page of prose."""
    found = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [path for path in found if path.relative_to(ROOT).as_posix() not in LISTS]


def sentences(path: Path) -> Iterator[Sentence]:
    """Return the sentences of a page, in order."""
    name = path.relative_to(ROOT).as_posix()
    for line, text in paragraphs(path.read_text(encoding="utf-8")):
        for start, sentence in split(text):
            yield Sentence(name, line + text.count("\n", 0, start), readable(sentence))


def paragraphs(page: str) -> Iterator[tuple[int, str]]:
    """Return each paragraph of prose and each item of a list, with the number of its first line."""
    start, found = 0, list[str]()
    for number, line in prose_lines(page):
        item = _MARK_OF_ITEM.match(line)
        if found and (item or not line.strip()):
            yield start, "\n".join(found)
            found = []
        if line.strip():
            start = start if found else number
            found.append(line[item.end() :] if item else line)
    if found:
        yield start, "\n".join(found)


def prose_lines(page: str) -> Iterator[tuple[int, str]]:
    """Return each line with its number; lines that are no prose are empty."""
    for pattern in (
        r"^<!-- written: .*?^<!-- end -->",
        r"^( *)(```+|~~~+).*?^\1\2 *$",
        r"^ *\$\$.*?\$\$ *$",
        r"<!--.*?-->",
    ):
        page = re.sub(pattern, _blank, page, flags=re.MULTILINE | re.DOTALL)
    in_list, after_blank, in_code = False, True, False
    for number, line in enumerate(page.splitlines(), start=1):
        bare = line.strip()
        indent = len(line) - len(line.lstrip())
        if bare and indent == 0:
            in_list = bool(_MARK_OF_ITEM.match(line))
        in_code = bool(bare) and indent >= 4 and not in_list and (after_blank or in_code)
        after_blank = not bare
        yield number, "" if in_code or re.match(r"[|#]|:{3,}|[-=]{3,}$|<[^>]*>$", bare) else line


def _blank(match: re.Match[str]) -> str:
    """Return as many empty lines as a match has."""
    return "\n" * match[0].count("\n")


def split(paragraph: str) -> Iterator[tuple[int, str]]:
    """Return the sentences of a paragraph, each with its first character's index."""
    # Stops within code, formulas and addresses end no sentence.
    hidden = re.sub(
        r"`+[^`]+`+|\$[^$\n]+\$|\]\([^)]*\)", lambda match: re.sub(r"\S", "x", match[0]), paragraph
    )
    start = 0
    for end in _END.finditer(hidden):
        if hidden[start : end.end()].strip() and not _ABBREVIATION.search(hidden[start : end.start() + 1]):
            yield from _stripped(paragraph, start, end.end())
            start = end.end()
    yield from _stripped(paragraph, start, len(paragraph))


def _stripped(paragraph: str, start: int, end: int) -> Iterator[tuple[int, str]]:
    """Return one sentence without white space around it, if it has any word."""
    text = paragraph[start:end]
    if text.strip():
        yield start + len(text) - len(text.lstrip()), text.strip()


def readable(sentence: str) -> str:
    """Return a sentence on one line, with code and formulas as one word and links as their text."""
    text = re.sub(r"(`[^`]*`)|!\[[^\]]*\]\([^)]*\)|<[^>]*>", lambda match: match[1] or " ", sentence)
    text = re.sub(r"`+[^`]+`+|\$[^$\n]+\$", lambda match: "".join(match[0].split()), text)
    text = re.sub(r"\[([^\]]*)\](?:\([^)]*\)|\[[^\]]*\])", r"\1", text)
    return " ".join(text.split())


def long(found: Sequence[Sentence]) -> list[Sentence]:
    """Return the sentences of more than MAX_WORDS words; entries of lists of publications are none."""
    return [each for each in found if each.words > MAX_WORDS and not _PUBLICATION.search(each.text)]


def main(arguments: Sequence[str]) -> int:
    """Print the count of each page and its long sentences; return the exit code."""
    counts = {}
    for path in [Path(each).resolve() for each in arguments] or pages():
        found = list(sentences(path))
        counts[path.relative_to(ROOT).as_posix()] = (len(found), long(found))
    total, many = sum(number for number, _ in counts.values()), sum(len(each) for _, each in counts.values())
    for name, (number, too_long) in counts.items():
        print(f"{name}: {len(too_long)} of {number} ({share(number, too_long):.1%})")
    print(f"all: {many} of {total} ({many / max(total, 1):.1%})")
    for _, too_long in counts.values():
        for each in too_long:
            print(f"{each.file}:{each.line}: {each.words} words: {each.text}")
    return int(any(share(number, too_long) > MAX_SHARE for number, too_long in counts.values()))


def share(number: int, too_long: Sequence[Sentence]) -> float:
    """Return the share of long sentences on a page with a number of sentences."""
    return len(too_long) / max(number, 1)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

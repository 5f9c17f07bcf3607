"""Write the tables of public_files.md on the doctor's reports, and the list of repositories.

    python -m docs.public_files MANIFEST.json A=A.jsonl B=B.jsonl ...

The manifest is a list of {repo, path, commit, sha256, half, at}: `half` is the part of a file, `at` its place
on this machine. The results of a part are those of ``python -m benchmarks.surveys.files``; ``B.raw.json``
beside ``B.jsonl`` has those of
``python -m benchmarks.surveys.raw_agreement B.jsonl --json B.raw.json``, if any. The text
between the tables is kept.
"""

from __future__ import annotations

import json
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.surveys.files import SMALL, Entry, differs, read_entries
from docs.page_parts import replaced, table
from dynx.rules import find_rule

PAGE = Path(__file__).with_name("public_files.md")

HEADS = (
    *("part", "base", "files", "repositories", "refused", "differ"),
    *("unexplained", "failed", "alike without dynx"),
)


def main() -> None:
    """Write the parts."""
    manifest = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    results = {part: Path(path) for part, _, path in (each.partition("=") for each in sys.argv[2:])}
    text = PAGE.read_text(encoding="utf-8")
    for name, part in (*figures(manifest, results), ("sources", sources(manifest))):
        text = replaced(PAGE, text, name, part)
    PAGE.write_text(text, encoding="utf-8")


def figures(manifest: Sequence[dict[str, Any]], results: Mapping[str, Path]) -> Iterator[tuple[str, str]]:
    """Yield the names and the tables of figures and causes by part."""
    part_of = {each["at"]: each["half"] for each in manifest}
    repository = {each["at"]: each["repo"] for each in manifest}
    lines = []
    causes: dict[str, Counter[str]] = defaultdict(Counter)
    for part, path in results.items():
        entries = [entry for entry in read_entries(path) if part_of.get(entry["path"]) == part]
        raw = path.with_suffix(".raw.json")
        gaps = json.loads(raw.read_text(encoding="utf-8")) if raw.exists() else []
        for base in ("fixed", "floating"):
            of = [entry for entry in entries if entry["base"] == base]
            if of:
                repositories = len({repository[entry["path"]] for entry in of})
                lines.append((part, base, str(len(of)), str(repositories), *row(of), alike(gaps, base)))
            for entry in of:
                causes[part].update({each["rule"] for each in entry.get("findings", ()) if each["effect"]})
    yield "figures", table(HEADS, lines)
    yield "causes", causes_table(causes)


def causes_table(causes: Mapping[str, Counter[str]]) -> str:
    """Return the examinations in which each rule has an effect, by part; the most frequent rules first."""
    total: Counter[str] = sum(causes.values(), Counter())
    rows = (
        (
            f"[{rule}](rules.md#{rule.lower()}) {find_rule(rule).name}",
            *(str(counter[rule]) for counter in causes.values()),
        )
        for rule, _ in total.most_common()
    )
    return table(("cause", *(f"part {part}" for part in causes)), rows)


def row(of: Sequence[Entry]) -> tuple[str, ...]:
    """Return the cells of one part and base."""
    done = [entry for entry in of if "failed" not in entry]
    refused = [entry for entry in done if entry["error"]]
    loaded = sum(sum(each is None for each in entry["loads"].values()) >= 2 for entry in refused)
    large = sum(differs(entry, SMALL) for entry in done)
    return (
        f"{len(refused)} ({loaded})",
        f"{sum(differs(entry) for entry in done)} ({large})",
        str(sum(bool(entry["unexplained"]) for entry in done)),
        str(len(of) - len(done)),
    )


def alike(gaps: Sequence[dict[str, Any]], base: str) -> str:
    """The number of repaired files that engines without dynx load alike, of those that all are to load."""
    of = [each for each in gaps if each["base"] == base and not each["refusing"]]
    return f"{sum(not each['apart'] for each in of)} of {len(of)}" if of else ""


def sources(manifest: Sequence[dict[str, Any]]) -> str:
    """Return the repositories of each part with their commits and numbers of files."""
    files = Counter((each["half"], each["repo"], each["commit"]) for each in manifest)
    paragraphs = []
    for part in sorted({each["half"] for each in manifest}):
        of = sorted(
            (repo.lower(), repo, commit, number)
            for (half, repo, commit), number in files.items()
            if half == part
        )
        listed = ", ".join(f"{repo}@{commit[:8]} ({number})" for _, repo, commit, number in of)
        paragraphs.append(f"\nPart {part}: {listed}.\n")
    return "".join(paragraphs)


if __name__ == "__main__":
    main()

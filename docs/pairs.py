"""Write the tables of pairs.md: whether public files of one robot in two formats describe the same robot.

    python -m docs.pairs RESULTS.jsonl ...

The results are those of ``python -m benchmarks.surveys.robot_pairs run``. The text between the
tables is kept.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.surveys.robot_pairs import PairResult, read_pairs, read_results, summary
from docs.page_parts import replaced, table

PAGE = Path(__file__).with_name("pairs.md")

HEADS = (
    *("MJCF or SDF file", "URDF file", "verdict", "elements", "joints without counterpart"),
    *("largest difference", "engines"),
)


def parts(results: Sequence[PairResult]) -> Iterator[tuple[str, str]]:
    """Yield the name and the text of the list of repositories, and of each part of the list with results."""
    for part in ("bar", "develop"):
        chosen = [each for each in results if each.pair.part == part]
        if chosen:
            yield part, f"{summary(chosen)}\n\n{table(HEADS, map(_cells, chosen))}"
    commits = {
        (repository, commit[:10] or "installed package")
        for pair in read_pairs()
        for repository, commit in (
            (pair.repository, pair.commit),
            (pair.other_repository, pair.other_commit),
        )
    }
    yield "repositories", table(("repository", "commit"), sorted(commits))


def _cells(result: PairResult) -> tuple[str, ...]:
    """Return the row of a pair in the table."""
    pair = result.pair
    alone = pair.repository == pair.other_repository
    # The folders in a message are those of the machine of the survey.
    refusal = re.sub(r"\S+/(?=\S)", "", result.verdict)
    cells = (
        f"{pair.other_repository}: {pair.other_path}",
        pair.path if alone else f"{pair.repository}: {pair.path}",
        result.word if result.word != "refused" else f"refused: {refusal}",
        str(result.differences or ""),
        str(result.unmatched or ""),
        f"{result.largest:.2g}: {result.largest_name}" if result.differences else "",
        "-" if result.engines is None else f"{result.engines:.2g}",
    )
    return tuple(cell.replace("<", "&lt;") for cell in cells)


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    for name, part in parts([row for path in sys.argv[1:] for row in read_results(Path(path))]):
        text = replaced(PAGE, text, name, part)
    PAGE.write_text(text, encoding="utf-8")

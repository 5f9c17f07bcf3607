"""Write pairs.md: whether public files of one robot in two formats describe the same robot.

    python -m docs.pairs RESULTS.jsonl ...

The results are those of ``python -m benchmarks.surveys.robot_pairs run``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.surveys.robot_pairs import LIBRARY, TOLERANCE, PairResult, read_results, summary

PAGE = Path(__file__).with_name("pairs.md")

HEAD = """# Public robots in two formats: is it the same robot?

`python -m docs.pairs` writes this page from a survey. The survey runs [`dynx same`](same.md) on robots that
public repositories describe in more than one format. A pair is a URDF file and an MJCF or SDF file. The
URDF file is from the same repository, from another one, or from example-robot-data. The files share a word
of their paths, and most names of their joints.

- **The list** is `benchmarks/surveys/robot_pairs.tsv`: repository, commit, path and SHA-256 of each file. A
  program chose the pairs. It takes at most {most} files of a format of a repository for one URDF file.
- **The tolerance is {tolerance:g}**, since many files have four or five digits.
- **A verdict is about rigid-body dynamics.** Limits, damping, armature, actuators and shapes are not part
  of it.
- **Different does not mean wrong.** Two files often describe two versions of a robot, or one file has a
  hand, a sensor or a fixed joint that the other file lacks.
- **Engines without dynx check each report.** Pinocchio loads the URDF file and MuJoCo the MJCF file. A
  *missed* difference is one that the engines see and the report lacks, or one that remains after all named
  elements are replaced. An *unreal* element changes no mass and no joint-space inertia in Pinocchio, if
  only this element is reinserted. An engine cannot check a pair if it refuses a file.
- **Half of the pairs were used in development**, chosen by a hash. The other half was compared
  twice: the list of differences was mended between the two runs, and both runs missed no difference.

"""


def page(results: Sequence[PairResult]) -> Iterator[str]:
    """Yield the parts of the page."""
    from benchmarks.surveys.robot_pairs import MAX_FILES_PER_ROBOT

    yield HEAD.format(most=MAX_FILES_PER_ROBOT, tolerance=TOLERANCE)
    for part, title in (("bar", "Pairs not used in development"), ("develop", "Pairs used in development")):
        chosen = [each for each in results if each.pair.part == part]
        if not chosen:
            continue
        yield f"## {title}\n\n{summary(chosen)}\n\n"
        heads = ("file", "URDF file", "verdict", "elements", "joints without counterpart")
        yield f"| {' | '.join((*heads, 'largest difference', 'engines'))} |\n"
        yield "|---|---|---|---|---|---|---|\n"
        for each in chosen:
            yield _row(each)
        yield "\n"
    yield "## Repositories\n\n| repository | commit |\n|---|---|\n"
    commits = {
        (repository, commit)
        for each in results
        for repository, commit in (
            (each.pair.repository, each.pair.commit),
            (each.pair.other_repository, each.pair.other_commit),
        )
    }
    for repository, commit in sorted(commits):
        yield f"| {repository} | {commit[:10] or 'installed package'} |\n"


def _row(result: PairResult) -> str:
    pair = result.pair
    first = pair.path if pair.repository == LIBRARY else f"{pair.repository}: {pair.path}"
    if pair.repository == pair.other_repository:
        first = pair.path
    seen = "-" if result.engines is None else f"{result.engines:.2g}"
    cells = (
        f"{pair.other_repository}: {pair.other_path}",
        first,
        result.word if result.word != "refused" else f"refused: {result.verdict[-160:]}",
        str(result.differences or ""),
        str(result.unmatched or ""),
        f"{result.largest:.2g}: {result.largest_name}" if result.differences else "",
        seen,
    )
    return f"| {' | '.join(cell.replace('|', '/').replace('<', '&lt;') for cell in cells)} |\n"


if __name__ == "__main__":
    found = [row for path in sys.argv[1:] for row in read_results(Path(path))]
    PAGE.write_text("".join(page(found)).rstrip() + "\n", encoding="utf-8")

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

Some public repositories describe a robot in more than one format. This page states for each such pair of
files whether both describe the same robot. `python -m docs.pairs` writes the page from the results of a
survey, which runs [`dynx same`](same.md) on each pair.

A *pair* is a URDF file and an MJCF or SDF file. The URDF file may be from the same repository, from
another repository, or from example-robot-data. A program chose pairs of files that share a word in their
paths or robot names, and at least half of their joint names. If both files are in one repository, an equal
number of joints is enough instead of equal joint names. For one URDF file the program takes at most {most}
MJCF files and {most} SDF files of a repository. The list of pairs is `benchmarks/surveys/robot_pairs.tsv`,
with repository, commit, path and SHA-256 of each file.

How to read the tables:

- **The tolerance is {tolerance:g}**, because the numbers in many files have four or five digits.
- **A verdict is about rigid-body dynamics.** Limits, damping, armature, actuators and shapes do not
  affect the verdict.
- **Different does not mean wrong.** Two files often describe two versions of a robot, or one file has a
  hand, a sensor or a fixed joint that the other file lacks.
- **`elements`** is the number of elements of the files that differ. **`joints without counterpart`** is
  the number of joints that only one file has.
- **`largest difference`** begins with the [size](same.md#what-the-report-contains) of the largest
  difference, relative to a scale of the robot. Then it names the element.
- **`engines`** has the result of an independent check. Pinocchio loads the URDF file, MuJoCo the MJCF
  file, and Drake the SDF file, all without dynx. The column has the largest relative difference of total
  mass and joint-space inertia between the two engines. It has `-` if an engine refuses a file or the
  robots have different joints.

The survey also checks each report of `dynx same`:

- A difference is *missed* if the report says "same" and the two engines differ by more than ten times the
  tolerance. It is missed, too, if the engines still differ by this amount after the survey has replaced
  all elements that the report names.
- After this replacement the survey reinserts each original element alone. If this element changes neither
  the mass nor the joint-space inertia in Pinocchio, the report named it wrongly.

Half of the pairs, chosen by a hash, were used in the development of `dynx same`. The other half was
compared twice. Between the two runs, a fault in the list of differences was corrected. Neither run missed
a difference.

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

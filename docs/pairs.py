"""Write pairs.md: whether public files of one robot in two formats describe the same robot.

    python -m docs.pairs RESULTS.jsonl ...

The results are those of ``python -m benchmarks.surveys.robot_pairs run``.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.surveys.robot_pairs import TOLERANCE, PairResult, read_results, summary

PAGE = Path(__file__).with_name("pairs.md")

HEAD = """# Public robots in two formats: is it the same robot?

Some public repositories describe a robot in more than one format. This page states for each such pair of
files whether both describe the same robot. `python -m docs.pairs` writes the page from the results of a
survey, which runs [`dynx same`](same.md) on each pair.

A *pair* is a URDF file and an MJCF or SDF file. The URDF file may be from the same repository, from
another repository, or from the package example-robot-data. A program chose the pairs by three rules:

- The two files share a word in their paths or robot names.
- The two files share at least half of their joint names. Files of one repository may instead have equal
  numbers of joints.
- For one URDF file the program takes at most {most} MJCF files and {most} SDF files of a repository.

The list of pairs is `benchmarks/surveys/robot_pairs.tsv`, with repository, commit, path and SHA-256 of each
file.

How to read the tables:

- **The tolerance is {tolerance:g}**, because the numbers in many files have four or five digits.
- **A verdict is about rigid-body dynamics.** Limits, damping, armature, actuators and shapes do not
  affect the verdict.
- **Different does not mean wrong.** Two files often describe two versions of a robot, or one file has a
  hand, a sensor or a fixed joint that the other file lacks.
- **`URDF file`** has a path without a repository if both files are in one repository.
- **`elements`** is the number of elements of the files that differ. **`joints without counterpart`** is
  the number of joints that only one file has. Joints behind such a joint are not counted.
- **`largest difference`** begins with the [size](same.md#what-the-report-contains) of the largest
  difference, relative to a scale of the robot. Then it names the element in the MJCF or SDF file. In "2 kg
  instead of 3 kg", the MJCF or SDF file has 2 kg, and needs 3 kg to agree with the URDF file.
- **`merged body`** means that fixed joints connect the named link to other links, and that the sum of their
  inertials differs. `without` names other links in the MJCF or SDF file that have mass. The first number is
  the value of the named link alone. With the second number the sum agrees with the URDF file, while the
  other links keep their inertials. A mass after "instead of" can therefore be negative.
- **`engines`** has the result of an independent check. Pinocchio loads the URDF file, MuJoCo the MJCF
  file, and Drake the SDF file, all without dynx. The column has the largest relative difference of total
  mass and joint-space inertia between the two engines. The check uses the joints that have a counterpart.
  The column has `-` if an engine or dynx refuses a file, or if no joint has a counterpart.

The survey also checks each report of `dynx same`:

- If the report says "same", and the two engines differ by more than ten times the tolerance, a difference
  is *missed*.
- If the report says "different", and each joint has a counterpart, the survey repairs the MJCF or SDF file:
  it replaces all elements that the report names. If the engines still differ by more than ten times the
  tolerance, a difference is *missed*, too. If MuJoCo or Drake refuses the file, Pinocchio loads the repaired
  robot instead.
- The survey then reinserts each original element alone into the repaired robot. If an element changes
  neither the mass nor the joint-space inertia in Pinocchio, the report named the element wrongly.

The development of `dynx same` used {develop} of the {count} pairs, chosen by a hash. The other pairs were
compared twice. Between the two comparisons, a fault in the list of differences that `dynx same` prints was
corrected. Neither comparison missed a difference.

"""


def page(results: Sequence[PairResult]) -> Iterator[str]:
    """Yield the parts of the page."""
    from benchmarks.surveys.robot_pairs import MAX_FILES_PER_ROBOT

    develop = sum(each.pair.part == "develop" for each in results)
    yield HEAD.format(most=MAX_FILES_PER_ROBOT, tolerance=TOLERANCE, develop=develop, count=len(results))
    for part, title in (("bar", "Pairs not used in development"), ("develop", "Pairs used in development")):
        chosen = [each for each in results if each.pair.part == part]
        if not chosen:
            continue
        yield f"## {title}\n\n{summary(chosen)}\n\n"
        heads = ("MJCF or SDF file", "URDF file", "verdict", "elements", "joints without counterpart")
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
    alone = pair.repository == pair.other_repository
    # The folders in a message are those of the machine of the survey.
    refusal = re.sub(r"\S+/(?=\S)", "", result.verdict)
    seen = "-" if result.engines is None else f"{result.engines:.2g}"
    cells = (
        f"{pair.other_repository}: {pair.other_path}",
        pair.path if alone else f"{pair.repository}: {pair.path}",
        result.word if result.word != "refused" else f"refused: {refusal}",
        str(result.differences or ""),
        str(result.unmatched or ""),
        f"{result.largest:.2g}: {result.largest_name}" if result.differences else "",
        seen,
    )
    return f"| {' | '.join(cell.replace('|', '/').replace('<', '&lt;') for cell in cells)} |\n"


if __name__ == "__main__":
    found = [row for path in sys.argv[1:] for row in read_results(Path(path))]
    PAGE.write_text("".join(page(found)).rstrip() + "\n", encoding="utf-8")

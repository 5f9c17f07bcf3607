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

Some public repositories describe a robot in more than one format. A *pair* is a URDF file, and an MJCF or
SDF file. This page states for each pair whether both files describe the same robot. A survey runs
[`dynx same`](same.md) on each pair, and `python -m docs.pairs` writes the results on this page.

The URDF file may be from the same repository, from another repository, or from the package
example-robot-data. A program chose the pairs by three rules:

- The two files share a word in their paths or robot names.
- The two files share at least half of their joint names. If the files are from one repository, equal numbers
  of joints are enough.
- For one URDF file the program takes at most {most} MJCF files and {most} SDF files of a repository.

The list of pairs is `benchmarks/surveys/robot_pairs.tsv`, with repository, commit, path and SHA-256 of each
file.

## How to read the tables

The numbers in many files have only four or five digits. So a difference counts only if it exceeds the
tolerance {tolerance:g}. "Different" does not mean that a file is wrong. The two files often describe two
versions of a robot. Or one file has a hand, a sensor or a fixed joint that the other file lacks.

| column | meaning |
|---|---|
| URDF file | its path. A path without a repository is in the repository of the MJCF or SDF file |
| verdict | whether both files have the same rigid-body dynamics. Limits, damping, armature, actuators and \
shapes do not affect the verdict |
| elements | number of elements of the MJCF or SDF file that differ |
| joints without counterpart | number of joints that only one file has. Joints behind such a joint are not \
counted |
| largest difference | the element with the largest difference |
| engines | two engines load the files without dynx. The column states how much the two robots differ |

**Engines.** Pinocchio loads the URDF file. MuJoCo loads the MJCF file, or Drake loads the SDF file. The
column has the largest relative difference of total mass and joint-space inertia between the two engines. For
the inertia, the survey uses the joints that have a counterpart. `-` means that an engine refuses a file, or
that no joint has a counterpart.

**Largest difference.** Examples:

| in the table | meaning |
|---|---|
| `0.026: link torso, inertial` | the [size](same.md#what-the-report-contains) of the difference, and the \
element of the MJCF or SDF file |
| `mass 2 kg instead of 3 kg` | the MJCF or SDF file has 2 kg. With 3 kg it would agree with the URDF file |
| `centre of mass 0.01 m off` | the centre of mass is 0.01 m away from the place where the files would agree |
| `moments off by 0.5 of the largest` | an entry of the inertia tensor differs by half of the largest entry |
| `merged body: mass 2 kg instead of 3 kg` | fixed joints connect the link to others, and these links form \
one merged body. The total inertia of the merged body differs |
| `merged body without wrist: mass 2 kg instead of -1 kg` | the link `wrist` belongs to the same merged \
body. The rest of this body has 2 kg. If `wrist` keeps its mass, the rest needs -1 kg |

## How the survey checks dynx

- **Reports that say "same".** If the two engines differ by more than ten times the tolerance, the report
  *missed* a difference.
- **Reports that say "different".** If each joint has a counterpart, the survey repairs the MJCF or SDF file:
  it replaces all elements that the report names. If the engines still differ by more than ten times the
  tolerance, the report *missed* a difference. If MuJoCo or Drake refuses the file, Pinocchio loads the
  repaired robot instead.
- **Elements that should not be in a report.** The survey puts each original element alone back into the
  repaired robot. The mass or the joint-space inertia in Pinocchio must then change. Otherwise the report
  named the element wrongly.

A report counts as checked if engines could compare the pair itself or the repaired file.

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

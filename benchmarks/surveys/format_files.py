"""Public files of one format for a survey: their list, the files themselves, and what a survey prints."""

from __future__ import annotations

import argparse
import csv
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import astuple, dataclass
from pathlib import Path

from benchmarks.surveys.public_list import PublicFile, sha256_of, snapshot_output
from dynx.workers import Workers


@dataclass(frozen=True)
class FormatFiles:
    """Files of one format in repositories: those that end in `ends` and match `kept`, without those that
    `left_out` matches by their paths. Files that end in `beside` are extracted with them. `develops` says
    which are to develop on, by the repository and the path; the others are to measure."""

    table: Path
    repositories: tuple[str, ...]
    ends: tuple[str, ...]
    kept: re.Pattern[str]
    beside: tuple[str, ...]
    develops: Callable[[str, str], bool]
    left_out: re.Pattern[str] | None = None

    def choose(self, snapshots: Path) -> Iterator[PublicFile]:
        """Choose the files of the list: one copy of each text up to white space."""
        seen: set[str] = set()
        for repository in self.repositories:
            snapshot = snapshots / repository.replace("/", "+")
            commit = snapshot_output(snapshot, "rev-parse", "HEAD").decode().strip()
            for path in sorted(name for name in _names(snapshot, commit) if name.endswith(self.ends)):
                if self.left_out is not None and self.left_out.search(f"{repository}/{path}"):
                    continue
                try:
                    data = snapshot_output(snapshot, "cat-file", "blob", f"{commit}:{path}")
                except subprocess.CalledProcessError:
                    continue
                text = data.decode(errors="replace")
                key = sha256_of("".join(text.split()))
                if not self.kept.search(text) or key in seen:
                    continue
                seen.add(key)
                part = "develop" if self.develops(repository, path) else "bar"
                yield PublicFile(part, repository, commit, path, sha256_of(text))

    def read(self) -> list[PublicFile]:
        """Read the list."""
        with self.table.open(encoding="utf-8", newline="") as file:
            return [PublicFile(*row) for row in csv.reader(file, delimiter="\t")]

    def extract(self, snapshots: Path, folder: Path, part: str | None = None) -> Iterator[Path]:
        """Write the files of the list, or of one part, with what they refer to; yield their paths."""
        chosen = [each for each in self.read() if part in (None, each.part)]
        for repository, commit in dict.fromkeys((each.repository, each.commit) for each in chosen):
            snapshot, root = (at / repository.replace("/", "+") for at in (snapshots, folder))
            for name in _names(snapshot, commit):
                target = root / name
                if not name.lower().endswith(self.beside) or target.exists():
                    continue
                try:
                    data = snapshot_output(snapshot, "cat-file", "blob", f"{commit}:{name}")
                except subprocess.CalledProcessError:
                    continue  # A file that is too large for the snapshot.
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(data)
            # The folder of one repository, in which a file may name others.
            (root / ".git").mkdir(exist_ok=True)
        for each in chosen:
            path = folder / each.repository.replace("/", "+") / each.path
            if sha256_of(path.read_bytes().decode(errors="replace")) != each.digest:
                raise ValueError(f"{each.repository}/{each.path} is not the file of the list")
            yield path


@dataclass(frozen=True)
class Outcome:
    """How one file was read: a word, a reason, the difference from the oracle, and what the file holds."""

    path: str
    word: str
    reason: str = ""
    difference: float = 0.0
    joints: frozenset[str] = frozenset()


def summary(outcomes: Iterable[Outcome], counts: Callable[[Outcome], bool]) -> Iterator[str]:
    """Yield the counts, and what was refused or differs; `counts` says which files are to be read."""
    outcomes = list(outcomes)
    words = Counter(each.word for each in outcomes)
    yield ", ".join(f"{word}: {count}" for word, count in words.most_common())
    wanted = [each for each in outcomes if counts(each)]
    read = sum(each.word.startswith(("alike", "different", "read")) for each in wanted)
    if wanted:
        yield f"read: {read} of {len(wanted)} ({100.0 * read / len(wanted):.1f} %)"
    for each in sorted(outcomes, key=lambda each: (each.word, each.path)):
        if each.word != "alike":
            size = f" {each.difference:.2g}" if each.difference else ""
            yield f"{each.word}{size}: {each.path}: {each.reason}"


def survey(
    examine: Callable[[str], Outcome], paths: list[Path], jobs: int, seconds: float
) -> Iterator[Outcome]:
    """Examine the files in worker processes."""
    with Workers(examine, jobs, timeout=seconds) as workers:
        for outcome in workers.run([str(path) for path in paths]):
            path = str(paths[outcome.index])
            failure = outcome.failure
            yield (
                outcome.value
                if failure is None
                else Outcome(path, "not done", f"{failure.kind}: {failure.message}")
            )


def run(
    files: FormatFiles,
    examine: Callable[[str], Outcome],
    counts: Callable[[Outcome], bool],
    description: str,
    arguments: Iterable[str] | None = None,
) -> None:
    """Print the list, or the survey of its files."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("command", choices=["list", "run"])
    parser.add_argument("snapshots", type=Path, help="folder of Git directories OWNER+NAME")
    parser.add_argument("folder", type=Path, nargs="?", help="folder for the extracted files")
    parser.add_argument("--part", choices=("develop", "bar"))
    parser.add_argument("--jobs", type=int, default=2, help="number of worker processes")
    parser.add_argument("--seconds", type=float, default=60.0, help="time limit of one file [s]")
    options = parser.parse_args(None if arguments is None else list(arguments))
    if options.command == "list":
        writer = csv.writer(sys.stdout, delimiter="\t", lineterminator="\n")
        writer.writerows(astuple(each) for each in files.choose(options.snapshots))
        return
    if options.folder is None:
        parser.error("run needs a folder")
    paths = list(files.extract(options.snapshots, options.folder, options.part))
    for line in summary(survey(examine, paths, options.jobs, options.seconds), counts):
        print(line.replace(f"{options.folder}/", ""))


def is_odd(name: str) -> bool:
    """Check whether the SHA-256 of a name is odd, which divides files into halves."""
    return int(sha256_of(name), 16) % 2 == 1


def _names(snapshot: Path, commit: str) -> list[str]:
    names = snapshot_output(snapshot, "ls-tree", "-r", "-z", "--name-only", commit).decode(errors="replace")
    return [name for name in names.split("\0") if name]

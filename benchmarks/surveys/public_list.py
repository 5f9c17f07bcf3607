"""List of public robot descriptions for a survey, made before dynx opens one of them.

    python -m benchmarks.surveys.public_list list SNAPSHOTS > benchmarks/surveys/public_files.tsv
    python -m benchmarks.surveys.public_list extract SNAPSHOTS FOLDER [--part develop]

``public_search.txt`` records a search: the public repositories that hold a file ``urdf/WORD.urdf``, for each
word. SNAPSHOTS holds a Git directory ``OWNER+NAME`` of each repository; one that is missing is left out.

``list`` takes the repositories in the order of the SHA-256 of their lower-case names. It leaves out those
that ``docs/`` or ``tests/`` name. Of each it takes the first three files that end in ``.urdf``, in the order
of the SHA-256 of repository and path, until there are 150. It leaves out sources of xacro, texts without a
``<robot>``, pointers to large files, and files whose text (up to white space) or names of links and joints
are those of a file of example-robot-data, pybullet_data, dynx or the list. Malformed files stay. The first
half is to develop on, the second to measure.

The third part, ``unseen``, was added later: the next 50 files, by the same rule, from the repositories that
follow. A repository is in one part only.

``extract`` writes the files of the list, checked against their SHA-256, with meshes, textures and packages of
their repositories, and prints the paths.
"""

from __future__ import annotations

import argparse
import csv
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import astuple, dataclass
from hashlib import sha256
from pathlib import Path

from dynx.model.library import own_roots, robots

HERE = Path(__file__).parent
SEARCH, LIST = HERE / "public_search.txt", HERE / "public_files.tsv"

PARTS = {"develop": 0, "bar": 75, "unseen": 150}
"""Parts of the list, and the number of files in front of each; one repository is never divided."""

ENDS = (150, 200)
"""Numbers of files at which the list ended, at first and today; no repository reaches beyond them."""

PER_REPOSITORY = 3

_BESIDE = (".stl", ".dae", ".obj", ".mtl", ".glb", ".gltf", ".png", ".jpg", ".jpeg", ".tga", "/package.xml")
"""Endings of files, in lower case, that descriptions refer to."""

_NAME = re.compile(r"""<(link|joint)\s[^<>]*?\bname\s*=\s*["']([^"']*)["']""")


@dataclass(frozen=True)
class PublicFile:
    """One file of the list: its part, and the SHA-256 of its text."""

    part: str
    repository: str
    commit: str
    path: str
    digest: str


def searched() -> list[str]:
    """Repositories that the search found, in the order of the hashes of their names."""
    found = {repository for line in _lines(SEARCH) for repository in line.partition(":")[2].split()}
    return sorted(found, key=lambda repository: sha256_of(repository.lower()))


def files_of(snapshot: Path, repository: str) -> Iterator[tuple[str, str]]:
    """Yield path and text of the descriptions in a snapshot, in the order of their hashes."""
    names = (
        snapshot_output(snapshot, "ls-tree", "-r", "-z", "--name-only", "HEAD")
        .decode(errors="replace")
        .split("\0")
    )
    for path in sorted(
        (name for name in names if name.endswith(".urdf")), key=lambda name: sha256_of(f"{repository}/{name}")
    ):
        try:
            text = snapshot_output(snapshot, "cat-file", "blob", f"HEAD:{path}").decode(errors="replace")
        except subprocess.CalledProcessError:
            continue
        if "<robot" in text and "<xacro:" not in text and not text.startswith("version https://git-lfs"):
            yield path, text


def public_files(snapshots: Path) -> Iterator[PublicFile]:
    """Choose the files of the list."""
    named = "\n".join(_text(path).lower() for folder in ("docs", "tests") for path in _tracked(folder))
    seen = {key for path in _known_files() for key in _keys(_text(path))}
    count = 0
    for repository in searched():
        snapshot = snapshots / repository.replace("/", "+")
        if repository.lower() in named or not snapshot.is_dir():
            continue
        part = [name for name, before in PARTS.items() if count >= before][-1]
        taken = 0
        for path, text in files_of(snapshot, repository):
            keys = _keys(text)
            if not seen.isdisjoint(keys):
                continue
            seen |= keys
            commit = snapshot_output(snapshot, "rev-parse", "HEAD").decode().strip()
            yield PublicFile(part, repository, commit, path, sha256_of(text))
            taken, count = taken + 1, count + 1
            if taken == PER_REPOSITORY or count in ENDS:
                break
        if count == ENDS[-1]:
            return


def extract(snapshots: Path, folder: Path, part: str | None = None) -> Iterator[Path]:
    """Write the files of the list, or of one part, with what they refer to; yield their paths."""
    for each in read_list():
        if part not in (None, each.part):
            continue
        snapshot = snapshots / each.repository.replace("/", "+")
        names = snapshot_output(snapshot, "ls-tree", "-r", "-z", "--name-only", each.commit).decode(
            errors="replace"
        )
        beside = (name for name in names.split("\0") if f"/{name}".lower().endswith(_BESIDE))
        root = folder / each.repository.replace("/", "+")
        for name in (each.path, *beside):
            target = root / name
            if target.exists() or not target.resolve().is_relative_to(root.resolve()):
                continue
            try:
                data = snapshot_output(snapshot, "cat-file", "blob", f"{each.commit}:{name}")
            except subprocess.CalledProcessError:
                continue  # A file that is too large for the snapshot.
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(data)
        if sha256_of(_text(root / each.path)) != each.digest:
            raise ValueError(f"{each.repository}/{each.path} is not the file of the list")
        yield root / each.path


def read_list() -> list[PublicFile]:
    """Read the list."""
    rows = csv.reader(_lines(LIST), delimiter="\t")
    return [PublicFile(*row) for row in rows]


def _known_files() -> Iterator[Path]:
    import pybullet_data

    yield from (robot.path for robot in robots() if robot.path.suffix == ".urdf")
    for root in (Path(pybullet_data.getDataPath()), *own_roots()):
        yield from root.rglob("*.urdf")


def _keys(text: str) -> set[str]:
    """Return what two copies of one description share: the text up to white space, the names."""
    names = sorted(f"{tag} {name}" for tag, name in _NAME.findall(text))
    return {sha256_of("".join(text.split())), sha256_of("\n".join(names))}


def sha256_of(text: str) -> str:
    return sha256(text.encode(errors="replace")).hexdigest()


def _text(path: Path) -> str:
    return path.read_bytes().decode(errors="replace")


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


def _tracked(folder: str) -> list[Path]:
    root = HERE.parents[1]
    names = subprocess.run(
        ["git", "ls-files", "-z", folder], cwd=root, check=True, capture_output=True, text=True
    ).stdout
    return [root / name for name in names.split("\0") if name and not name.endswith(".png")]


def snapshot_output(snapshot: Path, *arguments: str) -> bytes:
    command = ["git", f"--git-dir={snapshot}", *arguments]
    return subprocess.run(command, check=True, capture_output=True).stdout


def main(arguments: Iterable[str] | None = None) -> None:
    """Print the list, or the paths of its extracted files."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("command", choices=["list", "extract"])
    parser.add_argument("snapshots", type=Path, help="folder of Git directories OWNER+NAME")
    parser.add_argument("folder", type=Path, nargs="?", help="folder for the extracted files")
    parser.add_argument("--part", choices=tuple(PARTS))
    options = parser.parse_args(None if arguments is None else list(arguments))
    if options.command == "list":
        writer = csv.writer(sys.stdout, delimiter="\t", lineterminator="\n")
        writer.writerows(astuple(each) for each in public_files(options.snapshots))
    elif options.folder is None:
        parser.error("extract needs a folder")
    else:
        for path in extract(options.snapshots, options.folder, options.part):
            print(path, flush=True)


if __name__ == "__main__":
    main()

"""The list of public files: its order, and what it leaves out."""

from __future__ import annotations

import subprocess
from collections import Counter
from hashlib import sha256
from pathlib import Path

import pytest

from benchmarks.surveys import public_list
from benchmarks.surveys.public_list import ENDS, PARTS, PER_REPOSITORY, read_list, searched
from tests.rules.documents import case_of, link


def test_the_list_is_in_the_order_of_hashes_and_names_no_repository_of_the_project() -> None:
    files = read_list()
    repositories = list(dict.fromkeys(each.repository for each in files))
    assert len(files) == ENDS[-1]
    assert max(Counter(each.repository for each in files).values()) <= PER_REPOSITORY
    assert repositories == [each for each in searched() if each in {*repositories}]
    assert len({(each.part, each.repository) for each in files}) == len(repositories)
    assert list(dict.fromkeys(each.part for each in files)) == list(PARTS)
    for part, before in PARTS.items():
        first = next(number for number, each in enumerate(files) if each.part == part)
        assert before <= first < before + PER_REPOSITORY
    root = Path(public_list.__file__).parents[2]
    pages = "\n".join(path.read_text(encoding="utf-8") for path in root.glob("docs/*.md")).lower()
    assert not [each for each in repositories if each.lower() in pages]


REPOSITORY = "/".join(("somebody", "arm"))
"""Name of a repository, in parts: one that a test names is left out."""


def snapshot(folder: Path, repository: str, files: dict[str, str]) -> None:
    """Commit files to a Git repository."""
    path = folder / repository.replace("/", "+")
    path.mkdir()
    for name, text in files.items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_text(text, encoding="utf-8")
    identity = ["-c", "user.name=a", "-c", "user.email=a@b.c"]
    for command in (["init", "-q"], ["add", "."], [*identity, "commit", "-q", "-m", "Files"]):
        subprocess.run(["git", *command], cwd=path, check=True)
    (path / ".git").rename(folder / "git")
    (path / ".worktree").mkdir()
    path.rename(folder / "tree")
    (folder / "git").rename(path)


def robot(name: str) -> str:
    """Write a robot of one link."""
    return case_of(link(name)).source.text


def test_copies_xacro_and_pointers_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = {f"urdf/{name}.urdf": robot(name) for name in ("one", "two", "three", "four")}
    files |= {
        "urdf/copy.urdf": robot("one") + "\n\n",
        "urdf/source.urdf": robot("five").replace("<link", "<xacro:part/><link", 1),
        "urdf/pointer.urdf": "version https://git-lfs.github.com/spec/v1\n<robot",
        "meshes/part.stl": "solid part",
    }
    snapshot(tmp_path, REPOSITORY, files)
    search = tmp_path / "search.txt"
    search.write_text(f"arm: {REPOSITORY} nobody/missing\n", encoding="utf-8")
    monkeypatch.setattr(public_list, "SEARCH", search)
    found = list(public_list.public_files(tmp_path))
    order = sorted(files, key=lambda path: sha256(f"{REPOSITORY}/{path}".encode()).hexdigest())
    usable = [
        path
        for path in order
        if path.endswith(("one.urdf", "two.urdf", "three.urdf", "four.urdf", "copy.urdf"))
    ]
    copies = {"urdf/one.urdf", "urdf/copy.urdf"}
    first = next(path for path in usable if path in copies)
    expected = [path for path in usable if path not in copies - {first}][:PER_REPOSITORY]
    assert [each.path for each in found] == expected
    rows = ["\t".join((each.part, each.repository, each.commit, each.path, each.digest)) for each in found]
    (tmp_path / "list.tsv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    monkeypatch.setattr(public_list, "LIST", tmp_path / "list.tsv")
    written = list(public_list.extract(tmp_path, tmp_path / "out"))
    assert [path.read_text(encoding="utf-8") for path in written] == [files[path] for path in expected]
    assert (tmp_path / "out/somebody+arm/meshes/part.stl").is_file()

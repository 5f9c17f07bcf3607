"""Packages of third parties: a module, and the metadata with entry points that an installer writes."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


def write_package(folder: Path, module: str, text: str, entry_points: str) -> Path:
    """Write a module and its metadata to a folder; return the file of the entry points."""
    (folder / f"{module}.py").write_text(text, encoding="utf-8")
    metadata = folder / f"{module}-1.0.dist-info"
    metadata.mkdir()
    project = module.replace("_", "-")
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project}\nVersion: 1.0\n")
    path = metadata / "entry_points.txt"
    path.write_text(entry_points, encoding="utf-8")
    return path


@contextmanager
def installed_package(folder: Path, module: str, text: str, entry_points: str) -> Iterator[Path]:
    """Put a folder with a package onto the import path of this process; yield the folder."""
    write_package(folder, module, text, entry_points)
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.syspath_prepend(str(folder))
        try:
            yield folder
        finally:
            sys.modules.pop(module, None)

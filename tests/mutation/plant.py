"""A pytest plugin that imports one module of dynx from other source than that on the disk.

``pytest -p tests.mutation.plant`` with DYNX_PLANT naming a JSON file ``{"module": ..., "source": ...}``.
It is a plugin, because pytest puts its own finder first as it starts, and that one reads the disk. A copy of
this file named ``sitecustomize.py`` does the same in every process of Python that has its folder in
PYTHONPATH.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import importlib.util
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from types import CodeType, ModuleType


class ChangedLoader(importlib.machinery.SourceFileLoader):
    """Loader that compiles the given source instead of the file's."""

    def __init__(self, fullname: str, path: str, source: str) -> None:
        super().__init__(fullname, path)
        self.source = source

    def get_code(self, fullname: str) -> CodeType:
        return compile(self.source, self.path, "exec", dont_inherit=True)


class ChangedFinder(importlib.abc.MetaPathFinder):
    """Finder of the one module that is changed, searched before the ordinary finders."""

    def __init__(self, module: str, source: str) -> None:
        self.module = module
        self.source = source

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != self.module:
            return None
        found = importlib.machinery.PathFinder.find_spec(fullname, path)
        if found is None or found.origin is None:
            raise ImportError(f"no module {fullname} to change")
        loader = ChangedLoader(fullname, found.origin, self.source)
        return importlib.util.spec_from_file_location(fullname, found.origin, loader=loader)


def plant(module: str, source: str) -> None:
    """Change the module for every later import; raise RuntimeError if it is imported already."""
    if module in sys.modules:
        raise RuntimeError(f"{module} is imported already; the change would have no effect")
    sys.meta_path.insert(0, ChangedFinder(module, source))


if os.environ.get("DYNX_PLANT"):
    plant(**json.loads(Path(os.environ["DYNX_PLANT"]).read_text(encoding="utf-8")))

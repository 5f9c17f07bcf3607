"""A pytest plugin that plants one fault into the source of dynx as it is imported.

``pytest -p tests.faults.plant`` with DYNX_FAULT naming an entry of the catalogue. The file on disk is
not touched: the module's source is changed on its way into the interpreter.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import importlib.util
import os
import sys
from collections.abc import Sequence
from types import CodeType, ModuleType

from tests.faults.catalogue import FAULTS
from tests.faults.fault import Fault


class FaultyLoader(importlib.machinery.SourceFileLoader):
    """Loads a module with one piece of its text replaced."""

    def __init__(self, fullname: str, path: str, fault: Fault) -> None:
        super().__init__(fullname, path)
        self.fault = fault

    def get_code(self, fullname: str) -> CodeType:
        with open(self.path, encoding="utf-8") as file:
            source = file.read()
        return compile(self.fault.planted(source), self.path, "exec", dont_inherit=True)


class FaultyFinder(importlib.abc.MetaPathFinder):
    """Finds the one module that the fault changes, before the ordinary finders do."""

    def __init__(self, fault: Fault) -> None:
        self.fault = fault

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname != self.fault.module:
            return None
        found = importlib.machinery.PathFinder.find_spec(fullname, path)
        if found is None or found.origin is None:
            raise ImportError(f"no module {fullname} to plant a fault in")
        loader = FaultyLoader(fullname, found.origin, self.fault)
        return importlib.util.spec_from_file_location(fullname, found.origin, loader=loader)


def plant(name: str) -> None:
    """Put the fault of that name before everything that imports dynx."""
    fault = next(fault for fault in FAULTS if fault.name == name)
    if fault.module in sys.modules:
        raise RuntimeError(f"{fault.module} is imported already; the fault would not be seen")
    sys.meta_path.insert(0, FaultyFinder(fault))


if os.environ.get("DYNX_FAULT"):
    plant(os.environ["DYNX_FAULT"])

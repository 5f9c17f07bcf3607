"""SARIF 2.1.0 (OASIS standard), which code hosts show as annotations of the lines of a file.

Fingerprints do not contain the line, so that a finding stays the same when text is inserted above it. Code
hosts need a line for every result, a description and a help text for every rule, and paths relative to the
repository.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Sequence
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote

from dynx._version import __version__
from dynx.errors import escaped

SCHEMA_URI = "https://json.schemastore.org/sarif-2.1.0.json"

IGNORED = "the rule is ignored"
"""Justification of a suppressed result whose rule the user ignores."""

KNOWN = "in the baseline"
"""Justification of a suppressed result that a baseline accepts."""

MAX_RESULTS = 25_000
"""Largest number of results; GitHub rejects a run with more."""

MAX_DESCRIPTION = 1000
"""Largest number of characters of the description of a rule; GitHub reads 1024."""

ROOT_ID = "%SRCROOT%"
"""Name of the folder to which paths are relative."""

NAME_LENGTH = 120
"""Number of characters of a name that are written."""

LEVELS = ("note", "warning", "error")
"""Levels of results, the least severe first."""

FINGERPRINT = "dynxFinding/v1"


def sarif_run(
    rules: Sequence[dict[str, Any]],
    results: Iterable[dict[str, Any]],
    notes: Sequence[str] = (),
    notifications: Sequence[dict[str, Any]] = (),
    *,
    successful: bool = True,
    category: str | None = None,
) -> dict[str, Any]:
    """Make the document of one run. Of results with one fingerprint the most severe remains.

    `notes` are warnings about the run, `notifications` other ones. A code host keeps the results of runs of
    different `category` apart.
    """
    merged: dict[str, dict[str, Any]] = {}
    for result in results:
        key = result["partialFingerprints"][FINGERPRINT]
        old = merged.get(key)
        if old is None or _severity(result) > _severity(old):
            merged[key] = result
    numbers = {rule["id"]: number for number, rule in enumerate(rules)}
    kept = [{**result, "ruleIndex": numbers[result["ruleId"]]} for result in merged.values()]
    warnings = list(notes)
    if len(kept) > MAX_RESULTS:
        warnings.append(f"{len(kept) - MAX_RESULTS} of {len(kept)} results were left out")
        kept = sorted(kept, key=_severity, reverse=True)[:MAX_RESULTS]
    said = [{"level": "warning", "message": {"text": note}} for note in warnings]
    invocation = {"executionSuccessful": successful, "toolExecutionNotifications": [*said, *notifications]}
    details = {} if category is None else {"automationDetails": {"id": category}}
    root = os.path.join(_root(), "")
    return {
        "$schema": SCHEMA_URI,
        "version": "2.1.0",
        "runs": [
            {
                "tool": {"driver": {"name": "dynx", "semanticVersion": __version__, "rules": [*rules]}},
                **details,
                "columnKind": "unicodeCodePoints",
                "originalUriBaseIds": {ROOT_ID: {"uri": f"{Path(root).as_uri()}/"}},
                "invocations": [invocation],
                "results": kept,
            }
        ],
    }


def sarif_result(
    path: str, rule: str, level: str, message: str, line: int | None, *identity: str | None
) -> dict[str, Any]:
    """Make a result at a line of a file. `identity` tells it from others of its rule in that file."""
    place = physical_location(path, line)
    parts = [place["artifactLocation"]["uri"], rule, *identity]
    joined = "\0".join("" if part is None else f"={part}" for part in parts)
    digest = hashlib.sha256(joined.encode("utf-8", "backslashreplace")).hexdigest()[:32]
    return {
        "ruleId": rule,
        "level": level,
        "message": {"text": message},
        "locations": [{"physicalLocation": place}],
        "partialFingerprints": {FINGERPRINT: digest},
    }


def sarif_rule(identity: str, name: str, text: str) -> dict[str, Any]:
    """Make a rule, described by one text."""
    described = {"text": text[:MAX_DESCRIPTION] or escaped(identity, NAME_LENGTH)}
    return {
        "id": escaped(identity, NAME_LENGTH),
        "name": escaped(name, NAME_LENGTH),
        "shortDescription": described,
        "fullDescription": described,
        "help": described,
    }


def suppression(reason: str | None) -> list[dict[str, str]]:
    """Return what marks a result as accepted for a reason; the list is empty where there is none."""
    return [] if reason is None else [{"kind": "external", "justification": reason}]


def physical_location(path: str, line: int | None) -> dict[str, Any]:
    """Return a line of a file, and line 1 where it is not known."""
    location = artifact_location(path)
    if location["uri"].endswith(".xacro"):
        line = None  # Lines are those of the URDF that it expands to.
    return {"artifactLocation": location, "region": {"startLine": max(line or 1, 1)}}


def artifact_location(path: str) -> dict[str, str]:
    """Return the location of a file, relative to the root where it is below that."""
    if not os.path.isabs(path) and not os.path.exists(path):
        return {"uri": quote(escaped(path, NAME_LENGTH)), "uriBaseId": ROOT_ID}
    absolute = os.path.abspath(path)
    try:
        relative = PurePath(os.path.relpath(absolute, _root())).as_posix()
    except ValueError:  # another drive
        return {"uri": Path(absolute).as_uri()}
    if relative.startswith("../"):
        return {"uri": Path(absolute).as_uri()}
    # A name of a file may hold bytes that are no text.
    return {"uri": quote(os.fsencode(relative)), "uriBaseId": ROOT_ID}


def _severity(result: dict[str, Any]) -> int:
    return LEVELS.index(result["level"])


def _root() -> str:
    """Return the repository of the working directory, or that directory."""
    folder = Path.cwd()
    return str(next((each for each in (folder, *folder.parents) if (each / ".git").exists()), folder))

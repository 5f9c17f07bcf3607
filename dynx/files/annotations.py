"""Workflow commands of GitHub Actions: findings at their lines in a pull request, without an upload.

A command is a line of the log such as ``::error file=a.urdf,line=8,title=DX101::message``. GitHub shows ten
errors, ten warnings and ten notices of a step, so the most severe come first.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any
from urllib.parse import unquote

from dynx.files.sarif import IGNORED

_COMMANDS = {"error": "error", "warning": "warning", "note": "notice"}


def github_annotations(sarif: Mapping[str, Any]) -> list[str]:
    """Return GitHub's command that shows each result of a SARIF document (`sarif_run`), except those in the
    baseline.

    The findings of ignored rules are counted in one notice.
    """
    (run,) = sarif["runs"]
    names = {rule["id"]: rule["name"] for rule in run["tool"]["driver"]["rules"]}
    found = [each for each in run["results"] if not each.get("suppressions")]
    found.sort(key=lambda each: list(_COMMANDS).index(each["level"]))
    return [_annotation(each, names[each["ruleId"]]) for each in found] + _count_of_ignored(run, names)


def _count_of_ignored(run: Mapping[str, Any], names: Mapping[str, str]) -> list[str]:
    reasons = ((each["ruleId"], each.get("suppressions") or [{}]) for each in run["results"])
    counts = Counter(rule for rule, (reason, *_) in reasons if reason.get("justification") == IGNORED)
    rules = ", ".join(f"{rule} {names[rule]} ({count})" for rule, count in sorted(counts.items()))
    total = f"{counts.total()} finding{'s' * (counts.total() != 1)} ignored"
    return [f"::notice title={total}::{_escaped(rules)}"] if counts else []


def _annotation(result: Mapping[str, Any], name: str) -> str:
    place = result["locations"][0]["physicalLocation"]
    rule = result["ruleId"]
    properties = {
        "file": unquote(place["artifactLocation"]["uri"]),
        "line": str(place["region"]["startLine"]),
        "title": rule if name == rule else f"{rule} {name}",
    }
    written = ",".join(f"{key}={_escaped_property(value)}" for key, value in properties.items())
    return f"::{_COMMANDS[result['level']]} {written}::{_escaped(result['message']['text'])}"


def _escaped(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _escaped_property(text: str) -> str:
    return _escaped(text).replace(":", "%3A").replace(",", "%2C")

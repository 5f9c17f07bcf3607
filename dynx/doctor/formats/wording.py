"""Wording of errors, quantities, places and values, the same in every format."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import PurePath
from typing import Any

from dynx.doctor.report import (
    Change,
    DoctorReport,
    Effect,
    EngineResult,
    Finding,
    Unexplained,
    UnreadMesh,
    VariantResult,
)
from dynx.errors import escaped
from dynx.rules.registry import all_rules

NAME_LENGTH = 120
"""Number of characters of a name that are shown; a description may hold names of any length."""

CALLS = {
    "calls after loading, for what no URDF can express": False,
    "to compare engines (not to simulate)": True,
}
"""Titles of the calls after loading, by `RunTimeCall.comparison`."""

LEFT_OUT = (
    "was not examined, as it is in xacro, whose expansion runs code of the file: name it if you trust it"
)
"""What became of a robot in xacro below a directory."""

SHAPE_RULES = "DX501 to DX503, DX517"
"""Rules that compare mass and inertia of a link with the size of its shapes."""

_MAX_PARTS = 8
"""Number of changed elements that are listed; the JSON document has all."""

_PERCENT = 1e-3
"""Smallest relative error that is written in per cent."""

_DIGITS = (4, 6, 9, 12, 15, 17)
"""Numbers of significant digits that are tried, the fewest first, until different values look different."""


def name(text: object, limit: int = NAME_LENGTH) -> str:
    """Write a name in one line without control characters, shortened where it is very long."""
    return escaped(text, limit)


def message(text: object, limit: int = 1000) -> str:
    """Write a message, in which names are escaped already, in one line without control characters."""
    line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in str(text))
    ending = f"... ({len(line)} characters)"
    return line if len(line) <= limit else line[: limit - len(ending)] + ending


def quantity(key: str) -> str:
    """Write ``mass_matrix`` as ``mass matrix``."""
    return name(key.replace("_", " "))


def ignored(*reports: DoctorReport) -> str:
    """Count the findings of the rules that the user ignores, by rule: ``2 findings ignored: DX105
    inertia-not-diagonal (2)``; empty without any."""
    counts: Counter[str] = Counter()
    for report in reports:
        counts.update(report.ignored)
    names = {each.rule: each.name for report in reports for each in report.findings}
    rules = ", ".join(f"{name(rule)} {name(names[rule])} ({count})" for rule, count in sorted(counts.items()))
    total = counts.total()
    return f"{total} finding{'s' * (total != 1)} ignored: {rules}" if counts else ""


def relative(error: float) -> str:
    """Write a relative error in two digits as a power of ten; ``no value`` where it is not finite."""
    if not math.isfinite(error):
        return "no value"
    return "0" if error == 0.0 else f"{error:.1e}"


def size(error: float) -> str:
    """Write a relative error in per cent from 1e-3 to below 1e4, otherwise as a power of ten: ``1900 %``,
    ``6e-06``; ``no value`` where it is not finite."""
    if not math.isfinite(error):
        return "no value"
    if error < _PERCENT or error >= 1e4:
        return "0" if error == 0.0 else f"{error:.0e}"
    percent = 100.0 * error
    return f"{percent:.2g} %" if percent < 99.5 else f"{percent:.0f} %"


def effect(each: Effect | None) -> str:
    """Write ``mass matrix off by 1900 %``, ``the file is refused``, or that a cause changes nothing."""
    if each is None:
        return "no effect on this base"
    if _only_present(each):
        return f"{quantity(each.quantity)} present"
    if not math.isfinite(each.relative_error):
        return "the file is refused" if each.quantity == "loading" else f"no valid {quantity(each.quantity)}"
    return f"{quantity(each.quantity)} off by {size(each.relative_error)}"


def finding_effect(finding: Finding) -> str:
    """Write the effect of a finding, by engine where it differs, or that it is bad practice."""
    if differs_by_engine(finding):
        return effects(finding)
    return "bad practice" if finding.kind == "practice" and not finding.effect else effect(finding.effect)


def differs_by_engine(finding: Finding) -> bool:
    """Check whether the effect at a place differs between engines, as it is written."""
    return finding.effect is not None and len(set(map(_at_place, finding.effects.values()))) > 1


def effects(finding: Finding) -> str:
    """Write the effect at a place, by engine where it differs: ``54 % in pybullet, refused by mujoco``."""
    if finding.effect is None:
        return ""
    by_size: dict[str, list[str]] = {}
    for engine, each in finding.effects.items():
        by_size.setdefault(_at_place(each), []).append(name(engine))
    if len(by_size) < 2:
        return _at_place(finding.effect).removesuffix(" by").removesuffix(" in")
    return ", ".join(f"{text} {' and '.join(engines)}" for text, engines in by_size.items())


def _at_place(each: Effect) -> str:
    if math.isfinite(each.relative_error):
        return f"{size(each.relative_error)} in"
    if _only_present(each):
        return f"{quantity(each.quantity)} in"
    return "refused by" if each.quantity == "loading" else f"no valid {quantity(each.quantity)} in"


def _only_present(each: Effect) -> bool:
    """Check whether an effect is only said to be present, whatever its size."""
    return any(each.quantity == rule.present_as for rule in all_rules())


def difference(key: str, error: float) -> str:
    """Write an error of one engine: ``mass matrix off by 6e-06``, ``no valid mass matrix``; ``refused`` for
    the quantity ``loading``, whatever the error."""
    return "refused" if key == "loading" else effect(Effect(key, error))


def unexplained(each: Unexplained) -> str:
    """Write a difference without an explanation as a clause with the engine as its subject."""
    if each.quantity == "loading":
        return f"{name(each.engine)} refuses the file, also without the causes that are known"
    if each.quantity == "result":
        return f"{name(each.engine)} is not used on the file, also without the causes that are known"
    if not math.isfinite(each.relative_error):
        return f"{name(each.engine)} returns no valid {quantity(each.quantity)}"
    where = "" if each.joint is None else f", most at joint {name(each.joint)}"
    return f"{quantity(each.quantity)} of {name(each.engine)} is off by {size(each.relative_error)}{where}"


def refusal(each: EngineResult, *, mended: bool = False) -> str:
    """Write why an engine has no results on the file, or on the mended one."""
    if mended:
        refused = each.refused_after is not None
        start = "refuses the mended file too" if refused else "not used on the mended file either"
        return f"{start}: {_message(each.no_results_after)}"
    return f"{'not used' if each.refused is None else 'refuses the file'}: {_message(each.no_results)}"


def _message(error: str | None) -> str:
    """Return the message of an engine without the name of the file that it was given."""
    return message(re.sub(r"^[a-z]+ refuses robot\.urdf: (Error: )?", "", error or ""))


def step_defaults(each: EngineResult) -> str:
    """Write what a step of an engine does by itself; the code that switches it off follows."""
    return f"not compared: a step of the engine {' and '.join(each.step_defaults)}, unless you write"


def variant(each: VariantResult) -> list[str]:
    """Write what a loading variant changes, by its causes where they are known."""
    if each.no_results is not None:
        return [refusal(each)]
    if not each.findings:
        key = max(each.before, key=lambda key: each.before[key])
        return [difference(key, each.before[key])]
    lines = []
    for cause in each.findings:
        proof = "proved" if cause.proved else "not proved"
        rule = f"{name(cause.rule)} {name(cause.name)}, {proof}"
        lines.append(f"{effect(cause.effect)}: {rule}; {message(cause.message, 300)}")
    return lines


def unread_meshes(report: DoctorReport) -> str:
    """Write how many meshes were not read, the commonest reason and its consequence; empty for none."""
    unread = report.unread_meshes
    if not unread:
        return ""
    kinds = Counter(map(_kind_of_reason, unread))
    (kind, count), *others = kinds.most_common()
    first = next(each for each in unread if _kind_of_reason(each) == kind)
    shown = message(first.reason, 300)
    if count > 1 and any(each.reason != first.reason for each in unread if _kind_of_reason(each) == kind):
        shown += f"; likewise {count - 1} more"
    if others:
        shown += f"; {len(unread) - count} for other reasons"
    which = f"{len(unread)} of {report.meshes} mesh files" if report.meshes > 1 else "the mesh file"
    without = refused_without_mesh(report.refused_without_meshes)
    if report.format != "urdf":
        them = "it" if len(unread) == 1 else "them"
        return f"{which} could not be found ({shown}); engines are compared without {them}{without}"
    return (
        f"{which} could not be read ({shown}); engines are compared without meshes, but masses and inertias "
        f"of such links are not checked against the size of their shapes ({SHAPE_RULES}){without}"
    )


def _kind_of_reason(mesh: UnreadMesh) -> str:
    """Return the reason why a mesh was not read, without names and advice."""
    return re.sub("'[^']*'", "''", mesh.reason.partition(";")[0])


def refused_without_mesh(engines: Sequence[str]) -> str:
    """Write which engines refuse a description for a missing mesh, as a further clause; empty for none."""
    verb = "refuses" if len(engines) == 1 else "refuse"
    return f"; {' and '.join(map(name, engines))} {verb} a file of which a mesh is missing" if engines else ""


def loads_mended(each: EngineResult, report: DoctorReport) -> str:
    """Write that an engine loads the mended file, with the condition that it finds the meshes."""
    once = " once its meshes are there" if each.engine in report.refused_without_meshes else ""
    return f"loads the mended file{once}"


def change(each: Change) -> str:
    """Write ``DX103 (rounding): merged ...; link foot, link leg``, listing some of many elements."""
    parts = [f"link {link}" for link in each.links] + [f"joint {joint}" for joint in each.joints]
    parts += each.others
    shown = [name(part) for part in parts[:_MAX_PARTS]]
    more = [f"{len(parts) - _MAX_PARTS} more"] if len(parts) > _MAX_PARTS else []
    where = f"; {', '.join([*shown, *more])}" if shown else ""
    return f"{name(each.rule)} ({each.level}): {name(each.change, 1000)}{where}"


def titles(robots: Sequence[str]) -> list[str]:
    """Name robots for titles: paths by their file names, where these differ."""
    stems = [PurePath(robot).name.removesuffix(".urdf") or robot for robot in robots]
    owners: dict[str, set[str]] = {}
    for stem, robot in zip(stems, robots, strict=True):
        owners.setdefault(stem, set()).add(robot)
    return [
        name(stem if len(owners[stem]) == 1 else robot, 200)
        for stem, robot in zip(stems, robots, strict=True)
    ]


def part(finding: Finding) -> str:
    """Name the part of a finding: ``link tool0``, ``joint elbow``, or ``robot``."""
    if finding.link is not None:
        return f"link {name(finding.link)}"
    if finding.joint is not None:
        return f"joint {name(finding.joint)}"
    return "robot"


def values(several: Sequence[Any]) -> list[str]:
    """Write values of one property in the fewest digits of `_DIGITS` in which all different values look
    different; with 17 digits where none does (1 and 1.0).

    A value is a number, a text, None or a nested list of them.
    """
    distinct = {repr(each) for each in several}
    for digits in _DIGITS[:-1]:
        texts = [_value(each, digits) for each in several]
        if len(set(texts)) == len(distinct):
            return texts
    return [_value(each, _DIGITS[-1]) for each in several]


def _value(value: Any, digits: int) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool) or not isinstance(value, int | float | list | tuple):
        return name(value)
    if isinstance(value, list | tuple):
        inside = ("; " if value and isinstance(value[0], list | tuple) else ", ").join(
            _value(each, digits) for each in value
        )
        return f"[{inside}]"
    return "0" if value == 0 else f"{value:.{digits}g}"


def value(given: Any) -> str:
    """Write a value of a model: a number, numbers, a word, or that there is none."""
    if given is None:
        return "none"
    if isinstance(given, bool):
        return "there" if given else "not there"
    if isinstance(given, list | tuple):
        return f"[{', '.join(map(value, given))}]"
    return f"{given:.6g}" if isinstance(given, int | float) else name(str(given))

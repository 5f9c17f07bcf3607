"""Settings of engines from ``--set name=value``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.steppers.registry import world_class
from dynx.steppers.settings import Setting

WORDS = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}
"""Words for truth values of settings."""


def settings_by_engine(
    engines: Sequence[str], given: Sequence[tuple[str, str]], options: Mapping[str, Setting] | None = None
) -> dict[str, dict[str, Any]]:
    """Return the settings of each engine from ``name=value`` and ``engine.name=value``, which has precedence.

    `options` are settings that every engine has besides its own. Raises UnknownNameError for a setting that
    no engine has, ArgumentError for one that is given twice or has a value of another type.
    """
    known: dict[str, Mapping[str, Setting]] = {
        name: {**world_class(name).settings, **(options or {})} for name in engines
    }
    found: dict[str, dict[str, Any]] = {name: {} for name in engines}
    names = [name for name, _ in given]
    for full in names:
        if names.count(full) > 1:
            raise ArgumentError(f"--set {shown(full)} is given twice")
    for full, text in sorted(given, key=lambda each: "." in each[0]):
        engine, dot, name = full.rpartition(".")
        if dot and engine not in known:
            raise UnknownNameError(
                f"--set {shown(full)}: {shown(engine)} does not run{nearest(engine, known)}"
            )
        having = [each for each in ([engine] if dot else engines) if name in known[each]]
        if not having:
            names = sorted({each for settings in known.values() for each in settings})
            raise UnknownNameError(
                f"--set {shown(full)}: no such setting of {', '.join([engine] if dot else engines)}"
                f"{nearest(name, names)}"
            )
        for each in having:
            found[each][name] = _value(known[each][name], full, text)
    return found


def _value(setting: Setting, name: str, text: str) -> Any:
    """Return the text as a value of the type of the setting."""
    if isinstance(setting.default, bool):
        if text.lower() not in WORDS:
            raise ArgumentError(f"--set {name}={text}: wanted true or false")
        return WORDS[text.lower()]
    if isinstance(setting.default, str):
        return text
    try:
        if isinstance(setting.default, tuple):
            return [float(word) for word in text.replace(",", " ").split()]
        return int(text) if isinstance(setting.default, int) else float(text)
    except ValueError:
        kind = "a whole number" if isinstance(setting.default, int) else "a number"
        raise ArgumentError(f"--set {name}={text}: wanted {kind}") from None

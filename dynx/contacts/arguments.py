"""Checks of the arguments of `conform`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dynx.contacts.candidates import SUBSTEPS
from dynx.contacts.case import Case
from dynx.contacts.registry import BUILT_IN, find_case, find_cases
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model.numbers import positive_seconds, whole_number
from dynx.steppers.registry import installed_worlds, world_class
from dynx.steppers.settings import checked_settings

MIN_STEP, MAX_STEP = 1e-6, 0.1
"""Smallest and largest step [s]: runs at shorter steps take hours, and in longer ones bodies never touch."""

MAX_SUBSTEPS = 500


def checked_engines(engines: Sequence[str] | None) -> tuple[str, ...]:
    """Return the engines, or all that are installed, each once."""
    if engines is None:
        return installed_worlds()
    _check_is_list("engines", engines, "names")
    return tuple(dict.fromkeys(engines))


def checked_given(
    engines: Sequence[str], settings: Mapping[str, Mapping[str, Any]]
) -> dict[str, dict[str, Any]]:
    """Return the settings given to each engine, `substeps` of the world among them, after a check that the
    engine is installed and has them."""
    if not isinstance(settings, Mapping):
        raise ArgumentError(
            f"settings is of type {type(settings).__name__}; wanted a dict such as "
            "{'mujoco': {'impratio': 1000.0}}"
        )
    for name, given in settings.items():
        if name not in engines:
            raise UnknownNameError(
                f"settings are given for {shown(name)}, which does not run{nearest(str(name), engines)}"
            )
        if not isinstance(given, Mapping):
            raise ArgumentError(f"settings of {name} is of type {type(given).__name__}; wanted a dict")
    for name in engines:
        kind = world_class(name)
        kind.require_engine()
        given = dict(settings.get(name, {}))
        if SUBSTEPS in given:
            whole_number(SUBSTEPS, given.pop(SUBSTEPS), 1, MAX_SUBSTEPS)
        checked_settings(name, kind.settings, given)
    return {name: dict(settings.get(name, {})) for name in engines}


def values_in_effect(
    engine: str, given: Mapping[str, Any], steps: Sequence[float]
) -> dict[str, tuple[float, ...]]:
    """Return the values at each step of those settings given that the engine changes."""
    kind, substeps = world_class(engine), given.get(SUBSTEPS, 1)
    in_use = {name: setting.default for name, setting in kind.settings.items()} | dict(given)
    found = [kind.settings_in_effect(in_use, dt / substeps) for dt in steps]
    return {
        name: tuple(float(each[name]) for each in found)
        for name, value in given.items()
        if name in found[0] and any(each[name] != value for each in found)
    }


def checked_steps(steps: Sequence[float]) -> tuple[float, ...]:
    """Return the steps [s], the largest first, each once."""
    _check_is_list("steps", steps, "steps [s]")
    sizes = sorted({positive_seconds("a step", step) for step in steps}, reverse=True)
    if not sizes:
        raise ArgumentError("steps is empty; wanted at least one step [s]")
    for size in sizes:
        if not MIN_STEP <= size <= MAX_STEP:
            raise ArgumentError(f"a step is {size:g} s; wanted {MIN_STEP:g} to {MAX_STEP:g} s")
    return tuple(sizes)


def checked_cases(cases: Sequence[str | Case] | None) -> tuple[Case, ...]:
    """Return the cases, found by name where they are names; all where none are given."""
    if cases is None:
        found = find_cases()
    else:
        _check_is_list("cases", cases, "names and cases")
        found = tuple(find_case(each) if isinstance(each, str) else _checked_case(each) for each in cases)
    for number, each in enumerate(found):
        _check_attributes(each)
        if each.name in [other.name for other in found[:number]]:
            raise ArgumentError(f"two cases have the name {shown(each.name)}")
    return found


def _check_is_list(name: str, value: object, what: str) -> None:
    """Raise ArgumentError for a text, and for anything that is neither a sequence nor a set."""
    if isinstance(value, str) or not isinstance(value, Sequence | set | frozenset):
        text = shown(value) if isinstance(value, str | int | float) else f"of type {type(value).__name__}"
        raise ArgumentError(f"{name} is {text}; wanted a list of {what}")


def _checked_case(case: object) -> Case:
    if isinstance(case, type) and issubclass(case, Case):
        raise ArgumentError(f"a case is the class {case.__name__}; wanted an instance, {case.__name__}()")
    if not isinstance(case, Case):
        raise ArgumentError(f"a case is of type {type(case).__name__}; wanted a Case or the name of one")
    return case


def _check_attributes(case: Case) -> None:
    """Raise ArgumentError for a case whose attributes cannot be used."""
    kind = type(case)
    where = f"{kind.__module__}.{kind.__qualname__}"
    for attribute in ("name", "title", "law", "source"):
        text = getattr(case, attribute, None)
        if not isinstance(text, str) or not text.strip():
            raise ArgumentError(f"the case {where} has no {attribute}; wanted a text that is not empty")
    trials = case.trials
    if not isinstance(trials, Mapping) or not trials or not all(isinstance(each, str) for each in trials):
        raise ArgumentError(f"trials of the case {where} is not a dict of parameters by name")
    if kind.__module__ == "__main__":
        raise ArgumentError(
            f"the case {shown(case.name)} is defined in the program that runs; it has to be in a module "
            "of its own, which worker processes import"
        )
    if case.name in BUILT_IN and not isinstance(case, type(find_case(case.name))):
        raise ArgumentError(f"the case {where} has the name {shown(case.name)}, which is one of dynx's own")

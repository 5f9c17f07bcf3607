"""Settings of an engine's solver and contacts, by name, with their defaults and valid values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, UnknownNameError, shown
from dynx.model.numbers import checked_array, is_real, is_whole
from dynx.option_names import right_name


@dataclass(frozen=True)
class Setting:
    """One setting: a number in a range, a whole number, a truth value, a choice or a list of numbers.

    The type of `default` decides: float, int, bool, str (one of `choices`) or a tuple of floats.
    """

    default: Any
    meaning: str
    """Noun phrase for the documentation."""
    least: float = 0.0
    most: float = np.inf
    choices: tuple[str, ...] = ()
    needs: tuple[str, tuple[str | bool, ...]] | None = None
    """Setting, and the values of it with which this one has an effect; None for any."""

    def checked(self, name: str, value: object) -> Any:
        """Return the value in the type of the default. Raises ArgumentError for any other."""
        if isinstance(self.default, bool):
            if isinstance(value, bool | np.bool_):
                return bool(value)
            raise ArgumentError(f"setting {name} is {shown(value)}; wanted True or False")
        if isinstance(self.default, str):
            if isinstance(value, str) and value in self.choices:
                return value
            raise ArgumentError(f"setting {name} is {shown(value)}; wanted one of {', '.join(self.choices)}")
        if isinstance(self.default, tuple):
            numbers = checked_array(f"setting {name}", cast(ArrayLike, value), len(self.default))
            if numbers.ndim != 1:
                raise ArgumentError(f"setting {name} is {shown(value)}; wanted {len(self.default)} numbers")
            for number in numbers.tolist():
                self._bounded(name, number)
            return tuple(numbers.tolist())
        if isinstance(self.default, int):
            if not is_whole(value):
                raise ArgumentError(f"setting {name} is {shown(value)}; wanted a whole number")
            return int(self._bounded(name, int(value)))
        if not is_real(value):
            raise ArgumentError(f"setting {name} is {shown(value)}; wanted a number")
        return float(self._bounded(name, float(value)))

    def _bounded(self, name: str, number: float) -> float:
        if not (self.least <= number <= self.most and np.isfinite(number)):
            ends = f"at least {self.least:g}" if self.most == np.inf else f"{self.least:g} to {self.most:g}"
            raise ArgumentError(f"setting {name} is {number:g}; wanted {ends}")
        return number


def checked_settings(
    engine: str, known: Mapping[str, Setting], given: Mapping[str, object], options: Iterable[str] = ()
) -> dict[str, Any]:
    """Return a value for every setting of an engine: the given one, or the default. `options` are the other
    arguments of the call, one of which may be meant.

    Raises UnknownNameError for a setting that the engine does not have, ArgumentError for an invalid value.
    """
    for name in given:
        if name not in known:
            if name == "settings":
                raise UnknownNameError(
                    "settings of an engine are given by their names, such as "
                    f"{next(iter(known), 'name')}=..., or as **settings"
                )
            near = right_name(name, dict.fromkeys([*known, *options]))
            raise UnknownNameError(f"the engine {shown(engine)} has no setting {shown(name)}{near}")
    return {
        name: setting.checked(name, given[name]) if name in given else setting.default
        for name, setting in known.items()
    }


def changed_settings(
    given: Mapping[str, Any], in_use: Mapping[str, Any], in_effect: Mapping[str, Any]
) -> Iterator[str]:
    """Yield a sentence for each setting given of which the engine has another value in effect."""
    for name in given:
        if name in in_effect and in_effect[name] != in_use[name]:
            yield (
                f"setting {name} is {in_use[name]:g}, but {in_effect[name]:g} in effect: the least with "
                "steps of this length"
            )


def ineffective_settings(known: Mapping[str, Setting], in_use: Mapping[str, Any]) -> Iterator[str]:
    """Yield a sentence for each setting that was changed from its default and has no effect."""
    for name, setting in known.items():
        value = in_use[name]
        if value == setting.default:
            continue
        if setting.needs is not None and in_use[setting.needs[0]] not in setting.needs[1]:
            other, values = setting.needs
            yield (
                f"setting {name} is {value}, and has no effect with {other}={in_use[other]!r}; it has one "
                f"with {' or '.join(map(repr, values))}"
            )


def checked_switches(**switches: object) -> dict[str, bool]:
    """Return switches of a world by name; ArgumentError for one that is neither True nor False."""
    checked = {}
    for name, value in switches.items():
        if not isinstance(value, bool):
            raise ArgumentError(f"{name} is {shown(value)}; wanted True or False")
        checked[name] = value
    return checked

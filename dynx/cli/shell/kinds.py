"""Options of a simulation on the command line: a click option for each declaration, by its kind.

`COMMAND_KINDS` maps each kind of `dynx.sim.scenario.options` to the type and the placeholder of click.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import click

from dynx.cli.shell.options import (
    PAYLOAD_FORM,
    PAYLOAD_NOTE,
    F,
    configuration_text,
    finite_number,
    group,
    number_list,
    one_of,
    payload,
    plain_numbers,
    spelled,
    stacked,
    wrench_numbers,
)
from dynx.errors import shown
from dynx.sim.scenario import options as declared
from dynx.sim.scenario.options import OPTIONS, Choice, Flag, Kind, Option

URDF = "urdf"
"""Value that selects the coefficients of the robot description."""

Coefficients = float | list[float] | dict[str, float] | bool
"""One number for all joints, one for each, numbers by joint, or True for those of the robot description."""

# The name of the frame can contain colons, so the numbers are matched from the end.
_PUSH = re.compile(
    r"(?P<frame>.+?):(?P<wrench>[^:,]+(,[^:,]+)+)(:(?P<start>[^:,]+))?(:(?P<duration>[^:,]+))?"
)


class PushInput(NamedTuple):
    """First fields of a `dynx.ExternalForce`."""

    frame: str
    wrench: list[float]
    start: float
    duration: float


def gain(text: str) -> float | list[float]:
    """Read one number for all joints, or one for each, separated by commas."""
    numbers = plain_numbers(text)
    return numbers[0] if len(numbers) == 1 else numbers


def coefficients(text: str) -> Coefficients:
    """Read the word ``urdf``, ``joint=value`` pairs, or numbers as `gain` does."""
    if text.strip() == URDF:
        return True
    if "=" in text:
        named = number_list(text)
        assert isinstance(named, dict)
        return named
    return gain(text)


def push(text: str) -> PushInput:
    """Read ``FRAME:fx,fy,fz[,mx,my,mz][:start[:duration]]``; a wrench of three numbers is a force."""
    found = _PUSH.fullmatch(text.strip())
    wrench = [] if found is None else wrench_numbers(found["wrench"])
    if found is None or not wrench:
        raise click.BadParameter(
            f"{shown(text)} is not of the form FRAME:fx,fy,fz[,mx,my,mz][:START[:DURATION]], "
            "such as tool0:20,0,0,0,0,0:0.5:0.1"
        )
    start, duration = found["start"], found["duration"]
    return PushInput(
        found["frame"],
        wrench,
        0.0 if start is None else finite_number(start),
        math.inf if duration is None else finite_number(duration),
    )


def scale(text: str) -> tuple[str | None, float]:
    """Read a factor for all links, or ``LINK=factor``."""
    link, equals, factor = text.rpartition("=")
    if equals and not link:
        raise click.BadParameter(f"{shown(text)} is not of the form LINK=FACTOR, such as forearm_link=1.1")
    return (link if equals else None), finite_number(factor.strip())


# -- options ---------------------------------------------------------------------------------------


class CommandKind(NamedTuple):
    """A kind of options on the command line."""

    type: Any
    metavar: str
    note: str = ""
    """Addition to the help: valid words, for a notation of its own."""
    several: bool = False
    """Whether the option may be given several times."""


def _joint_numbers(own: str, others: str) -> CommandKind:
    note = (
        f": urdf for {own} of the description (also of MJCF and SDF), numbers, or numbers by joint, the "
        f"others {others}"
    )
    return CommandKind(coefficients, "urdf|NUMBERS|joint=NUMBER,...", note)


COMMAND_KINDS: dict[Kind, CommandKind] = {
    declared.NUMBER: CommandKind(finite_number, "NUMBER"),
    declared.SLIP: CommandKind(finite_number, "NUMBER"),
    declared.SECONDS: CommandKind(finite_number, "SECONDS"),
    declared.COUNT: CommandKind(click.IntRange(min=1), "N"),
    declared.PLANT: CommandKind(None, "NAME"),
    declared.CONFIGURATION: CommandKind(configuration_text, "Q"),
    declared.VELOCITY: CommandKind(number_list, "V"),
    declared.COEFFICIENTS: _joint_numbers("that", "having none"),
    declared.LIMITS: _joint_numbers("those", "being unlimited"),
    declared.FACTORS: CommandKind(scale, "[LINK=]FACTOR", several=True),
    declared.PAYLOADS: CommandKind(
        payload,
        PAYLOAD_FORM,
        f": {PAYLOAD_NOTE}",
        several=True,
    ),
    declared.PUSHES: CommandKind(
        push,
        "FRAME:fx,fy,fz[,mx,my,mz][:START[:DURATION]]",
        " (three numbers are the force alone), in world axes, from START [s] (default 0) for DURATION [s] "
        "(default: until the end)",
        several=True,
    ),
}
"""Kinds of options, as the command line takes them."""

NOISE_OPTIONS = stacked(
    click.option(
        "--noise-q",
        type=gain,
        metavar="NUMBERS",
        help="Standard deviation of the noise of measured positions [rad or m] (default: 0).",
    ),
    click.option(
        "--noise-v",
        type=gain,
        metavar="NUMBERS",
        help="Standard deviation of the noise of measured velocities [rad/s or m/s] (default: 0).",
    ),
    click.option("--seed", type=click.IntRange(min=0), metavar="N", help="Seed of the noise (default: 0)."),
)
"""Options for the parts of a `dynx.Noise`."""


def command_flag(option: Option) -> str:
    """Return the name of an option on the command line, such as ``--control-dt``."""
    return f"--{option.flag or spelled(option.name)}"


def is_command_option(option: Option) -> bool:
    """Check whether an option stands on the command line; the others follow from options of a command."""
    return option.flag != "-"


def command_option(option: Option) -> Callable[[F], F]:
    """Return the click option of a declared option; its value is None or () where it is not given."""
    flag, described = command_flag(option), option.described
    if option.kind is declared.NOISE:
        return NOISE_OPTIONS
    if isinstance(option.kind, Flag):
        if option.default:
            either = f"{flag}/--no-{flag[2:]}"
            return click.option(either, option.name, default=None, help=f"{_in_words(described)} (default).")
        return click.option(flag, option.name, is_flag=True, help=f"{_in_words(described)}.")
    if isinstance(option.kind, Choice):
        kind = CommandKind(one_of(source=option.kind.source), "NAME")
    else:
        kind = COMMAND_KINDS[option.kind]
    end = f" (default: {option.default_text})" if option.default_text else ""
    end += "; may be given several times" if kind.several else ""
    return click.option(
        flag,
        option.name,
        type=kind.type,
        metavar=kind.metavar,
        multiple=kind.several,
        help=f"{_in_words(f'{described}{kind.note}{end}')}.",
    )


def option_groups(before: Mapping[str, Sequence[Callable[[F], F]]]) -> Callable[[F], F]:
    """Return all options of a simulation as one decorator, under their headings.

    `before` has options of the command itself, which come first under a heading, and the order of headings.
    """
    headings = dict.fromkeys([*before, *(each.group for each in OPTIONS.values())])
    return stacked(*(group(heading, *before.get(heading, ()), *_under(heading)) for heading in headings))


def _under(heading: str) -> Iterator[Callable[[F], F]]:
    for each in OPTIONS.values():
        if each.group == heading and is_command_option(each):
            yield command_option(each)


def _in_words(text: str) -> str:
    """Replace names of Python in backticks by those of the command line."""

    def spelling(found: re.Match[str]) -> str:
        name = found[1]
        return command_flag(OPTIONS[name]) if name in OPTIONS else spelled(name)

    return re.sub("`([^`]*)`", spelling, text)

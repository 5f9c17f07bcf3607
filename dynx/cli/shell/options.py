"""Options that several commands share, and how lists of numbers are read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import click

from dynx.errors import nearest, shown

F = TypeVar("F", bound=Callable[..., Any])


def number_list(text: str) -> list[float] | dict[str, float]:
    """Numbers separated by commas or white space, or ``joint=value`` pairs as a dictionary."""
    words = text.replace(",", " ").split()
    if not any("=" in word for word in words):
        return [finite_number(word) for word in words]
    named: dict[str, float] = {}
    for word in words:
        name, value = _pair(word)
        if name in named:
            raise click.BadParameter(f"{shown(name)} is given twice")
        named[name] = value
    return named


def plain_numbers(text: str) -> list[float]:
    """Numbers separated by commas or white space, at least one."""
    numbers = [finite_number(word) for word in text.replace(",", " ").split()]
    if not numbers:
        raise click.BadParameter("wanted a number, or several separated by commas")
    return numbers


def name_list(text: str) -> tuple[str, ...]:
    """Names separated by commas, each once, in order."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise click.BadParameter("wanted names separated by commas")
    return names


def one_of(names: Iterable[str]) -> Callable[[str], str]:
    """A type for one of some names; of a wrong one the message says which is nearest, or all of them."""
    known = tuple(names)

    def name(word: str) -> str:
        if word not in known:
            close = nearest(word, known)
            # Where none is near, a set that is closed is said whole, however long it is.
            clause = close if close.endswith("?") else f"; known: {', '.join(known)}"
            raise click.BadParameter(f"there is no {shown(word)}{clause}")
        return word

    return name


def choice_pair(word: str) -> tuple[str, str]:
    """``rule=choice``, such as DX103=keep."""
    rule, _, choice = (part.strip() for part in word.partition("="))
    if not rule or not choice:
        raise click.BadParameter(f"{shown(word)} is no rule=choice, such as DX103=keep")
    return rule, choice


def _pair(word: str) -> tuple[str, float]:
    """One ``joint=value``; the name may hold any sign but a comma or white space."""
    name, equals, text = word.rpartition("=")
    if not equals or not name:
        raise click.BadParameter(f"{shown(word)} is no joint=value, such as finger=0.02")
    return name, finite_number(text)


def finite_number(word: str) -> float:
    """One number, as Python writes it, that is neither NaN nor infinite."""
    try:
        number = float(word)
    except ValueError:
        raise click.BadParameter(
            f"{shown(word)} is not a number (write 0.5,-1.2 with decimal points)"
        ) from None
    if not math.isfinite(number):
        raise click.BadParameter(f"{shown(word)} is not finite")
    return number


def model_options(command: F) -> F:
    """``--base`` and ``--lock``, as parameters `base` and `lock` (pairs)."""
    command = click.option(
        "--lock",
        type=_pair,
        metavar="JOINT=VALUE",
        multiple=True,
        help="Fix a joint at a value [rad or m]; it leaves q. May be given several times.",
    )(command)
    return click.option(
        "--base",
        type=click.Choice(["fixed", "floating"]),
        default="fixed",
        show_default=True,
        help="Whether the root link is bolted to the world or free.",
    )(command)


def run_options(command: F) -> F:
    """``--jobs``, ``--timeout`` and ``--quiet``: of commands that do many robots in processes."""
    command = click.option(
        "--quiet", is_flag=True, help="No table and no progress: errors, files and exit code only."
    )(command)
    command = click.option(
        "--timeout",
        type=click.FloatRange(min=0.0),
        default=600.0,
        show_default=True,
        help="Seconds after which a robot is given up; 0 for never.",
    )(command)
    return click.option(
        "--jobs",
        type=click.IntRange(min=1),
        help="Robots at a time, each in a process of its own (default: one per processor).",
    )(command)


def json_flag(command: F) -> F:
    """``--json`` without a value, as parameter `as_json`."""
    return click.option(
        "--json", "as_json", is_flag=True, help="Write JSON to standard output instead of a table."
    )(command)


def robot_options(command: F) -> F:
    """ROBOT, ``--backend``, ``--base``, ``--lock`` and ``--json``."""
    command = json_flag(command)
    command = model_options(command)
    command = click.option(
        "--backend",
        "backend_name",
        metavar="NAME",
        help="The engine to ask (default: pinocchio if installed, else reference).",
    )(command)
    return click.argument("robot")(command)


def sample_option(name: str, what: str) -> Callable[[F], F]:
    """An option such as ``--q`` that takes the numbers of one sample."""
    return click.option(
        f"--{name}", type=number_list, metavar="NUMBERS", help=f"{what}: 0,1.5,... or joint=value,..."
    )


frame_option = click.option(
    "--frame", metavar="NAME", help="The frame (default: the end of the longest chain of moving joints)."
)

"""Types of the options of ``dynx sim`` that are more than one number."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

import click

from dynx.cli.shell.options import finite_number, number_list, plain_numbers
from dynx.errors import shown

URDF = "urdf"
"""Value that selects the coefficients of the robot description."""

Coefficients = float | list[float] | dict[str, float] | bool
"""One number for all joints, one for each, numbers by joint, or True for those of the robot description."""

# The name of the frame can contain colons, so the numbers are matched from the end.
_PUSH = re.compile(
    r"(?P<frame>.+?):(?P<wrench>[^:,]+(,[^:,]+)+)(:(?P<start>[^:,]+))?(:(?P<duration>[^:,]+))?"
)
_PAYLOAD = re.compile(r"(?P<frame>.+?):(?P<mass>[^:,]+)(:(?P<center>[^:,]+(,[^:,]+)+))?")


class PushInput(NamedTuple):
    """First fields of a `dynx.sim.Push`."""

    frame: str
    wrench: list[float]
    start: float
    duration: float


class PayloadInput(NamedTuple):
    """First fields of a `dynx.sim.Payload`."""

    frame: str
    mass: float
    center: list[float]


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


def vector(text: str) -> list[float]:
    """Read three numbers."""
    numbers = plain_numbers(text)
    if len(numbers) != 3:
        raise click.BadParameter(f"wanted 3 numbers x,y,z; got {len(numbers)}")
    return numbers


def push(text: str) -> PushInput:
    """Read ``FRAME:fx,fy,fz,mx,my,mz[:start[:duration]]``; a wrench of three numbers is a force."""
    found = _PUSH.fullmatch(text.strip())
    wrench = [] if found is None else plain_numbers(found["wrench"])
    if found is None or len(wrench) not in (3, 6):
        raise click.BadParameter(
            f"{shown(text)} is not of the form FRAME:fx,fy,fz,mx,my,mz[:START[:DURATION]], "
            "such as tool0:20,0,0,0,0,0:0.5:0.1"
        )
    start, duration = found["start"], found["duration"]
    return PushInput(
        found["frame"],
        [*wrench, 0.0, 0.0, 0.0][:6],
        0.0 if start is None else finite_number(start),
        math.inf if duration is None else finite_number(duration),
    )


def payload(text: str) -> PayloadInput:
    """Read ``FRAME:mass[:x,y,z]``."""
    found = _PAYLOAD.fullmatch(text.strip())
    center = [0.0, 0.0, 0.0]
    if found is not None and found["center"] is not None:
        center = plain_numbers(found["center"])
    if found is None or len(center) != 3:
        raise click.BadParameter(
            f"{shown(text)} is not of the form FRAME:MASS[:x,y,z], such as tool0:2.5:0,0,0.05"
        )
    return PayloadInput(found["frame"], finite_number(found["mass"]), center)


def scale(text: str) -> tuple[str | None, float]:
    """Read a factor for all links, or ``LINK=factor``."""
    link, equals, factor = text.rpartition("=")
    if equals and not link:
        raise click.BadParameter(f"{shown(text)} is not of the form LINK=FACTOR, such as forearm_link=1.1")
    return (link if equals else None), finite_number(factor.strip())

"""How the options of ``dynx sim`` that are more than a number are written."""

from __future__ import annotations

import re
from typing import NamedTuple

import click

from dynx.cli.shell.options import finite_number, plain_numbers
from dynx.errors import shown

URDF = "urdf"
"""The word for what the robot's description says."""

Coefficients = float | list[float] | bool
"""One number for all joints, one for each, or True for those of the description."""

# The frame comes first and may itself hold a colon: the numbers at the end are what is told apart.
_PUSH = re.compile(
    r"(?P<frame>.+?):(?P<wrench>[^:,]+(,[^:,]+)+)(:(?P<start>[^:,]+))?(:(?P<duration>[^:,]+))?"
)
_PAYLOAD = re.compile(r"(?P<frame>.+?):(?P<mass>[^:,]+)(:(?P<center>[^:,]+(,[^:,]+)+))?")


class PushInput(NamedTuple):
    """What ``--push`` gives; `duration` None is for ever."""

    frame: str
    wrench: list[float]
    start: float
    duration: float | None


class PayloadInput(NamedTuple):
    """What ``--payload`` gives."""

    frame: str
    mass: float
    center: list[float]


def gain(text: str) -> float | list[float]:
    """One number for all joints, or one for each, separated by commas."""
    numbers = plain_numbers(text)
    return numbers[0] if len(numbers) == 1 else numbers


def coefficients(text: str) -> Coefficients:
    """As `gain`, or the word ``urdf``."""
    return True if text.strip() == URDF else gain(text)


def vector(text: str) -> list[float]:
    """Three numbers."""
    numbers = plain_numbers(text)
    if len(numbers) != 3:
        raise click.BadParameter(f"wanted 3 numbers x,y,z; got {len(numbers)}")
    return numbers


def push(text: str) -> PushInput:
    """``FRAME:fx,fy,fz,mx,my,mz[:start[:duration]]``; a wrench of three numbers is a force."""
    found = _PUSH.fullmatch(text.strip())
    wrench = [] if found is None else plain_numbers(found["wrench"])
    if found is None or len(wrench) not in (3, 6):
        raise click.BadParameter(
            f"{shown(text)} is no FRAME:fx,fy,fz,mx,my,mz[:START[:DURATION]], "
            "such as tool0:20,0,0,0,0,0:0.5:0.1"
        )
    start, duration = found["start"], found["duration"]
    return PushInput(
        found["frame"],
        [*wrench, 0.0, 0.0, 0.0][:6],
        0.0 if start is None else finite_number(start),
        None if duration is None else finite_number(duration),
    )


def payload(text: str) -> PayloadInput:
    """``FRAME:mass[:x,y,z]``."""
    found = _PAYLOAD.fullmatch(text.strip())
    center = [0.0, 0.0, 0.0]
    if found is not None and found["center"] is not None:
        center = plain_numbers(found["center"])
    if found is None or len(center) != 3:
        raise click.BadParameter(f"{shown(text)} is no FRAME:MASS[:x,y,z], such as tool0:2.5:0,0,0.05")
    return PayloadInput(found["frame"], finite_number(found["mass"]), center)


def scale(text: str) -> tuple[str | None, float]:
    """A factor for all links, or ``LINK=factor``."""
    link, equals, factor = text.rpartition("=")
    if equals and not link:
        raise click.BadParameter(f"{shown(text)} is no LINK=FACTOR, such as forearm_link=1.1")
    return (link if equals else None), finite_number(factor.strip())

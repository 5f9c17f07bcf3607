"""Options that several commands share, the types of their values, and a command that groups its options."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple, TypeVar

import click

from dynx.cli.shell.lazy import import_object
from dynx.errors import ArgumentError, nearest, shown

STANDARD_OUTPUT = "-"
"""Name of standard output as a file of ``--json``."""

F = TypeVar("F", bound=Callable[..., Any])

CONFIGURATION_FORM = (
    "0,1.5,... or joint=value,... or the name of a keyframe of the robot's MJCF file (name:NAME if it looks "
    "like numbers)"
)
"""Forms of `configuration_text`."""

NAME_PREFIX = "name:"
"""Beginning of a configuration that is a name, even if that looks like numbers."""

_NAME = re.compile(r"(?!(?:nan|inf(?:inity)?)\b)[^\W\d][^=,]*", re.IGNORECASE)


def number_list(text: str) -> list[float] | dict[str, float]:
    """Read numbers separated by commas or white space, or ``joint=value`` pairs as a dictionary."""
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


def configuration_text(text: str) -> list[float] | dict[str, float] | str:
    """Read numbers as `number_list` does, or the name of a configuration: one that begins with a letter, or
    any other after ``name:``."""
    name = text.strip()
    if name.startswith(NAME_PREFIX):
        return name.removeprefix(NAME_PREFIX)
    if _NAME.fullmatch(name):
        return name
    words = name.replace(",", " ").split()
    wrong = [word for word in words if "=" not in word and _NAME.fullmatch(word)]
    if len(wrong) < len(words) and wrong:
        raise click.BadParameter(
            f"{shown(wrong[0])} among the values is no joint=value; wanted {CONFIGURATION_FORM}, and a name "
            "stands alone"
        )
    return number_list(text)


def plain_numbers(text: str) -> list[float]:
    """Read at least one number, separated by commas or white space."""
    numbers = [finite_number(word) for word in text.replace(",", " ").split()]
    if not numbers:
        raise click.BadParameter("wanted a number, or several separated by commas")
    return numbers


def whole_numbers(text: str) -> tuple[int, ...]:
    """Read whole numbers separated by commas, none negative and none twice."""
    numbers: dict[int, None] = {}
    for word in text.replace(",", " ").split():
        if not word.isdecimal():
            raise click.BadParameter(f"{shown(word)} is not a whole number")
        if int(word) in numbers:
            raise click.BadParameter(f"{word} is given twice")
        numbers[int(word)] = None
    if not numbers:
        raise click.BadParameter("wanted whole numbers separated by commas, such as 0,1,2")
    return tuple(numbers)


def joined(
    ctx: click.Context, option: click.Parameter, given: tuple[tuple[str, ...], ...]
) -> tuple[str, ...]:
    """Join the lists of an option that may be given several times, each name once."""
    return tuple(dict.fromkeys(name for names in given for name in names))


def name_list(text: str) -> tuple[str, ...]:
    """Read names separated by commas, each once, in order."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise click.BadParameter("wanted names separated by commas")
    return names


def one_of(*names: str, source: str | None = None) -> Callable[[str], str]:
    """Return the type of an option that takes one of `names`, or of those in `source`.

    `source` is ``module:attribute``, imported when the option is read. The command line spells names with
    hyphens; Python's spelling is accepted too, and the value is the name as it stands in `names` or `source`.
    The message about a wrong name offers the nearest, or lists all of them.
    """

    def name(word: str) -> str:
        more = () if source is None else import_object(source)
        by_spelling: dict[str, str] = {spelled(each): each for each in (*names, *more)}
        if spelled(word) not in by_spelling:
            close = nearest(word, by_spelling)
            # `nearest` shortens a long list; here all names are listed.
            clause = close if close.endswith("?") else f"; known: {', '.join(by_spelling)}"
            raise click.BadParameter(f"there is no {shown(word)}{clause}")
        return by_spelling[spelled(word)]

    return name


def spelled(name: str) -> str:
    """Return a name of Python as the command line spells it: ``semi_implicit`` is semi-implicit."""
    return name.replace("_", "-")


def choice_pair(word: str) -> tuple[str, str]:
    """Read ``rule=choice``, such as DX103=keep."""
    rule, _, choice = (part.strip() for part in word.partition("="))
    if not rule or not choice:
        raise click.BadParameter(f"{shown(word)} is not of the form rule=choice, such as DX103=keep")
    return rule, choice


def name_value(word: str) -> tuple[str, str]:
    """Read ``name=value``, such as solver_iterations=100."""
    name, equals, value = word.partition("=")
    if not equals or not name.strip() or not value.strip():
        raise click.BadParameter(
            f"{shown(word)} is not of the form name=value, such as solver_iterations=100"
        )
    return name.strip(), value.strip()


def json_value(word: str) -> Any:
    """Read a value in the notation of JSON; another word is a text."""
    try:
        return json.loads(word)
    except (ValueError, RecursionError):
        return word


def _pair(word: str) -> tuple[str, float]:
    """Read one ``joint=value``; the name may hold any character but a comma or white space."""
    name, equals, text = word.rpartition("=")
    if not equals or not name:
        raise click.BadParameter(f"{shown(word)} is not of the form joint=value, such as finger=0.02")
    return name, finite_number(text)


def finite_number(word: str) -> float:
    """Read one finite number in the notation of Python, bounded as the numbers of a description are."""
    try:
        number = float(word)
    except ValueError:
        hint = "write 0.5,-1.2 with decimal points"
        degrees = re.fullmatch(r"\s*(?P<number>\S*\d\.?)\s*(deg|degree|degrees|\u00b0)\s*", word)
        with suppress(ValueError):
            if degrees:
                hint = f"angles are in rad: {word.strip()} are {math.radians(float(degrees['number'])):.6g}"
        raise click.BadParameter(f"{shown(word)} is not a number ({hint})") from None
    if not math.isfinite(number):
        raise click.BadParameter(f"{shown(word)} is not finite")
    bound = import_object("dynx.model.numbers:MAX_MAGNITUDE")
    if not abs(number) < bound:
        raise click.BadParameter(f"{shown(word)} is not below {bound:g} in magnitude")
    return number


class FiniteRange(click.FloatRange):
    """A range of finite numbers: NaN and infinity, which lie in `click.FloatRange`, are refused."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read a number of the range."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{shown(value)} is not finite", param, ctx)
        return number


def model_options(command: F) -> F:
    """Add ``--base``, ``--base-pose`` and ``--lock``, as parameters `base`, `base_pose` (numbers) and `lock`
    (pairs)."""
    return stacked(
        click.option(
            "--base",
            type=click.Choice(["fixed", "floating"]),
            help="Mount of the root link: fixed to the world, or floating (free to move); by default that of "
            "an MJCF or SDF file, else fixed.",
        ),
        click.option(
            "--base-pose",
            type=plain_numbers,
            metavar="NUMBERS",
            help="Pose of a fixed base in the world: x,y,z [m], alone or followed by roll,pitch,yaw [rad] or "
            "qx,qy,qz,qw (default: 0,0,0,0,0,0).",
        ),
        click.option(
            "--lock",
            type=_pair,
            metavar="JOINT=VALUE",
            multiple=True,
            help="Joint to fix at a value [rad or m], which removes it from q; may be given several times.",
        ),
    )(command)


ENGINE_SPELLINGS = ("--engine", "--engines", "--backend", "--backends")
"""Names of the option that chooses engines: the first is that of every command, the others are accepted."""


class _EngineOption(click.Option):
    """An option with the names of `ENGINE_SPELLINGS`, of which help and errors have the first."""

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        """Return the line of ``--help``."""
        spellings, self.opts = self.opts, self.opts[:1]
        try:
            return super().get_help_record(ctx)
        finally:
            self.opts = spellings

    def get_error_hint(self, ctx: click.Context | None) -> str:
        """Return the name in an error."""
        return f"'{self.opts[0]}'"


def engine_option(parameter: str, help: str, **options: Any) -> Callable[[F], F]:
    """Return ``--engine`` with all its spellings, as the parameter of that name."""
    return click.option(*ENGINE_SPELLINGS, parameter, cls=_EngineOption, help=help, **options)


QUIET = "dynx.quiet"
"""Entry of `click.Context.meta`: whether tables and progress are left out."""


def _be_quiet(ctx: click.Context, option: click.Parameter, wanted: bool) -> bool:
    ctx.meta[QUIET] = wanted
    return wanted


_QUIET_HELP = "No tables and no progress: only errors, files and the exit code."

quiet_option = click.option("--quiet", is_flag=True, callback=_be_quiet, help=_QUIET_HELP)

silent_option = click.option(
    "--quiet", is_flag=True, callback=_be_quiet, expose_value=False, help=_QUIET_HELP
)
"""``--quiet`` of a command whose output is all written through `dynx.cli.shell.output`."""


def vector(text: str) -> list[float]:
    """Read three numbers."""
    numbers = plain_numbers(text)
    if len(numbers) != 3:
        raise click.BadParameter(f"wanted 3 numbers x,y,z; got {len(numbers)}")
    return numbers


gravity_option = click.option(
    "--gravity",
    type=vector,
    metavar="X,Y,Z",
    help="Gravitational acceleration in the world [m/s^2] (default: 0,0,-9.81).",
)


def run_options(command: F) -> F:
    """Add ``--jobs``, ``--timeout`` and ``--quiet``, for commands that process robots in worker processes."""
    return stacked(
        click.option(
            "--jobs",
            type=click.IntRange(min=1),
            help="Number of robots at a time, each in its own process (default: one per processor).",
        ),
        click.option(
            "--timeout",
            type=FiniteRange(min=0.0),
            default=600.0,
            show_default=True,
            help="Time limit for each robot [s]; 0 for none.",
        ),
        quiet_option,
    )(command)


json_option = click.option(
    "--json",
    "json_path",
    is_flag=False,
    flag_value=STANDARD_OUTPUT,
    metavar="[FILE]",
    help="File for the results as JSON; - (or no FILE, at the end of the line) is standard output.",
)


def report_options(command: F) -> F:
    """Add the files of reports: ``--html``, ``--junit``, ``--sarif``, ``--github``, ``--baseline`` and
    ``--write-baseline``."""
    return stacked(
        click.option("--html", metavar="FILE", help="File for the reports as one self-contained HTML page."),
        click.option("--junit", metavar="FILE", help="File for the reports as JUnit XML."),
        click.option("--sarif", metavar="FILE", help="File for the reports as SARIF 2.1.0."),
        click.option(
            "--github",
            is_flag=True,
            help="Findings as annotations of GitHub Actions on standard output, without those in the "
            "baseline.",
        ),
        click.option(
            "--baseline",
            "baseline_path",
            metavar="FILE",
            help="File of known differences, as --write-baseline writes it: only other differences fail.",
        ),
        click.option(
            "--write-baseline", metavar="FILE", help="File for all present differences, as a baseline."
        ),
    )(command)


def engines_option(purpose: str) -> Callable[[F], F]:
    """Return ``--engine``, whose value `engines` is the names of several engines, or None."""
    return engine_option(
        "engines", f"{purpose} (default: all that are installed).", type=name_list, metavar="A,B,C"
    )


def settings_option(subject: str) -> Callable[[F], F]:
    """Return ``--set``, whose value `settings` is pairs of names and words."""
    return click.option(
        "--set",
        "settings",
        type=name_value,
        multiple=True,
        metavar="NAME=VALUE",
        help=f"{subject}, as name=value for all engines that have it or engine.name=value; may be given "
        "several times.",
    )


task_options = click.option(
    "--option",
    "options",
    type=name_value,
    multiple=True,
    metavar="NAME=VALUE",
    help="Option of the task, as gymnasium.make takes it; may be given several times. Stand and Walk on "
    "engine dynx are more than 100 times faster with contacts=feet.",
)


named_task_option = click.option(
    "--task",
    "named_task",
    metavar="ID",
    help="The same as TASK, as `dynx play` has it.",
)


def one_task(task: str | None, named_task: str | None) -> str:
    """Return the task of TASK or ``--task``. Raises ArgumentError unless one of them is given."""
    if task is not None and named_task is not None:
        raise ArgumentError(f"TASK is {shown(task)} and --task {shown(named_task)}; wanted one of them")
    if task is None and named_task is None:
        raise ArgumentError(
            "TASK is missing; wanted a task such as CartPole (dynx env list), or module:Env-v0"
        )
    return str(task or named_task)


def robot_options(command: F) -> F:
    """Add ROBOT, ``--engine``, ``--base``, ``--base-pose``, ``--lock``, ``--gravity``, ``--json`` and
    ``--quiet``."""
    return stacked(
        click.argument("robot"),
        engine_option(
            "engine", "Engine that computes (default: pinocchio if installed, else compiled).", metavar="NAME"
        ),
        model_options,
        gravity_option,
        json_option,
        silent_option,
    )(command)


def configuration_option(quantity: str) -> Callable[[F], F]:
    """Return the option ``--q``, whose value is a configuration."""
    help_ = f"{quantity}: {CONFIGURATION_FORM}"
    return click.option("--q", type=configuration_text, metavar="Q", help=help_)


def sample_option(name: str, quantity: str) -> Callable[[F], F]:
    """Return an option such as ``--v``, whose value is the vector of one sample."""
    return click.option(
        f"--{name}", type=number_list, metavar="NUMBERS", help=f"{quantity}: 0,1.5,... or joint=value,..."
    )


PAYLOAD_FORM = "FRAME:MASS[:x,y,z]"
PAYLOAD_NOTE = "a point mass [kg], at x,y,z [m] in the frame (default: 0,0,0)"

_PAYLOAD = re.compile(r"(?P<frame>.+?):(?P<mass>[^:,]+)(:(?P<center>[^:,]+(,[^:,]+)+))?")


class PayloadInput(NamedTuple):
    """First fields of a `dynx.sim.Payload`."""

    frame: str
    mass: float
    center: list[float]


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


payload_option = click.option(
    "--payload",
    type=payload,
    multiple=True,
    metavar=PAYLOAD_FORM,
    help=f"Body fixed to a frame, {PAYLOAD_NOTE}; may be given several times.",
)


def wrench_numbers(text: str) -> list[float]:
    """Read a force and a moment, six numbers; three are a force alone. Return no number for any other
    count."""
    numbers = plain_numbers(text)
    return [*numbers, 0.0, 0.0, 0.0][:6] if len(numbers) in (3, 6) else []


def wrench_on_frame(text: str) -> tuple[str, list[float]]:
    """Read ``FRAME:fx,fy,fz[,mx,my,mz]``; a wrench of three numbers is a force."""
    frame, _, numbers = text.strip().rpartition(":")
    wrench = wrench_numbers(numbers) if frame else []
    if not wrench:
        raise click.BadParameter(
            f"{shown(text)} is not of the form FRAME:fx,fy,fz[,mx,my,mz], such as tool0:0,0,-20"
        )
    return frame, wrench


frame_option = click.option(
    "--frame",
    metavar="NAME",
    help="Name of the frame (default: the end of the longest chain of moving joints).",
)


class GroupedCommand(click.Command):
    """A command whose help lists the options of each `group` under its heading."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, group by group."""
        groups: dict[str, list[tuple[str, str]]] = {}
        options = [param for param in self.get_params(ctx) if isinstance(param, click.Option)]
        for option in sorted(options, key=lambda option: not hasattr(option, _HEADING)):
            record = option.get_help_record(ctx)
            if record is not None:
                groups.setdefault(getattr(option, _HEADING, "Other options"), []).append(record)
        for heading, records in groups.items():
            with formatter.section(heading):
                formatter.write_dl(records)


_HEADING = "_dynx_heading"
"""Attribute of a parameter with the heading under which its help stands."""


def group(heading: str, *options: Callable[[F], F]) -> Callable[[F], F]:
    """Combine several options into one decorator; `GroupedCommand` lists them under a heading."""

    def decorate(command: F) -> F:
        before = len(getattr(command, "__click_params__", ()))
        command = stacked(*options)(command)
        for param in getattr(command, "__click_params__", ())[before:]:
            setattr(param, _HEADING, heading)
        return command

    return decorate


def stacked(*options: Callable[[F], F]) -> Callable[[F], F]:
    """Combine several options into one decorator."""

    def decorate(command: F) -> F:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate

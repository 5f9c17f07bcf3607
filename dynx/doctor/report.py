"""Report of `dynx.diagnose` on one robot, and its entry in the JSON document (`report_document`).

A number that is not finite is null in the document: an engine that refuses the file (quantity ``loading``),
whose results are not used (``result``) or that computes NaN has no error.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

from dynx._version import __version__
from dynx.agreement.report import LoadFailure
from dynx.argument_types import checks_types
from dynx.errors import EngineLimitError
from dynx.files.documents import document_of, to_json_values
from dynx.files.pages import html_grid
from dynx.loaded import engine_of
from dynx.loaded.difference import Deviation
from dynx.model.document_format import Format
from dynx.model.xml.text import TextForm
from dynx.rules.registry import all_rules
from dynx.rules.rule import Kind, Level

Status = Literal["alike", "explained", "massless", "unexplained", "refused"]
"""``explained``: engines differ and every difference has a proved cause. ``massless``: the file has no
inertial data, and only the kinematics was compared. ``unexplained``: a difference has no cause that was
found, or no cause was searched for (`dynx.compare_as_loaded`). ``refused``: not examined."""


@dataclass(frozen=True)
class Effect:
    """Relative change of a quantity by a cause, infinite where an engine computes nothing because of it.

    It is infinite also for ``contact_forces``, whose size means nothing where shapes overlap. An effect on
    ``dynx`` is that dynx itself refuses the file.
    """

    quantity: str
    relative_error: float


@dataclass(frozen=True)
class Finding:
    """A cause at one place of the file.

    `proved` says that removing it alone changed a quantity of an engine, and that the engines agree once all
    causes are removed. A finding of kind ``difference`` without effect is present in the file but changes
    nothing on this base. Not every such place is listed: an invalid number is, wherever it stands (DX103),
    but a link without inertial that a fixed base holds still is not (DX101).
    """

    rule: str
    name: str
    kind: Kind
    link: str | None
    joint: str | None
    line: int | None
    message: str
    engines: tuple[str, ...] = ()
    effect: Effect | None = None
    proved: bool = False
    remedy: str | None = None
    effects: Mapping[str, Effect] = field(default_factory=dict)
    """Effect on each of the `engines`; `effect` is the largest of them."""


@dataclass(frozen=True)
class EngineResult:
    """Load call of one engine, and its relative errors `before` and `after` mending, by quantity.

    Errors are against the reference values that dynx computes from the file. `refused` is the message with
    which the engine refuses the file, `refused_after` that for the mended file. `not_used` and
    `not_used_after` are the reasons why dynx does not use an engine that refuses nothing: it would crash, its
    results are undefined, or they are those of another robot. `step_defaults` are what a step of the engine
    does by itself and no result includes, with the code that switches it off.
    """

    engine: str
    version: str
    call: str
    refused: str | None = None
    refused_after: str | None = None
    before: Mapping[str, float] = field(default_factory=dict)
    after: Mapping[str, float] = field(default_factory=dict)
    not_used: str | None = None
    not_used_after: str | None = None
    step_defaults: Mapping[str, str] = field(default_factory=dict)

    @property
    def no_results(self) -> str | None:
        """Reason why there are no results on the file; None where there are some."""
        return self.not_used if self.refused is None else self.refused

    @property
    def no_results_after(self) -> str | None:
        """Reason why there are no results on the mended file."""
        return self.not_used_after if self.refused_after is None else self.refused_after


@dataclass(frozen=True)
class VariantResult(EngineResult):
    """Another common call of an engine, examined beside it: ``pybullet:plain`` is PyBullet's call without the
    flag that makes it read inertias.

    What differs by the call alone is in `findings`, with proof and remedy, and not in those of the report,
    because no file can mend a call. `after` is measured on the mended file, with the remedy of the call.
    """

    findings: tuple[Finding, ...] = ()

    @property
    def largest_error(self) -> float:
        """Largest error as loaded, infinite where the file is refused."""
        return float("inf") if self.no_results is not None else max(self.before.values(), default=0.0)

    def is_like(self, engine: EngineResult) -> bool:
        """Check whether the engine itself loads, or refuses, the file as this variant does."""
        return (self.no_results is None, self.before) == (engine.no_results is None, engine.before)


@dataclass(frozen=True)
class PairError:
    """Relative error of two engines on one quantity as loaded, and of inverse dynamics joint by joint."""

    engines: tuple[str, str]
    quantity: str
    relative_error: float
    joints: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Counterexample:
    """Smallest robot and state found at which a difference is still there."""

    urdf: str
    q: tuple[float, ...]
    v: tuple[float, ...]
    a: tuple[float, ...]
    moving_joints: int
    relative_error: float


@dataclass(frozen=True)
class Unexplained:
    """A difference that no rule of the catalogue explains."""

    engine: str
    quantity: str
    relative_error: float
    joint: str | None = None
    counterexample: Counterexample | None = None


@dataclass(frozen=True)
class RunTimeCall:
    """A remedy that no URDF can express: a line of code for the users of one engine.

    `comparison` says that it removes forces that belong to the robot, such as joint damping: for comparing
    engines and not for simulating.
    """

    engine: str
    code: str
    comparison: bool = False


@dataclass(frozen=True)
class UnreadMesh:
    """A mesh file that was not read, so that nothing is compared with the size of the link's shape.

    Where it is missing, the engines in `refused_by` refuse the description, as it is and mended.
    """

    file: str
    link: str
    line: int
    reason: str
    refused_by: tuple[str, ...] = ()


@dataclass(frozen=True)
class Change:
    """Change of the file by the remedies of one rule, with everything in the file that they change.

    `others` are elements that are neither links nor joints, such as ``transmission drive``. `made` is false
    for a change that is above the level of the mended file.
    """

    rule: str
    level: Level
    change: str
    links: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    others: tuple[str, ...] = ()
    made: bool = True


@dataclass(frozen=True, repr=False)
class DoctorReport:
    """Causes of the differences between engines on a file, with proofs; truthy if they do not differ.

    - `residual`: the largest relative error that remains after mending
    - `referee`: the relative error of the reference values themselves against 50 digits (mass matrix and
      inverse dynamics at one state)
    - `choices`: sentences on the decisions where the file is ambiguous, and on the changes to the physics of
      the robot
    - `level`: the highest level of the remedies in the mended file
    - `changes`: the changes of these remedies, and the changes that the level leaves undone
    - `model_difference`: values in engines that the file does not state
    - `variants`: other common calls of the engines. They do not count for `alike`, `explained`, `findings`
      and `residual`
    """

    robot: str
    source: str | None = None
    format: Format = "urdf"
    """Format of the file."""
    base: str | None = None
    total_mass: float | None = None
    """Sum of the masses of all links [kg], as the file states them; None where it was not examined."""
    kinematics_only: bool = False
    """True if the file has no inertial data (DX118), so that only the kinematics is compared."""
    engines: tuple[EngineResult, ...] = ()
    findings: tuple[Finding, ...] = ()
    unexplained: tuple[Unexplained, ...] = ()
    residual: float = 0.0
    tolerance: float = 0.0
    samples: int = 0
    seed: int = 0
    referee: float = 0.0
    choices: tuple[str, ...] = ()
    calls: tuple[RunTimeCall, ...] = ()
    level: Level = "physics"
    changes: tuple[Change, ...] = ()
    pairs: tuple[PairError, ...] = ()
    model_difference: tuple[Deviation, ...] = ()
    variants: tuple[VariantResult, ...] = ()
    ignored: Mapping[str, int] = field(default_factory=dict)
    """Number of `findings` of each rule that the user ignores: they are reported, and make no check fail."""
    meshes: int = 0
    """Number of mesh files that the description names."""
    unread_meshes: tuple[UnreadMesh, ...] = ()
    """Number of these mesh files that were not read."""
    refusal: LoadFailure | None = None
    """Error with which `dynx.load` refuses the file as it is, though it was examined; None where it loads."""
    causes_searched: bool = field(default=True, compare=False)
    """False for `dynx.compare_as_loaded`, which measures differences without a search for their causes."""
    error: LoadFailure | None = None
    error_line: int | None = field(default=None, compare=False)
    """Line of the text at which the `error` is, where it is known."""
    mended: str | None = field(default=None, compare=False)
    """URDF text that the engines load alike; None where nothing had to change or no remedy helps."""
    withheld: str | None = field(default=None, compare=False)
    """Reason why there is no mended text although the file needs one: it would describe another robot."""
    text: str | None = field(default=None, compare=False)
    """Text that was examined, for excerpts."""
    form: TextForm | None = field(default=None, compare=False)
    """Encoding and line ends of the mended text: those of the file, if they are valid."""
    seconds: float = field(default=0.0, compare=False)

    @property
    def differences(self) -> tuple[Finding, ...]:
        """Causes that change a quantity of an engine."""
        return tuple(finding for finding in self.findings if finding.effect is not None)

    @property
    def alike(self) -> bool:
        """True if dynx and every engine load the file, with no error above the tolerance, in dynamics too.

        `variants` do not count.
        """
        largest = max((e for each in self.engines for e in each.before.values()), default=0.0)
        refused = self.refusal is not None or any(each.no_results is not None for each in self.engines)
        compared = self.error is None and not self.kinematics_only
        return compared and not refused and largest <= self.tolerance

    @property
    def _engines_alike(self) -> bool:
        """Check whether the engines load the file alike, also where dynx refuses it."""
        return replace(self, refusal=None).alike

    @property
    def variants_off(self) -> tuple[VariantResult, ...]:
        """Variants that refuse the file or have an error above the tolerance, other than their engine's."""
        return tuple(
            each
            for each in self.variants
            if not each.largest_error <= self.tolerance and not any(map(each.is_like, self._engines_of(each)))
        )

    def _engines_of(self, variant: VariantResult) -> list[EngineResult]:
        return [each for each in self.engines if each.engine == engine_of(variant.engine)]

    @property
    def explained(self) -> bool:
        """True if no difference above `tolerance` remains, in what is compared, after the causes were
        removed; False where engines differ and no cause was searched for."""
        loaded = self.refusal is None and all(each.no_results is None for each in self.engines)
        return (
            (self.causes_searched or loaded)
            and self.error is None
            and not self.unexplained
            and self.residual <= self.tolerance
        )

    @property
    def remaining(self) -> float:
        """Largest error on the mended file, at its level and with its calls; infinite where an engine refuses
        it, and where nothing was examined."""
        refused = self.error is not None or any(each.no_results_after is not None for each in self.engines)
        errors = (error for each in self.engines for error in each.after.values())
        return float("inf") if refused else max(errors, default=0.0)

    @property
    def refused_without_meshes(self) -> tuple[str, ...]:
        """Names of the engines that refuse the file where meshes that were not found are missing."""
        return tuple(dict.fromkeys(name for each in self.unread_meshes for name in each.refused_by))

    @property
    def undone(self) -> tuple[Change, ...]:
        """Changes that the level of the mended file leaves undone."""
        return tuple(change for change in self.changes if not change.made)

    @property
    def status(self) -> Status:
        """Verdict in one word."""
        if self.error is not None:
            return "refused"
        if self.alike:
            return "alike"
        if not self.explained:
            return "unexplained"
        return "massless" if self.kinematics_only else "explained"

    def __bool__(self) -> bool:
        return self.alike

    def __repr__(self) -> str:
        return f"<DoctorReport {self.robot}, {self.base} base: {self.verdict}>"

    def _repr_html_(self) -> str:
        rows = ((each.rule, each.name, each.link or each.joint or "", each.line) for each in self.findings)
        head = ("rule", "name", "link or joint", "line")
        return html_grid(f"{self.robot}, {self.base} base: {self.verdict}", head, rows)

    @property
    def verdict(self) -> str:
        """Verdict in one sentence."""
        if self.error is not None:
            return f"not examined ({self.error.type}: {self.error.message})"
        refused = "" if self.refusal is None else f"dynx refuses it ({self.refusal.message}); "
        if self.refusal is not None and self.refusal.type == EngineLimitError.__name__:
            refused = f"engines are compared on the mended file ({self.refusal.message}); "
        skipped = f"; every engine skips {' and '.join(self.skipped)}" if self.skipped else ""
        return f"{refused}{self._verdict_on_engines}{skipped}"

    @property
    def skipped(self) -> tuple[str, ...]:
        """Names of the elements that every engine skips in the file (`dynx.rules.Rule.skipped`)."""
        found = {finding.rule for finding in self.findings}
        return tuple(rule.skipped for rule in all_rules() if rule.skipped and rule.id in found)

    @property
    def _verdict_on_engines(self) -> str:
        if self._engines_alike:
            off = [
                f"only another call, {each.engine}, is {_off(each.largest_error)}"
                for each in self.variants_off
            ]
            return "; ".join(["all engines load it alike", *off])
        if self.unexplained:
            count = len(self.unexplained)
            return f"{count} difference{'s' * (count != 1)} without an explanation"
        causes = {finding.rule for finding in self.differences}
        if self.kinematics_only:
            others = len(causes) - 1
            many = f"{others} further cause{'s' * (others != 1)}"
            also = f", and engines differ for {many}" if others > 0 else ""
            return f"no inertial data: the dynamics cannot be compared{also}"
        if not self.causes_searched:
            return (
                f"engines differ: {self._largest_error}; dynx.diagnose and dynx doctor search for the causes"
            )
        if not causes:
            return "engines differ, for a cause that is known and cannot be mended"
        proved = causes - {finding.rule for finding in self.differences if not finding.proved}
        share = "all" if proved == causes else f"{len(proved)} of them"
        cause = f"{len(causes)} cause{'s' * (len(causes) != 1)}"
        return f"engines differ, for {cause}, {share} proved{self._left_at_level()}"

    @property
    def _largest_error(self) -> str:
        """Write the largest error as loaded, with its engine; or the engines without results."""
        without = [each.engine for each in self.engines if each.no_results is not None]
        if without:
            return f"no result from {' and '.join(without)}"
        errors = [(each.engine, *item) for each in self.engines for item in each.before.items()]
        # A NaN counts as the largest error.
        engine, quantity, error = max(errors, key=lambda each: (math.isnan(each[2]), each[2]))
        return f"{quantity.replace('_', ' ')} of {engine} is {_off(error)}"

    def _left_at_level(self) -> str:
        """Write what remains in a file that is mended at a lower level than `physics`."""
        if not self.undone:
            return ""
        without = [each.engine for each in self.engines if each.no_results_after is not None]
        if without:
            return f"; no result from {' and '.join(without)} when mended at level {self.level}"
        return f"; off by up to {self.remaining:.0e} when mended at level {self.level}"

    def to_dict(self) -> dict[str, Any]:
        """Make the entry of ``results``, of plain numbers, strings and lists."""
        return document_of(DoctorEntry, replace(self, seconds=round(self.seconds, 4)))


def _off(error: float) -> str:
    percent = 100.0 * error
    if not percent < 1e6:  # NaN, too
        return "off without bound"
    return f"off by {percent:.2g} %" if percent < 99.5 else f"off by {percent:.0f} %"


@dataclass(frozen=True)
class DoctorEntry:
    """One robot and base in the JSON document of ``dynx doctor``."""

    robot: str
    source: str | None
    format: Format
    base: str | None
    total_mass: float | None
    kinematics_only: bool
    engines: tuple[EngineResult, ...]
    findings: tuple[Finding, ...]
    status: Status
    explained: bool
    residual: float
    remaining: float
    unexplained: tuple[Unexplained, ...]
    tolerance: float
    samples: int
    seed: int
    referee: float
    choices: tuple[str, ...]
    calls: tuple[RunTimeCall, ...]
    level: Level
    changes: tuple[Change, ...]
    pairs: tuple[PairError, ...]
    model_difference: tuple[Deviation, ...]
    variants: tuple[VariantResult, ...]
    ignored: Mapping[str, int]
    meshes: int
    unread_meshes: tuple[UnreadMesh, ...]
    refusal: LoadFailure | None
    error: LoadFailure | None
    withheld: str | None
    seconds: float


# The JSON document of several reports (schema 1).


SCHEMA = 1


@dataclass(frozen=True)
class DoctorSummary:
    """Number of robots examined, and of those with each verdict."""

    robots: int
    alike: int
    explained: int
    massless: int
    """Robots without inertial data whose kinematics is alike, or differs with every cause proved."""
    unexplained: int
    refused: int
    not_done: int


@dataclass(frozen=True)
class DoctorDocument:
    """The JSON document of ``dynx doctor`` and ``dynx agree --as-loaded``."""

    schema: int
    dynx: str
    results: tuple[DoctorEntry, ...]
    summary: DoctorSummary
    not_done: tuple[str, ...]
    """The robots that an interrupted run left out."""
    left_out: tuple[str, ...]
    """The robots in xacro below a directory, which are not examined."""


@checks_types
def results_document(
    reports: Iterable[DoctorReport], not_done: Sequence[str] = (), left_out: Sequence[str] = ()
) -> dict[str, Any]:
    """Make the JSON document of reports. `not_done` names the robots that an interrupted run left out,
    `left_out` the xacro files below a directory, which are not examined."""
    reports = list(reports)
    statuses = Counter(report.status for report in reports)
    counts = {word: statuses[word] for word in get_args(Status)}
    summary = DoctorSummary(robots=len(reports), **counts, not_done=len(not_done))
    return {
        "schema": SCHEMA,
        "dynx": __version__,
        "results": [report.to_dict() for report in reports],
        "summary": to_json_values(summary),
        "not_done": list(not_done),
        "left_out": list(left_out),
    }

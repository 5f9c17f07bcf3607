"""What `dynx.diagnose` found out about one robot, and its JSON form (schema 1).

    {"schema": 1, "dynx": version, "results": [...], "summary": {...}, "not_done": [...]}

One entry of ``results`` per robot and base:

    robot, source, base      its name, where it was read from, "fixed" or "floating"
    engines                  [{engine, version, call, refused, refused_after, before, after}]: `before`
                             and `after` the mending are {quantity: relative error} against the answer
                             dynx gives for the file (null: no number); `refused` is null or the
                             engine's words
    findings                 [{rule, name, kind, link, joint, line, message, engines, effect, effects,
                             proved, remedy}]; `effect` is null or {quantity, relative_error}, the largest
                             of `effects`, {engine: {quantity, relative_error}}; `relative_error` is null
                             where the engine gives no number at all (quantity ``loading``: it refuses
                             the file)
    explained                whether no difference above `tolerance` remains after mending
    residual                 the largest relative error that remains (null: an answer without number)
    unexplained              [{engine, quantity, relative_error, joint, counterexample}]
    tolerance, samples, seed what counts as a difference, and the states compared
    referee                  largest relative error of the right answers themselves (mass matrix and inverse
                             dynamics at one state) against the 50-digit referee
    choices                  sentences: what was decided where the file is ambiguous, and what was done
                             that changes the physics of the robot
    calls                    [{engine, code}]: what only a call at run time can mend
    pairs                    [{engines: [a, b], quantity, relative_error, joints: {joint: error}}]
    model_difference         [{engine, part, name, property, file, engine_value}]: what an engine
                             holds that the file does not say
    error                    null, or {"type", "message"}: why the robot could not be examined
    seconds                  wall-clock time

``summary`` counts ``robots`` and of them ``alike`` (nothing differs), ``explained`` (all that differs has
a proved cause), ``unexplained``, ``refused`` and ``not_done``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from dynx._version import __version__
from dynx.files.documents import document_of, to_json_values
from dynx.loaded.difference import Deviation
from dynx.model.xml.text import TextForm
from dynx.rules.rule import Kind

SCHEMA = 1


@dataclass(frozen=True)
class Effect:
    """How much a cause changes an answer: relative, infinite where there is no answer with it."""

    quantity: str
    relative_error: float


@dataclass(frozen=True)
class Finding:
    """A cause at one place of the file.

    `proved` says that it was taken away alone and an engine's answer changed, and that with all causes
    taken away the engines agree. A finding of kind ``difference`` without effect is present in the file
    but changes nothing on this base.
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
    """The effect on each of the `engines`; `effect` is the largest of them."""


@dataclass(frozen=True)
class EngineResult:
    """One engine: how it loads the file, and how far its answers are from the file's, before and after."""

    engine: str
    version: str
    call: str
    refused: str | None = None
    refused_after: str | None = None
    before: Mapping[str, float] = field(default_factory=dict)
    after: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class PairError:
    """Two engines on one quantity as loaded, and where it can be said, joint by joint."""

    engines: tuple[str, str]
    quantity: str
    relative_error: float
    joints: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Counterexample:
    """The smallest robot and state found at which the difference is still there."""

    urdf: str
    q: tuple[float, ...]
    v: tuple[float, ...]
    a: tuple[float, ...]
    moving_joints: int
    relative_error: float


@dataclass(frozen=True)
class Unexplained:
    """A difference for which no rule of the catalogue accounts."""

    engine: str
    quantity: str
    relative_error: float
    joint: str | None = None
    counterexample: Counterexample | None = None


@dataclass(frozen=True)
class RunTimeCall:
    """What no URDF can mend: a line of code for the users of one engine."""

    engine: str
    code: str


@dataclass(frozen=True)
class Failure:
    """Why a robot could not be examined."""

    type: str
    message: str


@dataclass(frozen=True, repr=False)
class DoctorReport:
    """Why engines differ on a file, with proof; true in a condition if they do not differ."""

    robot: str
    source: str | None = None
    base: str | None = None
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
    pairs: tuple[PairError, ...] = ()
    model_difference: tuple[Deviation, ...] = ()
    error: Failure | None = None
    mended: str | None = field(default=None, compare=False)
    """The URDF text that the engines load alike; None where nothing had to change or nothing helps."""
    text: str | None = field(default=None, compare=False)
    """The text that was examined: for excerpts."""
    form: TextForm | None = field(default=None, compare=False)
    """In what encoding, and between what ends, the text was read: the mended text is written likewise.
    None for text that declares its encoding itself."""
    seconds: float = field(default=0.0, compare=False)

    @property
    def differences(self) -> tuple[Finding, ...]:
        """The causes that change an answer here."""
        return tuple(finding for finding in self.findings if finding.effect is not None)

    @property
    def alike(self) -> bool:
        """Whether every engine that loads the file as it is gives its answers."""
        largest = max((e for each in self.engines for e in each.before.values()), default=0.0)
        refused = any(each.refused is not None for each in self.engines)
        return self.error is None and not refused and largest <= self.tolerance

    @property
    def explained(self) -> bool:
        """Whether no difference above `tolerance` remains after the causes were taken away."""
        return self.error is None and not self.unexplained and self.residual <= self.tolerance

    def __bool__(self) -> bool:
        return self.alike

    def __repr__(self) -> str:
        return f"<DoctorReport {self.robot}, {self.base} base: {self.verdict}>"

    @property
    def verdict(self) -> str:
        """One sentence."""
        if self.error is not None:
            return f"not examined ({self.error.type}: {self.error.message})"
        if self.alike:
            return "all engines load it alike"
        if self.unexplained:
            count = len(self.unexplained)
            return f"{count} difference{'s' * (count != 1)} without an explanation"
        causes = {finding.rule for finding in self.differences}
        if not causes:
            return "engines differ, for a cause that is known and cannot be mended"
        proved = causes - {finding.rule for finding in self.differences if not finding.proved}
        share = "all" if proved == causes else f"{len(proved)} of them"
        return f"engines differ, for {len(causes)} cause{'s' * (len(causes) != 1)}, {share} proved"

    def to_dict(self) -> dict[str, Any]:
        """One entry of ``results``, of plain numbers, strings and lists."""
        return document_of(DoctorEntry, replace(self, seconds=round(self.seconds, 4)))


@dataclass(frozen=True)
class DoctorEntry:
    """One robot and base in the JSON document of ``dynx doctor``."""

    robot: str
    source: str | None
    base: str | None
    engines: tuple[EngineResult, ...]
    findings: tuple[Finding, ...]
    explained: bool
    residual: float
    unexplained: tuple[Unexplained, ...]
    tolerance: float
    samples: int
    seed: int
    referee: float
    choices: tuple[str, ...]
    calls: tuple[RunTimeCall, ...]
    pairs: tuple[PairError, ...]
    model_difference: tuple[Deviation, ...]
    error: Failure | None
    seconds: float


@dataclass(frozen=True)
class DoctorSummary:
    """How many robots were examined, and how many of them have each verdict."""

    robots: int
    alike: int
    explained: int
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


def results_document(reports: Iterable[DoctorReport], not_done: Sequence[str] = ()) -> dict[str, Any]:
    """The JSON document of many reports; `not_done` names the robots that an interrupted run left out."""
    reports = list(reports)
    summary = DoctorSummary(
        robots=len(reports),
        alike=sum(report.alike for report in reports),
        explained=sum(report.explained and not report.alike for report in reports),
        unexplained=sum(bool(report.unexplained) for report in reports),
        refused=sum(report.error is not None for report in reports),
        not_done=len(not_done),
    )
    return {
        "schema": SCHEMA,
        "dynx": __version__,
        "results": [report.to_dict() for report in reports],
        "summary": to_json_values(summary),
        "not_done": list(not_done),
    }

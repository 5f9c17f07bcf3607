"""Rules. A rule is a cause of disagreement between engines, with its detection in a file and, for most,
its removal."""

from __future__ import annotations

import inspect
import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, Literal, get_args

from packaging.specifiers import SpecifierSet

from dynx.argument_types import checks_types
from dynx.loaded import engine_of
from dynx.loaded.robot import call_on_joint
from dynx.model.document_format import Format
from dynx.model.tree import Base
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules.case import Case

# The versions of the engines in which the rules of the catalogue were measured.


EVERY_ENGINE: Mapping[str, str] = MappingProxyType(
    {"pinocchio": ">=4.1.0", "pybullet": ">=3.2.7", "mujoco": ">=4.0.0", "drake": ">=1.51.1"}
)
"""All engines: `Rule.engines` of a cause that none of them reads as dynx does."""


def measured_on(*engines: str, **versions: str) -> Mapping[str, str]:
    """Return `Rule.engines` for these engines, in the versions of `EVERY_ENGINE` or in `versions` of their
    own."""
    return {engine: EVERY_ENGINE[engine] for engine in engines} | versions


Kind = Literal["difference", "practice"]
"""``difference``: engines give different numbers, or at least one refuses the file. ``practice``: bad
practice, or a matter of a single engine; no comparison of numbers shows it, and the file is changed only
where the user chose so."""

Stage = Literal["reading", "model"]
"""``reading``: the cause is in the text, and dynx may refuse the file until it is removed; these rules are
applied first and must not use `Case.model`. ``model``: the cause is in the robot that was read."""

Level = Literal["safe", "rounding", "physics"]
"""Largest change that a remedy makes: none that a reader notices, rounding of the equations of motion, or
more (`dynx.doctor.mending`)."""

LEVELS: tuple[Level, ...] = get_args(Level)

_HEADING = re.compile(r"([A-Z]+[0-9]{3}) ([a-z0-9]+(?:-[a-z0-9]+)+): (.+)", re.DOTALL)


@dataclass(frozen=True)
class Detection:
    """One place where a rule applies, with one sentence on what is wrong there.

    The message of a rule that concerns several engines names none of them: `engine_clauses` are pairs of an
    engine and a clause on what it makes of the place. A report has the clauses of the engines that take part.
    """

    link: str | None
    joint: str | None
    line: int | None
    message: str
    engine_clauses: tuple[tuple[str, str], ...] = ()

    def sentence(self, engines: Collection[str]) -> str:
        """Return the message with the clauses of these engines."""
        named = {engine_of(engine) for engine in engines}
        clauses = [clause for engine, clause in self.engine_clauses if engine in named]
        return f"{self.message}: {', '.join(clauses)}" if clauses else self.message


@checks_types
def links_of(detections: Sequence[Detection]) -> list[str]:
    """Return the names of the links in which something was detected."""
    return [detection.link for detection in detections if detection.link is not None]


@dataclass(frozen=True)
class Remedy:
    """A case from which the cause was removed, and the decision that was taken.

    `changed` states the whole change, such as "removed <mimic>". `choice` states what was chosen and how to
    choose otherwise (``--choose DX103=keep``), or is None where there is no choice. `changes_physics` is true
    where numbers of the file changed by more than rounding.
    """

    case: Case
    changed: str
    choice: str | None = None
    changes_physics: bool = False


class Rule(ABC):
    """A cause of differences. The docstring of the class that defines a rule is the page of the rule.

    The page begins with a heading, ``DX101 link-without-inertial: A link without ...``, which gives the `id`,
    the `name` and the `title`. The body describes the cause, its effect in each engine, and the remedy.
    """

    id: ClassVar[str]
    """``DX`` and three digits, of which the first is the subject: 1 inertia, 2 joints, 3 joint dynamics,
    4 text, 5 practice, 6 MJCF, 7 SDF. Rules of other packages have a prefix of their own."""

    name: ClassVar[str]
    """Words joined by hyphens, such as ``link-without-inertial``."""

    title: ClassVar[str]
    """The cause in one sentence. Like `advice` and `choices`, it names an engine only if the rule concerns no
    other engine, because a user may examine other engines."""

    formats: ClassVar[tuple[Format, ...]] = ("urdf",)
    """Formats of the files in which the rule looks for its cause; the trap has the first of these formats."""

    kind: ClassVar[Kind] = "difference"
    stage: ClassVar[Stage] = "model"

    engines: ClassVar[Mapping[str, str]] = {}
    """Engines that read the file otherwise than dynx, each with the versions (PEP 440 specifier, such as
    ``>=3.2.5,<=3.2.7``) in which that was measured; a test loads the trap in the installed version and
    fails if the engine behaves otherwise. An engine stands for its loading variants too; a variant
    (``pybullet:plain``) is named where it alone is meant."""

    stated: ClassVar[bool] = False
    """True if neither an edit nor a call removes the cause: an importer leaves something out. The effect of
    the cause is then the difference that remains, in the engines that the rule names, after all other causes
    are removed. It is not proved; a test shows it on the trap and on the same file without the cause.
    """

    stated_refusal: ClassVar[bool] = False
    """True if an engine refuses the file for a `stated` cause."""

    stated_bound: ClassVar[float] = float("inf")
    """Largest error that a `stated` cause accounts for."""

    stated_numbers: ClassVar[bool] = False
    """True if engines compute results in spite of a `stated` cause: it is never the reason for none."""

    undefined: ClassVar[str] = ""
    """Name of what the file leaves undefined where the cause is present, such as ``dynamics``; mostly empty.
    It is the effect of the cause in every engine, and needs no measurement."""

    skipped: ClassVar[str] = ""
    """Name of what every engine skips where the cause is present, such as ``misspelled words``; mostly empty.
    The verdict of a report names it, because engines that load a file alike may not load what was meant."""

    advice: ClassVar[str] = ""
    """Advice to the user, in one sentence."""

    choices: ClassVar[Mapping[str, str]] = {}
    """Ways to remove the cause where there are several, the default first: name -> what it does, in the
    imperative."""

    unambiguous: ClassVar[bool] = False
    """True if text that dynx refuses for this cause can be read in one way only: then the remedy is safe."""

    trap_base: ClassVar[Base] = "fixed"
    """The base on which the trap shows the difference."""

    present_as: ClassVar[str] = ""
    """Quantity that reports call present where the size of an effect means nothing, such as that of forces
    between shapes that overlap; empty for a rule whose effects have a size."""

    depends_on_state: ClassVar[bool] = False
    """True if the difference shows at some states only, so that its absence at others proves nothing."""

    def __init_subclass__(cls) -> None:
        """Take `id`, `name` and `title` from the heading of the page, where the class has one."""
        super().__init_subclass__()
        if heading := _HEADING.fullmatch(cls.page().partition("\n\n")[0]):
            cls.id, cls.name, title = heading.groups()
            cls.title = " ".join(title.split())

    @abstractmethod
    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield every place in the file where the cause is present, in document order."""

    def detect(self, case: Case) -> Sequence[Detection]:
        """Return every place that still has to be remedied, in document order."""
        return list(self.occurrences(case)) if case.form in self.formats else []

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the case without the cause in these places; None where nothing can remove it."""
        return None

    def chosen(self, case: Case) -> str:
        """Return the user's choice among `choices`, or the first of them."""
        return case.choice(self.id, next(iter(self.choices)))

    def decision(self, case: Case) -> str | None:
        """Return a sentence on what was chosen and how to choose otherwise; None where there is no choice."""
        if not self.choices:
            return None
        chosen = self.chosen(case)
        others = " or ".join(f"--choose {self.id}={name}" for name in self.choices if name != chosen)
        return f"{self.id}={chosen}: {self.choices[chosen]}; otherwise {others}"

    @classmethod
    def versions_of(cls, engine: str) -> str | None:
        """Return the versions of an engine or loading variant that the rule names; None for none."""
        return cls.engines.get(engine, cls.engines.get(engine_of(engine)))

    @classmethod
    def named_of(cls, engines: Iterable[str]) -> list[str]:
        """Select the engines and loading variants that the rule names."""
        return [engine for engine in engines if cls.versions_of(engine) is not None]

    @classmethod
    def holds_for(cls, versions: Mapping[str, str]) -> bool:
        """Check whether the rule holds for any of these engines in these versions."""
        return any(
            SpecifierSet(cls.versions_of(engine) or "").contains(versions[engine], prereleases=True)
            for engine in cls.named_of(versions)
        )

    @classmethod
    def page(cls) -> str:
        """Return the page of the rule: the docstring of its class."""
        return inspect.cleandoc(cls.__doc__ or "")

    @classmethod
    def trap(cls) -> str:
        """Return the name of the file that shows the cause alone, in ``models/traps`` or beside the rule's
        module."""
        suffix = {"urdf": "urdf", "mjcf": "xml", "sdf": "sdf"}[cls.formats[0]]
        return f"{cls.id.lower()}_{cls.name.replace('-', '_')}.{suffix}"


class CallingRule(Rule):
    """A rule about forces that engines add at run time, which calls after loading switch off."""

    calls: ClassVar[tuple[str, ...]]
    """Ids of `LoadedRobot.CALLS`."""

    changed: ClassVar[str]
    """The change, as in `Remedy.changed`."""

    per_joint: ClassVar[bool] = True
    """True if each call can also be made only on the joints of the detections (`dynx.loaded.robot`)."""

    def detect(self, case: Case) -> Sequence[Detection]:
        """Return the occurrences in which the calls are not yet made."""
        return [each for each in super().detect(case) if not self._is_called(case, each)]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the case with the calls: on the whole robot, or on the joints of some of the places."""
        joints = {each.joint for each in detections}
        others = {each.joint for each in super().detect(case)} - joints
        if not (self.per_joint and others):
            return Remedy(case.with_calls(*self.calls), self.changed)
        single = [call_on_joint(call, joint) for call in self.calls for joint in joints if joint is not None]
        return Remedy(case.with_calls(*single), self.changed)

    def _is_called(self, case: Case, each: Detection) -> bool:
        return all(
            call in case.calls or (each.joint is not None and call_on_joint(call, each.joint) in case.calls)
            for call in self.calls
        )


# Rules that correct the text: for each place where the rule applies they give the edits that correct it.


@dataclass(frozen=True)
class Correction:
    """One place where a rule applies, and the edits that correct it; empty if no edit corrects it.

    `renamed` lists the attributes whose number stood under a misspelled name. Engines then read another
    number, so this changes the physics. With `whole` the edits correct only such names.
    """

    detection: Detection
    edits: tuple[Edit, ...] = ()
    renamed: tuple[str, ...] = ()
    whole: bool = False


@checks_types
def found_at(element: SourceElement, message: str) -> Detection:
    """Return the detection in `element`: its line, and the link or joint of the robot that it belongs to."""
    part = element
    while part.parent is not None and part.parent.parent is not None:
        part = part.parent
    name = part.attributes.get("name")
    link = name if part.tag == "link" else None
    joint = name if part.tag == "joint" else None
    return Detection(link, joint, element.line, message)


@checks_types
def correction(element: SourceElement, message: str, *edits: Edit) -> Correction:
    """Return the correction of `element` by these edits."""
    return Correction(found_at(element, message), edits)


class EditingRule(Rule):
    """A rule whose corrections both find the places and correct them.

    The text stays as it is where the user chose ``keep`` among `choices`.
    """

    changed: ClassVar[str]
    """Description of the change, stated once for all places; see `Remedy.changed`."""

    changes_physics: ClassVar[bool] = False

    @abstractmethod
    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield a correction for every place where the rule applies, in document order."""

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the places of the corrections."""
        return (each.detection for each in self.corrections(case))

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the edits of these places; None where there are none, or where the user chose ``keep``."""
        if "keep" in self.choices and self.chosen(case) == "keep":
            return None
        wanted = set(detections)
        made = [each for each in self.corrections(case) if each.detection in wanted and each.edits]
        if not made:
            return None
        mended = case.with_source(case.source.apply(*(edit for each in made for edit in each.edits)))
        renamed = dict.fromkeys(name for each in made for name in each.renamed)
        parts = [] if all(each.whole for each in made) else [self.changed]
        parts += [f"corrected the misspelled name of {' and of '.join(renamed)}"] if renamed else []
        physics = self.changes_physics or bool(renamed)
        return Remedy(mended, " and ".join(parts), self.decision(case), physics)

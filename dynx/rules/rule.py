"""What a rule is: a cause of disagreement that can be detected in a file and, mostly, be removed."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from packaging.specifiers import SpecifierSet

from dynx.rules.case import Case

Kind = Literal["difference", "practice"]
"""``difference``: engines give different numbers, or one refuses. ``practice``: bad practice, or a
matter of one engine alone, with nothing for a comparison of numbers to find, and mended only where the
user chose so."""

Stage = Literal["reading", "model"]
"""``reading``: the text itself is doubtful, and dynx may refuse it until it is mended; such rules are
applied first and must not touch `Case.model`. ``model``: about the robot; the document can be read."""


@dataclass(frozen=True)
class Detection:
    """One place where a rule applies: what is the matter there, in one sentence."""

    link: str | None
    joint: str | None
    line: int | None
    message: str


@dataclass(frozen=True)
class Remedy:
    """A case with the cause removed, and what was decided where there was a choice.

    `changed` says what was done to the whole, such as "took <mimic> away"; `choice` is None or says what was
    chosen and how to choose otherwise (``--choose DX103=keep``). `changes_physics` is true where the numbers
    of the file had to be changed by more than rounding.
    """

    case: Case
    changed: str
    choice: str | None = None
    changes_physics: bool = False


class Rule(ABC):
    """A cause. The docstring of its module is its page: plain words, then what each engine does.

    `engines` maps an engine to the versions (PEP 440 specifier, such as ``>=3.2.5,<=3.2.7``) of which it
    was *measured* that the rule holds; a test loads `trap` in the installed version and fails by name if
    that version does otherwise. Engines that are not named read the file as dynx does.
    """

    id: ClassVar[str]
    """``DX`` and three digits: 1 inertia, 2 joints, 3 joint dynamics, 4 text, 5 practice."""

    name: ClassVar[str]
    """Words in kebab-case, such as ``link-without-inertial``."""

    title: ClassVar[str]
    """The cause in one sentence of plain words."""

    kind: ClassVar[Kind] = "difference"
    stage: ClassVar[Stage] = "model"
    engines: ClassVar[Mapping[str, str]] = {}
    advice: ClassVar[str] = ""
    """What to do, in one sentence."""

    choices: ClassVar[Mapping[str, str]] = {}
    """Ways to remove the cause where there are several, the first being the default: name -> what it does,
    in the imperative."""

    trap_base: ClassVar[Literal["fixed", "floating"]] = "fixed"
    """The base on which the trap shows the difference."""

    depends_on_state: ClassVar[bool] = False
    """Whether the difference shows at some configurations alone, so that not to see it proves nothing."""

    @abstractmethod
    def detect(self, case: Case) -> Sequence[Detection]:
        """Every place in the file where the cause is present, in document order."""

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """The case without the cause in these places; None where nothing can remove it."""
        return None

    def chosen(self, case: Case) -> str:
        """The user's choice among `choices`, or the first of them."""
        return case.choice(self.id, next(iter(self.choices)))

    def decision(self, case: Case) -> str | None:
        """What was chosen, and how to choose otherwise; None where there is no choice."""
        if not self.choices:
            return None
        chosen = self.chosen(case)
        others = " or ".join(f"--choose {self.id}={name}" for name in self.choices if name != chosen)
        return f"{self.id}={chosen}: {self.choices[chosen]}; otherwise {others}"

    @classmethod
    def holds_for(cls, versions: Mapping[str, str]) -> bool:
        """Whether the rule holds for any of these engines in these versions."""
        return any(
            SpecifierSet(stated).contains(versions[engine], prereleases=True)
            for engine, stated in cls.engines.items()
            if engine in versions
        )

    @classmethod
    def page(cls) -> str:
        """The page of the rule: the docstring of its module."""
        return inspect.cleandoc(inspect.getmodule(cls).__doc__ or "")

    @classmethod
    def trap(cls) -> str:
        """Name of the file in ``models/traps`` that shows the cause alone."""
        return f"{cls.id.lower()}_{cls.name.replace('-', '_')}.urdf"

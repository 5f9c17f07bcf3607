"""A file under examination: its text, the model that dynx reads from it, and the base for which it is
examined."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from dynx.argument_types import checks_types
from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints_of_urdf
from dynx.model.document_format import Format, format_of_root
from dynx.model.elements import Inertial, Vector
from dynx.model.loading import read_model
from dynx.model.tree import STANDARD_GRAVITY, Base
from dynx.model.xml.source import SourceElement, XmlSource


@dataclass(frozen=True, eq=False)
class Case:
    """The document `source`, examined on `base`, with the engine settings (`calls`) applied so far.

    `choices` are the user's choices where a remedy has several, by rule id (see `Rule.choices`). A document
    in MJCF or SDF states its own gravity, and its base, which `base` has to be.
    """

    source: XmlSource
    base: Base = "fixed"
    gravity: Vector = STANDARD_GRAVITY
    calls: frozenset[str] = frozenset()
    choices: Mapping[str, str] | None = None

    @cached_property
    def form(self) -> Format:
        """Format of the document."""
        return format_of_root(self.source.root.tag)

    @cached_property
    def reading(self) -> Model | DynxError:
        """The result of `dynx.load` on the document: a model, or the error; an error for URDF with a ball
        joint."""
        text = self.source.text_with_lines_before
        try:
            gravity = self.gravity if self.form == "urdf" else None
            model = read_model(text, self.source.source, base=self.base, gravity=gravity)
            if self.form == "urdf":
                # Engines that refuse the joint are compared on the chain that the rule DX210 makes of it.
                refuse_ball_joints_of_urdf(model)
            return model
        except DynxError as error:
            return error

    @property
    def model(self) -> Model:
        """The model that dynx reads; raises the error where it cannot."""
        if isinstance(self.reading, Model):
            return self.reading
        raise self.reading

    @property
    def readable(self) -> bool:
        """True if dynx can read the document."""
        return isinstance(self.reading, Model)

    @cached_property
    def links(self) -> dict[str, SourceElement]:
        """The ``<link>`` elements by name, in document order; the first of several with one name."""
        return _by_name(self.source.root.all("link"))

    @cached_property
    def joints(self) -> dict[str, SourceElement]:
        """The ``<joint>`` elements by name, in document order; the first of several with one name."""
        return _by_name(self.source.root.all("joint"))

    def elements(self, *tags: str) -> list[SourceElement]:
        """List the elements below the root by their tags, such as "link", "collision", in document order."""
        found = [self.source.root]
        for tag in tags:
            found = [child for element in found for child in element.all(tag)]
        return found

    @cached_property
    def inertials(self) -> Mapping[str, Inertial | None]:
        """The inertial of each link as dynx reads it, by the link's name, in depth-first order."""
        return {link.name: link.inertial for link in self.model.links}

    @checks_types
    def choice(self, rule: str, default: str) -> str:
        """Return the user's choice for a rule, or the default."""
        return (self.choices or {}).get(rule, default)

    @checks_types
    def with_source(self, source: XmlSource) -> Case:
        """Return the case with another text."""
        return replace(self, source=source)

    def with_calls(self, *calls: str) -> Case:
        """Return the case with further engine settings."""
        return replace(self, calls=self.calls | set(calls))


def end_of(joint: SourceElement, role: str) -> str:
    """Return the link that a ``<joint>`` names as its ``parent`` or ``child``; empty where it names none."""
    element = joint.first(role)
    return "" if element is None else element.attributes.get("link", "")


def _by_name(elements: list[SourceElement]) -> dict[str, SourceElement]:
    found: dict[str, SourceElement] = {}
    for element in elements:
        found.setdefault(element.attributes.get("name", ""), element)
    return found

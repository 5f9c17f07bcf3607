"""Site of a defect: a robot's text, the parts of it that hold no defect yet, and the random draws."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import TypeVar

from dynx.model import Model
from dynx.model.elements import Joint
from dynx.model.tree import Base
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from tests.doctor.planting.skeleton import Skeleton

Place = tuple[str, "str | None", "str | None"]
"""Rule, link and joint, as a finding names them."""

T = TypeVar("T")


class CannotPlant(Exception):
    """Raised, with the reason, where a defect cannot be planted into a robot."""


@dataclass(frozen=True)
class PlantedDefect:
    """A text with a defect, and the place at which a diagnosis must report it.

    `touched` are the links and joints involved. `sign` is text in the line of the
    defect, for rules whose place is no link and no joint. `also` are further correct findings
    for the same defect at the same place: see `Site.defect`.
    """

    source: XmlSource
    place: Place
    touched: frozenset[str]
    sign: str = ""
    also: frozenset[Place] = frozenset()


@dataclass(frozen=True)
class Site:
    """A text in which `taken` links and joints hold a defect already.

    `skeleton` is that of the clean robot: the text itself need not be readable any more.
    """

    source: XmlSource
    skeleton: Skeleton
    rng: Random
    taken: frozenset[str] = field(default_factory=frozenset)

    @property
    def model(self) -> Model:
        """The clean robot."""
        return self.skeleton.model

    # -- choosing -----------------------------------------------------------------------------

    def pick(self, candidates: Sequence[T], wanted: str) -> T:
        """Draw one of them; CannotPlant where there is none."""
        if not candidates:
            raise CannotPlant(f"no {wanted}")
        return self.rng.choice(candidates)

    def free(self, *names: str) -> bool:
        """Check that nothing was planted there yet, and that the text still has these names."""
        here = {part.attributes.get("name") for part in self.source.root.children}
        return not self.taken.intersection(names) and here.issuperset(names)

    def pick_joint(self, fits: Callable[[Joint], bool], wanted: str) -> tuple[Joint, SourceElement]:
        """Draw a joint of the robot, and return its element in the text too."""
        joint = self.pick([each for each in self.model.joints if self.free(each.name) and fits(each)], wanted)
        return joint, self.element("joint", joint.name)

    def pick_link(self, fits: Callable[[str], bool], wanted: str) -> tuple[str, SourceElement]:
        """Draw the name of a link, and return its element in the text too."""
        names = [each.name for each in self.model.links]
        name = self.pick([each for each in names if self.free(each) and fits(each)], wanted)
        return name, self.element("link", name)

    def element(self, tag: str, name: str) -> SourceElement:
        """Find the link or joint of that name in the text."""
        found = [each for each in self.source.root.all(tag) if each.attributes.get("name") == name]
        if not found:
            raise CannotPlant(f"the text has no {tag} {name} any more")
        return found[0]

    # -- planting -----------------------------------------------------------------------------

    def defect(
        self,
        rule: str,
        *edits: Edit,
        link: str | None = None,
        joint: str | None = None,
        touched: Sequence[str] = (),
        sign: str = "",
        also: Sequence[str] = (),
    ) -> PlantedDefect:
        """Apply the edits; `also` are ids of rules about the same text at the same place."""
        own = [name for name in (link, joint) if name is not None]
        return PlantedDefect(
            self.source.apply(*edits),
            (rule, link, joint),
            self.taken | {*own, *touched},
            sign,
            frozenset((each, link, joint) for each in also),
        )

    def link_insertion(self, name: str, parent: str, *, inertial: str = "", joint: str | None = None) -> Edit:
        """Insert a further link on a fixed joint, at the end of the document."""
        x, y, z = (round(self.rng.uniform(-0.1, 0.1), 3) for _ in range(3))
        link = f'<link name="{name}">\n{inertial}</link>' if inertial else f'<link name="{name}"/>'
        text = (
            f'{link}\n<joint name="{joint or name + "_joint"}" type="fixed">\n'
            f'  <origin xyz="{x} {y} {z}" rpy="0 0 0"/>\n'
            f'  <parent link="{parent}"/>\n  <child link="{name}"/>\n</joint>'
        )
        return self.source.insertion(self.source.root, text)

    def part_edits(self, part: SourceElement, tag: str, **attributes: str) -> list[Edit]:
        """Set attributes of the first element `tag` of a part, inserted where there is none."""
        element = part.first(tag)
        if element is not None:
            return [self.source.attribute_edit(element, name, value) for name, value in attributes.items()]
        words = " ".join(f'{name}="{value}"' for name, value in attributes.items())
        return [self.source.insertion(part, f"<{tag} {words}/>")]

    def rename_edits(self, tag: str, old: str, new: str) -> list[Edit]:
        """Rename a link or joint wherever the document names it."""
        mentions = {"link": {"parent": "link", "child": "link"}, "joint": {"mimic": "joint", "joint": "name"}}
        edits = []
        for element in self.source.root.walk():
            name = "name" if element.tag == tag else mentions[tag].get(element.tag)
            name = "reference" if element.tag == "gazebo" else name
            if name is not None and element.attributes.get(name) == old:
                edits.append(self.source.attribute_edit(element, name, new))
        return edits

    def text_edit(self, element: SourceElement, name: str, text: str) -> Edit:
        """Set the text of an attribute as given, tabs and line breaks included."""
        place = element.places[name]
        old = self.source.data[place.start : place.end].decode("utf-8")
        return Edit(place.start, place.end, f'{old[: old.index(name)]}{name}="{text}"')


@dataclass(frozen=True)
class Planter:
    """Plants the defect of one rule; `bases` are those on which it is a defect, `alone` says that it hides
    most others."""

    rule: str
    plant: Callable[[Site], PlantedDefect]
    bases: tuple[Base, ...] = ("fixed", "floating")
    alone: bool = False

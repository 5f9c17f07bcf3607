"""DX515 misspelled-word: An element or attribute is misspelled, so every reader ignores it.

URDF readers ignore unknown names, mostly without a warning: with ``<intertial>`` the link has no mass, with
``<limit uper="1">`` the range ends at 0, with ``<dynamics dampng="1">`` there is no damping. The rule
reports an unknown name that is close to a known name which is missing, or has its letters in another order
(``ryp``): of elements of ``<robot>``, ``<link>``, ``<joint>`` and ``<inertial>``, and of attributes of
elements that matter for dynamics. In an ``<origin>``, ``roll``, ``pitch`` and ``yaw`` stand for ``rpy``, and
``x``, ``y`` and ``z`` for ``xyz``.

Extensions (``<gazebo>``, ``<sensor>``, names with a prefix) are not close to any of them.

All engines ignore the same names. Correcting a name changes the robot, possibly against the author's
intention, so no edit removes the cause.
"""

from collections.abc import Iterable, Iterator

from dynx.model.xml.source import SourceElement
from dynx.rules import Case, Detection, Rule, found_at
from dynx.rules.attributes import ATTRIBUTES, meant_name
from dynx.rules.joints import misspelled_direction

_ELEMENTS = {
    "robot": ("link", "joint", "material", "transmission"),
    "link": ("inertial", "visual", "collision"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "calibration"),
    "inertial": ("origin", "mass", "inertia"),
}


class MisspelledWord(Rule):
    kind = "practice"
    skipped = "misspelled words"
    advice = "Correct the spelling, and check the resulting robot."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield every such word."""
        root = case.source.root
        return [found_at(*each) for part in root.children for each in _misspelled(part, root)]


def _misspelled(part: SourceElement, root: SourceElement) -> Iterator[tuple[SourceElement, str]]:
    meant = meant_name(part.tag, _ELEMENTS["robot"], ())
    if root.tag == "robot" and meant is not None:
        yield part, f"<{part.tag}> is ignored; <{meant}> was meant"
    if part.tag not in ("link", "joint"):
        return
    for element in _dynamic_elements(part):
        known = ATTRIBUTES.get(element.tag, ())
        for attribute in element.attributes:
            meant = meant_name(attribute, known, element.attributes)
            # The direction of an axis under another name has a rule of its own, DX218.
            other_rule = element.tag == "axis" and attribute == misspelled_direction(element)
            if meant is not None and not other_rule:
                yield element, f"{attribute} of <{element.tag}> is ignored; {meant} was meant"
        for child in element.children:
            present = {other.tag for other in element.children}
            meant = meant_name(child.tag, _ELEMENTS.get(element.tag, ()), present)
            if meant is not None:
                yield child, f"<{child.tag}> in <{element.tag}> is ignored; <{meant}> was meant"


def _dynamic_elements(part: SourceElement) -> Iterator[SourceElement]:
    """Yield a link or joint and what it holds for dynamics; shapes have words of their own."""
    yield part
    for child in part.children:
        if child.tag in ATTRIBUTES or child.tag == "inertial":
            yield child
            yield from (below for below in child.children if below.tag in ATTRIBUTES)

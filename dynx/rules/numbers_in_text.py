"""Numbers in the text of a description: what engines read, misspellings, attributes, quaternions."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Literal

from dynx.errors import shown
from dynx.model.elements import Vector
from dynx.model.urdf.reader import QUATERNION, reads_quaternions, rpy_of_quaternion
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.model.xml.values import DECIMAL
from dynx.rules.case import Case
from dynx.rules.rule import Correction, EditingRule, Stage, correction

# Spellings of numbers in URDF files that not every engine reads.
#
# A text is *plain* if it has the form that URDF defines: one decimal number, or three separated by blanks.
# Any other understandable text has one fault, and a plain text that was probably meant.


LARGEST = "1.7976931348623157e+308"
"""The largest double, which every engine can read and which stands for "no limit"."""

Fault = Literal[
    "comma", "separator", "rest", "count", "blank", "tab", "infinite", "empty", "minus", "expression", "word"
]
"""Fault of a text: a decimal ``comma``, a ``separator`` other than blanks in a vector, a ``rest`` behind a
number, a wrong ``count``, a ``blank`` behind a single number, a ``tab`` or line break in a vector, an
``infinite`` number, an ``empty`` number or vector, a ``minus`` that is not the hyphen of ASCII, an
``expression`` of xacro that was not expanded, a ``word`` without a number."""

_COMMA = re.compile(r"[+-]?(?:[0-9]+,[0-9]*|,[0-9]+)(?:[eE][+-]?[0-9]+)?")
_GROUPED = re.compile(r"([+-]?[0-9]{1,3}(?:,[0-9]{3})+)\.[0-9]*")
_INFINITE = re.compile(r"([+-]?)inf(?:inity)?", re.IGNORECASE)
_FORTRAN = re.compile(r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))[dD]([+-]?[0-9]+)")
_HEXADECIMAL = re.compile(r"[+-]?0[xX](?:[0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)(?:[pP][+-]?[0-9]{1,4})?")
_MINUS = re.compile("[\u2010-\u2015\u2212\ufe63\uff0d](?=[0-9.])")
_UNITS = ("m", "kg", "rad", "s", "N", "m/s", "rad/s", "Nm", "N m", "N*m", "kgm^2", "kg m^2", "kg*m^2")
_MEANINGLESS = frozenset(("", ".", ",", ";", "f", *_UNITS))
"""Text behind a number that leaves it as it is: a second point, the suffix of a constant in C, a unit of SI.
Any other, such as the unit of ``25mm`` or the divisor of ``1/5``, would make it another number."""

_BLANKS = " \t\r\n"
"""The white space of XML, which every engine skips in front of a number and not every one behind it."""

_ARITHMETIC = re.compile(r"\$\{([0-9.eEpi+*/() -]{1,200})\}")
OPTIONAL_ENVIRONMENT = re.compile(r"\$\(optenv[ \t]+[A-Za-z_][A-Za-z_0-9]*[ \t]+([^()${}]{1,200})\)")
"""Environment variable in xacro, with the value that it has if it is not set."""

_SIGNS: dict[type, Callable[[float], float]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}
_OPERATIONS: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}

_UNEXPANDED = ("${", "$(")


@dataclass(frozen=True)
class Misspelling:
    """A text with a fault: `meant` is the probable plain text, `otherwise` another one that is possible."""

    fault: Fault
    meant: str
    otherwise: str | None = None


def is_number(text: str) -> bool:
    """Check whether every engine reads the text, without blanks around it, as one finite number."""
    word = text.strip()
    return DECIMAL.fullmatch(word) is not None and math.isfinite(float(word))


def decimal(value: float) -> str:
    """Return the shortest decimal that reads back as the same double, with 0 for minus zero."""
    return repr(float(value) + 0.0).removesuffix(".0")


def misspelled_number(text: str) -> Misspelling | None:
    """Return the fault of a text that should be one number; None where it is plain."""
    word = text.strip()
    if not word:
        return Misspelling("empty", "")
    if is_number(word):
        return None if text.lstrip(_BLANKS) == word else Misspelling("blank", word)
    if (hyphens := _MINUS.sub("-", word)) != word and is_number(hyphens):
        return Misspelling("minus", hyphens)
    if sign := _infinite_sign(word):
        return Misspelling("infinite", sign.removeprefix("+") + LARGEST)
    if is_unexpanded(word):
        return _expression(word, 1)
    return _misspelled_word(word) or Misspelling("word", "")


def misspelled_vector(text: str) -> Misspelling | None:
    """Return the fault of a text that should be three numbers; None where it is plain."""
    words = text.split()
    if not words:
        return Misspelling("empty", "")
    hyphens = [_MINUS.sub("-", word) for word in words]
    if hyphens != words and len(words) == 3 and all(map(is_number, hyphens)):
        return Misspelling("minus", " ".join(hyphens))
    if is_unexpanded(text):
        return _expression(text, 3)
    if all(map(is_number, words)):
        if len(words) != 3:
            return Misspelling("count", " ".join([*words, "0", "0"][:3]))
        odd = any(character.isspace() and character != " " for character in text)
        return Misspelling("tab", " ".join(words)) if odd else None
    if "," in text or ";" in text:
        return _with_commas(words, text) or Misspelling("word", "")
    if len(words) != 3:
        return Misspelling("word", "")
    parts = [_word_fault(word) for word in words]
    fault: Fault = "word" if None in parts else "rest"
    return Misspelling(fault, " ".join("0" if part is None else part.meant for part in parts))


def _misspelled_word(word: str) -> Misspelling | None:
    if is_unexpanded(word):
        return None
    if _COMMA.fullmatch(word):
        return Misspelling("comma", word.replace(",", "."), word.replace(",", ""))
    if _GROUPED.fullmatch(word):
        return Misspelling("comma", word.replace(",", ""), word.replace(",", ""))
    if _HEXADECIMAL.fullmatch(word):
        return _hexadecimal(word)
    if exponent := _FORTRAN.fullmatch(word):
        return Misspelling("rest", f"{exponent.group(1)}e{exponent.group(2)}")
    front = DECIMAL.match(word)
    if front is None or word[front.end() :].strip() not in _MEANINGLESS:
        return None
    return Misspelling("rest", front.group())


def _hexadecimal(word: str) -> Misspelling | None:
    try:
        return Misspelling("rest", repr(float.fromhex(word)))
    except OverflowError:
        return None


def is_unexpanded(text: str) -> bool:
    """Check whether a text has an expression of xacro, ``${...}`` or ``$(...)``."""
    return any(mark in text for mark in _UNEXPANDED)


def _expression(text: str, count: int) -> Misspelling:
    """Return the fault of a text with expressions; `meant` has their values where all are mere arithmetic, or
    environment variables with a default."""
    plain = _ARITHMETIC.sub(lambda found: _value(found.group(1)), text)
    plain = OPTIONAL_ENVIRONMENT.sub(lambda found: found.group(1), plain)
    words = plain.split()
    return Misspelling(
        "expression", " ".join(words) if len(words) == count and all(map(is_number, words)) else ""
    )


def _value(arithmetic: str) -> str:
    """Return the value of an expression of numbers, pi and + - * /; a question mark for any other."""
    try:
        return decimal(_evaluated(ast.parse(arithmetic.strip(), mode="eval").body))
    except (SyntaxError, ValueError, ArithmeticError, RecursionError, MemoryError):
        return "?"


def _evaluated(node: ast.expr) -> float:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value)
    if isinstance(node, ast.Name) and node.id == "pi":
        return math.pi
    if isinstance(node, ast.UnaryOp) and type(node.op) in _SIGNS:
        return _SIGNS[type(node.op)](_evaluated(node.operand))
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        return _OPERATIONS[type(node.op)](_evaluated(node.left), _evaluated(node.right))
    raise ValueError(f"{type(node).__name__} is no arithmetic")


def _word_fault(word: str) -> Misspelling | None:
    """Return the misspelling of a word of a vector; for a plain number one that means the number itself."""
    return Misspelling("rest", word) if is_number(word) else _misspelled_word(word)


def _with_commas(words: list[str], text: str) -> Misspelling | None:
    """Return the fault of a vector with commas, which are decimal points where that leaves three numbers."""
    bare = [word.rstrip(",;") for word in words]
    if len(bare) == 3 and all(is_number(word) or _COMMA.fullmatch(word) for word in bare):
        if all(map(is_number, bare)):
            return Misspelling("separator", " ".join(bare))
        return Misspelling(
            "comma",
            " ".join(word.replace(",", ".") for word in bare),
            " ".join(word.replace(",", "") for word in bare),
        )
    parts = [part for part in re.split(r"[\s,;]+", text) if part]
    if len(parts) == 3 and all(map(is_number, parts)):
        return Misspelling("separator", " ".join(parts))
    return None


def separated_by_blanks(text: str) -> str | None:
    """Return numbers with blanks where their text has commas or semicolons; None where a comma may be a
    decimal point."""
    words = [bare for word in text.split() if (bare := word.strip(",;"))]
    if words and all(map(is_number, words)):
        return " ".join(words)
    if len(words) != 1 or _GROUPED.fullmatch(words[0]) or {",", ";"} <= set(words[0]):
        return None
    parts = [part for part in re.split("[,;]+", words[0]) if part]
    clear = len(parts) > 2 or ";" in words[0] or any("." in part for part in parts)
    return " ".join(parts) if clear and all(map(is_number, parts)) else None


def _infinite_sign(word: str) -> str:
    """Return the sign of an infinite number, written out or too large for a double; else an empty text."""
    if found := _INFINITE.fullmatch(word):
        return found.group(1) or "+"
    if DECIMAL.fullmatch(word):
        return "-" if word.startswith("-") else "+"
    return ""


# The attributes of a URDF that hold numbers.


MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""The attributes of ``<inertia>``: moments and products of inertia."""

_ORIGIN = {"xyz": 3, "rpy": 3}
_IN_INERTIAL = {
    "origin": _ORIGIN,
    "mass": {"value": 1},
    "inertia": dict.fromkeys(MOMENTS, 1),
}
_IN_SHAPE = {"origin": _ORIGIN}
_IN_GEOMETRY = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
}
_IN_JOINT = {
    "origin": _ORIGIN,
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
    "dynamics": dict.fromkeys(("damping", "friction"), 1),
    "mimic": dict.fromkeys(("multiplier", "offset"), 1),
    "calibration": dict.fromkeys(("rising", "falling"), 1),
    "safety_controller": dict.fromkeys(
        ("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"), 1
    ),
}
_WITHOUT_AXIS = ("fixed", "floating")


@dataclass(frozen=True, eq=False)
class NumericAttribute:
    """An attribute that holds `count` numbers, one or three."""

    element: SourceElement
    name: str
    count: int

    def text_in(self, source: XmlSource) -> str:
        """Return the text as written, in which tabs and line breaks are not yet replaced by blanks."""
        place = self.element.places[self.name]
        written = source.data[place.start : place.end].decode("utf-8").partition("=")[2].strip()[1:-1]
        return self.element.attributes[self.name] if "&" in written else written


def numeric_attributes(source: XmlSource) -> Iterator[NumericAttribute]:
    """Yield all numeric attributes of links and joints, in document order."""
    for part in source.root.children:
        if part.tag == "link":
            yield from _of_link(part)
        elif part.tag == "joint":
            yield from joint_attributes(part)
            # MuJoCo alone reads the axis of these joints, see DX219.
            if part.attributes.get("type") not in _WITHOUT_AXIS:
                yield from _below(part, {"axis": {"xyz": 3}})


def _of_link(link: SourceElement) -> Iterator[NumericAttribute]:
    for child in link.children:
        if child.tag == "inertial":
            yield from _below(child, _IN_INERTIAL)
        elif child.tag in ("visual", "collision"):
            yield from shape_attributes(child)


def joint_attributes(joint: SourceElement) -> Iterator[NumericAttribute]:
    """Yield the numeric attributes of a joint but those of its axis, in document order."""
    yield from _below(joint, _IN_JOINT)


def shape_attributes(part: SourceElement) -> Iterator[NumericAttribute]:
    """Yield the numeric attributes of a ``<visual>`` or a ``<collision>``, in document order."""
    yield from _below(part, _IN_SHAPE)
    for geometry in part.all("geometry"):
        yield from _below(geometry, _IN_GEOMETRY)


def _below(parent: SourceElement, table: dict[str, dict[str, int]]) -> Iterator[NumericAttribute]:
    for element in parent.children:
        for name, count in table.get(element.tag, {}).items():
            if name in element.attributes:
                yield NumericAttribute(element, name, count)


# Base of the rules about numbers written in a form that engines read differently.


class MisspelledNumberRule(EditingRule):
    """A rule about one fault in the text of a number, in every numeric attribute."""

    stage: ClassVar[Stage] = "reading"
    fault: ClassVar[Fault]

    description: ClassVar[str]
    """The fault as the end of a sentence, in which ``{meant}`` stands for the corrected text and
    ``{count}`` for the number of words in it."""

    elements: ClassVar[Collection[str] | None] = None
    """Tags of the elements in whose attributes the fault matters; None for all."""

    def applies(self, attribute: NumericAttribute) -> bool:
        """Check whether the fault matters in this attribute."""
        return self.elements is None or attribute.element.tag in self.elements

    def matches(self, attribute: NumericAttribute, misspelling: Misspelling) -> bool:
        """Check whether the attribute has the fault of this rule where it matters."""
        return misspelling.fault == self.fault and self.applies(attribute)

    def text_for(self, case: Case, misspelling: Misspelling) -> str:
        """Return the corrected text."""
        return misspelling.meant

    def edit(self, case: Case, attribute: NumericAttribute, misspelling: Misspelling) -> Edit | None:
        """Return the edit that corrects the attribute; None where it is left undone."""
        return case.source.attribute_edit(attribute.element, attribute.name, self.text_for(case, misspelling))

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield every attribute with the fault."""
        for attribute, text, misspelling in _misspelled(case.source):
            if not self.matches(attribute, misspelling):
                continue
            end = self.description.format(meant=self.text_for(case, misspelling), count=len(text.split()))
            message = f"{attribute.name} of <{attribute.element.tag}> is {shown(text)}, {end}"
            edit = self.edit(case, attribute, misspelling)
            if edit is None:
                yield correction(attribute.element, f"{message}; left undone: the file has no number for it")
            else:
                yield correction(attribute.element, message, edit)


# Each of the rules examines the same document before the first remedy makes another.
@lru_cache(maxsize=4)
def _misspelled(source: XmlSource) -> Sequence[tuple[NumericAttribute, str, Misspelling]]:
    """Find the attributes with a fault, each with its text, in document order."""
    found = []
    for attribute in numeric_attributes(source):
        text = attribute.text_in(source)
        misspelling = misspelled_number(text) if attribute.count == 1 else misspelled_vector(text)
        if misspelling is not None:
            found.append((attribute, text, misspelling))
    return found


# The ``<origin>`` elements with a quaternion, for rules that must not use the model.


_SEPARATORS = re.compile(r"[\s,;]+")


def origins_with_quaternion(case: Case) -> Iterator[SourceElement]:
    """Yield the origins of joints, inertials and shapes that have a quaternion, in document order."""
    for part in case.source.root.children:
        if part.tag in ("link", "joint"):
            for element in part.walk():
                if element.tag == "origin" and QUATERNION in element.attributes:
                    yield element


def is_plain(case: Case, origin: SourceElement) -> bool:
    """Check whether blanks alone separate the numbers of a quaternion."""
    written = NumericAttribute(origin, QUATERNION, 4).text_in(case.source)
    return all(mark == " " for mark in "".join(_SEPARATORS.findall(written)))


def quaternion_rpy(origin: SourceElement) -> Vector | None:
    """Return roll, pitch and yaw of a quaternion, whatever separates its numbers.

    None where it is not four numbers, or no rotation.
    """
    words = [word for word in _SEPARATORS.split(origin.attributes[QUATERNION]) if word]
    if len(words) != 4 or not all(map(is_number, words)):
        return None
    try:
        return rpy_of_quaternion(tuple(map(float, words)))
    except ValueError:
        return None


# The version of URDF that a robot states.


KNOWN_VERSIONS = ("1.0", "1.1", "1.2")


def corrected_version(case: Case) -> str:
    """Return the version stated, 1.0 where there is none; for an unknown one (DX416) that of its remedy: 1.2
    where a later version has an origin with a quaternion, else 1.0."""
    version = case.source.root.attributes.get("version")
    if version in KNOWN_VERSIONS:
        return version
    newer = reads_quaternions(version) and any(origins_with_quaternion(case))
    return KNOWN_VERSIONS[-1] if newer else KNOWN_VERSIONS[0]

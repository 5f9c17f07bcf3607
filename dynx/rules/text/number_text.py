"""Spellings of numbers in URDF files that not every engine reads.

A text is *plain* if it has the form that URDF defines: one decimal number, or three separated by blanks. Any
other understandable text has one fault, and a plain text that was probably meant.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

LARGEST = "1.7976931348623157e+308"
"""The largest double, which every engine can read and which stands for "no limit"."""

Fault = Literal[
    "comma", "separator", "rest", "count", "blank", "tab", "infinite", "empty", "minus", "expression", "word"
]
"""Fault of a text: a decimal ``comma``, a ``separator`` other than blanks in a vector, a ``rest`` behind a
number, a wrong ``count``, a ``blank`` behind a single number, a ``tab`` or line break in a vector, an
``infinite`` number, an ``empty`` number or vector, a ``minus`` that is not the hyphen of ASCII, an
``expression`` of xacro that was not expanded, a ``word`` without a number."""

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_COMMA = re.compile(r"[+-]?(?:[0-9]+,[0-9]*|,[0-9]+)(?:[eE][+-]?[0-9]+)?")
_GROUPED = re.compile(r"([+-]?[0-9]{1,3}(?:,[0-9]{3})+)\.[0-9]*")
_INFINITE = re.compile(r"([+-]?)inf(?:inity)?", re.IGNORECASE)
_FORTRAN = re.compile(r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))[dD]([+-]?[0-9]+)")
_HEXADECIMAL = re.compile(r"[+-]?0[xX](?:[0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)(?:[pP][+-]?[0-9]{1,4})?")
_MINUS = re.compile("[\u2010-\u2015\u2212\ufe63\uff0d](?=[0-9.])")
_BLANKS = " \t\r\n"
"""The white space of XML, which every engine skips in front of a number and not every one behind it."""

_ARITHMETIC = re.compile(r"\$\{([0-9.eEpi+*/() -]{1,200})\}")
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
    return _NUMBER.fullmatch(word) is not None and math.isfinite(float(word))


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
    front = _NUMBER.match(word)
    # "1,2,3" or "1.5-2": what follows is a number again, so this is no number with a rest.
    if front is None or re.match(r"[-+,;]\s*[0-9.]", word[front.end() :]):
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
    """Return the fault of a text with expressions; `meant` has their values where all are mere arithmetic."""
    plain = _ARITHMETIC.sub(lambda found: _value(found.group(1)), text)
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


def _infinite_sign(word: str) -> str:
    """Return the sign of an infinite number, written out or too large for a double; else an empty text."""
    if found := _INFINITE.fullmatch(word):
        return found.group(1) or "+"
    if _NUMBER.fullmatch(word):
        return "-" if word.startswith("-") else "+"
    return ""

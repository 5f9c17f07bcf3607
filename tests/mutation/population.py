"""The mutants of source files: every place that an operator of mutmut changes, and how.

Not in the population, because no behaviour depends on it: docstrings, type annotations and casts, imports,
aliases of types, decorators, ``__all__``, ``TYPE_CHECKING`` blocks, assertions, and the text of errors.
"""

from __future__ import annotations

import difflib
import hashlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import libcst as cst
from libcst.metadata import MetadataWrapper, ParentNodeProvider, PositionProvider
from mutmut.mutation.mutators import mutation_operators

SKIPPED = (cst.Annotation, cst.Decorator, cst.Import, cst.ImportFrom, cst.Raise, cst.Assert)
TYPE_VARIABLES = ("TypeVar", "ParamSpec", "NewType")
SKIPPED_CALLS = ("cast", "warn", "error", *TYPE_VARIABLES)
"""Names of functions whose arguments only say a type or the text of a message; likewise ``...Error``."""

TYPE_CHECKING = cst.Name("TYPE_CHECKING")
Parents = Mapping[cst.CSTNode, cst.CSTNode]


@dataclass(frozen=True)
class Place:
    """Node of a source file that operators change, and what they make of it."""

    path: str
    function: str
    """Qualified name of the function or class around it; "" at the level of the module."""
    text: str
    line: int
    last_line: int
    """Lines of the statement of which it is part."""
    operator: str
    mutations: tuple[cst.CSTNode, ...]
    node: cst.CSTNode
    tree: cst.Module
    repetition: int
    """Number of places before it with the same text in the same function."""

    def rank(self, seed: int) -> int:
        """Return a random number that depends on the seed and on this place, and on no other."""
        identity = f"{seed}\0{self.path}\0{self.function}\0{self.operator}\0{self.text}\0{self.repetition}"
        return int.from_bytes(hashlib.sha256(identity.encode()).digest()[:8], "big")


def room_of(path: str) -> str:
    """Return the folder of dynx, or the module directly in it, of which a file is part."""
    return path.split("/")[1].removesuffix(".py")


@dataclass(frozen=True)
class Mutant:
    """One changed source file."""

    path: str
    function: str
    line: int
    last_line: int
    operator: str
    before: str
    after: str
    source: str

    @property
    def room(self) -> str:
        return room_of(self.path)

    @property
    def module(self) -> str:
        return self.path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")

    @property
    def key(self) -> str:
        """Identity that edits elsewhere in the file do not change."""
        text = "\0".join((self.path, self.function, self.before, self.after))
        return hashlib.sha256(text.encode()).hexdigest()[:12]


def places(root: Path, path: str) -> Iterator[Place]:
    """Yield every place of a file, in the order of the text."""
    tree = cst.parse_module((root / path).read_text(encoding="utf-8"))
    wrapper = MetadataWrapper(tree, unsafe_skip_copy=True)
    positions = wrapper.resolve(PositionProvider)
    parents = wrapper.resolve(ParentNodeProvider)
    seen: Counter[tuple[str, str, str]] = Counter()
    for node in positions:
        changes = {
            operator.__name__.removeprefix("operator_"): tuple(operator(node))
            for kind, operator in mutation_operators
            if isinstance(node, kind)
        }
        if not any(changes.values()) or _skipped(node, parents):
            continue
        function = ".".join(reversed([*_names(node, parents)]))
        text = wrapper.module.code_for_node(node).strip()
        span = positions[_statement(node, parents)]
        for operator, mutations in changes.items():
            if mutations:
                same = (function, operator, text)
                lines = (span.start.line, span.end.line)
                yield Place(
                    path, function, text, *lines, operator, mutations, node, wrapper.module, seen[same]
                )
                seen[same] += 1


def sample(
    root: Path, sources: Iterable[str], seed: int, count: int, least: int = 0
) -> tuple[list[Mutant], int]:
    """Return random mutants of the sources, files or folders, and the number of places.

    They are `least` of each source, or all where it has fewer, and of the rest as many as make `count`.
    Each place of a source has the same chance, whatever the number of its mutants. The sample is that of the
    lowest ranks (`Place.rank`), so that an edit of one function leaves the mutants of the others in it.
    """
    chosen: list[tuple[int, Place]] = []
    rest: list[tuple[int, Place]] = []
    total = 0
    for source in sources:
        ranked: list[tuple[int, Place]] = []
        path = root / source
        for file in [path] if path.is_file() else sorted(path.rglob("*.py")):
            for place in places(root, file.relative_to(root).as_posix()):
                total += 1
                ranked.append((place.rank(seed), place))
            # Trees of places that cannot be in the sample any more are not kept.
            ranked = sorted(ranked, key=_rank)[: max(count, least)]
        chosen += ranked[:least]
        rest = sorted(rest + ranked[least:], key=_rank)[:count]
    chosen += rest[: max(count - len(chosen), 0)]
    return [mutant(place, rank) for rank, place in sorted(chosen, key=_rank)], total


def _rank(ranked: tuple[int, Place]) -> int:
    return ranked[0]


def mutant(place: Place, rank: int) -> Mutant:
    """Return one of the mutants of a place, chosen by its rank."""
    change = place.mutations[rank // 7919 % len(place.mutations)]
    changed = place.tree.deep_replace(place.node, change)
    assert isinstance(changed, cst.Module)
    old, new = place.tree.code.splitlines(), changed.code.splitlines()
    diff = list(difflib.unified_diff(old, new, n=0, lineterm=""))[2:]
    before, after = (" ".join(line[1:].strip() for line in diff if line[0] == sign) for sign in "-+")
    return Mutant(
        place.path, place.function, place.line, place.last_line, place.operator, before, after, changed.code
    )


def _names(node: cst.CSTNode, parents: Parents) -> Iterator[str]:
    """Yield the names of the functions and classes around a node, from the inside."""
    for each in _around(node, parents):
        if isinstance(each, cst.FunctionDef | cst.ClassDef):
            yield each.name.value


def _around(node: cst.CSTNode, parents: Parents) -> Iterator[cst.CSTNode]:
    """Yield the node and all nodes around it, from the inside."""
    yield node
    while node in parents:
        node = parents[node]
        yield node


def _statement(node: cst.CSTNode, parents: Parents) -> cst.CSTNode:
    """Return the simple statement around a node, or the node itself in the head of a compound one."""
    for each in _around(node, parents):
        if isinstance(each, cst.SimpleStatementLine):
            return each
        if isinstance(each, cst.BaseCompoundStatement):
            return node
    return node


def _skipped(node: cst.CSTNode, parents: Parents) -> bool:
    for each in _around(node, parents):
        if isinstance(each, SKIPPED):
            return True
        if isinstance(each, cst.Call) and _is_skipped_call(each):
            return True
        if isinstance(each, cst.Expr) and isinstance(each.value, cst.SimpleString | cst.ConcatenatedString):
            return True
        if isinstance(each, cst.Assign) and (_target(each) == "__all__" or _is_alias(each)):
            return True
        if isinstance(each, cst.If) and each.test.deep_equals(TYPE_CHECKING):
            return True
    return False


def _is_skipped_call(call: cst.Call) -> bool:
    function = call.func.attr if isinstance(call.func, cst.Attribute) else call.func
    return isinstance(function, cst.Name) and (
        function.value in SKIPPED_CALLS or function.value.endswith(("Error", "Warning"))
    )


def _target(assign: cst.Assign) -> str:
    target = assign.targets[0].target
    return target.value if isinstance(target, cst.Name) else ""


def _is_alias(assign: cst.Assign) -> bool:
    """Return whether this names a type for annotations: ``Vector = npt.NDArray[np.float64]``, ``A | B``."""
    value = assign.value
    if isinstance(value, cst.BinaryOperation):
        name = _target(assign).lstrip("_")
        return isinstance(value.operator, cst.BitOr) and name[:1].isupper() and not name.isupper()
    if isinstance(value, cst.Call):
        return isinstance(value.func, cst.Name) and value.func.value in TYPE_VARIABLES
    if not isinstance(value, cst.Subscript):
        return False
    generic = value.value.attr if isinstance(value.value, cst.Attribute) else value.value
    return isinstance(generic, cst.Name) and (
        generic.value[0].isupper() or generic.value in ("dict", "list", "tuple", "type")
    )

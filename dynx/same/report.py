"""Report of `dynx.same_robot`, and its JSON document (schema ``dynx.same/1``)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from dynx._version import __version__
from dynx.files.documents import document_of
from dynx.files.pages import html_grid
from dynx.model import Model
from dynx.same.attributes import Attribute, DescriptionFreedom, name_files_of_lines
from dynx.same.bounds import Bounds
from dynx.same.effects import ElementEffect
from dynx.same.elements import Part
from dynx.spatial.scalar import Floats

SCHEMA: Literal["dynx.same/1"] = "dynx.same/1"


@dataclass(frozen=True)
class ElementDifference:
    """An element of the second description that differs: a part of a joint or link, with the values and lines
    in both.

    `size` is relative to a scale: the reach of the robot for a length, 1 rad for an angle, and the inertia of
    the body for an inertia. `wanted` is the value in the mended file, in the frames of that file. `effect` is
    the change that this element alone causes. It is None if the element changes the number of coordinates, or
    if the description is not mended.
    """

    part: Part
    tag: Literal["joint", "link"]
    ours: str | None
    theirs: str
    first: str
    second: str
    wanted: str
    first_line: int | None
    second_line: int | None
    size: float
    message: str
    effect: ElementEffect | None
    first_file: str | None = None
    second_file: str | None = None
    """Files of the lines, where another file includes them."""

    def __post_init__(self) -> None:
        name_files_of_lines(self)


@dataclass(frozen=True)
class Unmatched:
    """A joint that only one description has, with all below it, or the base, if one alone floats."""

    kind: Literal["missing", "extra", "moved", "base"]
    ours: str | None
    theirs: str | None
    first_line: int | None
    second_line: int | None
    message: str
    first_file: str | None = None
    second_file: str | None = None
    """Files of the lines, where another file includes them."""

    def __post_init__(self) -> None:
        name_files_of_lines(self)


@dataclass(frozen=True)
class Coordinate:
    """A coordinate of the first robot, ``q_first[first_index] = sign * q_second[second_index]``; the same
    sign holds for velocity and torque, at `first_velocity_index` and `second_velocity_index`.

    A ball joint has a quaternion (x, y, z, w) from that index on: with the quaternions `before` and `after`,
    which are None for other joints, ``q_first = before * q_second * after``. Its angular velocity and torque
    (3,) are ``R(after).T`` times those of the second robot.
    """

    ours: str
    theirs: str
    first_index: int
    second_index: int
    sign: int
    first_velocity_index: int
    second_velocity_index: int
    before: tuple[float, float, float, float] | None = None
    after: tuple[float, float, float, float] | None = None


@dataclass(frozen=True)
class _ReportFields:
    """Fields that a report and its document share."""

    first: str
    second: str
    first_source: str
    second_source: str
    same: bool
    tolerance: float
    differences: tuple[ElementDifference, ...]
    unmatched: tuple[Unmatched, ...]
    attributes: tuple[Attribute, ...]
    freedoms: tuple[DescriptionFreedom, ...]
    coordinates: tuple[Coordinate, ...]
    bounds: Bounds | None
    notes: tuple[str, ...]
    seconds: float
    not_mended: str | None


@dataclass(frozen=True)
class SameReport(_ReportFields):
    """Decision whether two descriptions describe the same robot, and what differs.

    `first` and `second` are the names that the caller gave, `first_source` and `second_source` the files or
    texts that were read.

    - `differences`: the fewest elements of the second description whose replacement makes the robots the same
    - `unmatched`: joints that only one robot has, and the base if only one robot has a floating base
    - `attributes`: other differences, which do not change the verdict
    - `freedoms`: allowed differences, other ways to describe the same motion
    - `bounds`: bounds on the differences of robots that are the same
    - `mended`: the second robot with the elements replaced
    - `mended_text`: the bytes of its file. None if the robots are the same, or if dynx cannot write the
      file; `not_mended` then has the reason
    - `T_first_second` (4, 4): for floating bases, the pose of the second robot's base frame in the first's
    """

    T_first_second: Floats | None
    mended: Model | None = field(default=None, repr=False)
    mended_text: bytes | None = field(default=None, repr=False)

    def __bool__(self) -> bool:
        return self.same

    @property
    def verdict(self) -> str:
        """Verdict in one sentence."""
        if self.same:
            return f"the same robot (tolerance {self.tolerance:g})"
        parts = []
        if self.differences:
            count = len(self.differences)
            parts.append(f"{count} element{'s' * (count != 1)} differ{'s' * (count == 1)}")
        if any(each.kind == "base" for each in self.unmatched):
            parts.append("one base is fixed, the other floating")
        count = sum(each.kind != "base" for each in self.unmatched)
        if count:
            parts.append(f"{count} joint{'s' * (count != 1)} without counterpart")
        return f"different robots (tolerance {self.tolerance:g}): {', '.join(parts)}"

    def __repr__(self) -> str:
        return f"<SameReport {self.first} and {self.second}: {self.verdict}>"

    def _repr_html_(self) -> str:
        rows = (
            (each.part, each.theirs, each.second_line, f"{each.size:.2g}", each.message)
            for each in self.differences
        )
        head = ("part", "joint or link", "line", "size", "difference")
        return html_grid(f"{self.first} and {self.second}: {self.verdict}", head, rows)

    def to_dict(self) -> dict[str, Any]:
        """Make the JSON document, of plain numbers, strings and lists."""
        pose = self.T_first_second
        return document_of(
            SameDocument,
            _Source(
                **{
                    name: getattr(self, name)
                    for name in SameDocument.__dataclass_fields__
                    if name not in ("schema", "dynx", "T_first_second", "mended_file")
                },
                T_first_second=None if pose is None else tuple(map(tuple, pose.tolist())),
                mended_file=None,
            ),
        )


@dataclass(frozen=True)
class SameDocument(_ReportFields):
    """The JSON document of ``dynx same``; `mended_file` is the file that ``--fix`` wrote."""

    verdict: str
    T_first_second: tuple[tuple[float, ...], ...] | None
    mended_file: str | None
    schema: Literal["dynx.same/1"] = SCHEMA
    dynx: str = __version__


class _Source:
    """Values of a document by name."""

    def __init__(self, **values: object) -> None:
        self.__dict__.update(values, schema=SCHEMA, dynx=__version__)

"""Numbers in a form that engines read differently."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar

from dynx.errors import shown
from dynx.model.document_format import Format
from dynx.model.mjcf.vocabulary import attributes_with_commas
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import EVERY_ENGINE, Case, Correction, EditingRule, correction, measured_on
from dynx.rules.numbers_in_text import (
    OPTIONAL_ENVIRONMENT,
    MisspelledNumberRule,
    Misspelling,
    NumericAttribute,
    joint_attributes,
    misspelled_number,
    misspelled_vector,
    numeric_attributes,
    separated_by_blanks,
    shape_attributes,
)


class DecimalComma(MisspelledNumberRule):
    """DX401 decimal-comma: A number is written with a comma instead of a decimal point.

    In URDF the decimal separator is a point. A program that prints numbers in the current locale, such as a
    CAD exporter on a German or French computer, writes a comma.

    - Pinocchio 4.1 refuses the file if the number is in a ``<joint>``. If it is in the ``<mass>`` or
      ``<origin>`` of an ``<inertial>``, Pinocchio drops the whole inertial, so the link has no mass. If it is
      in the ``<inertia>``, Pinocchio drops only the tensor, so the link is a point mass. In both cases it
      prints a line on stderr.
    - PyBullet 3.2.7 reads each number up to the comma: ``2,5`` is 2, and ``0,03`` is 0. It prints no warning.
    - MuJoCo 4.0 refuses the file, and names the line.
    - Drake 1.51 reads a single number up to the comma, and refuses a vector.

    The effect: the digits after the comma are lost. For example, a mass of 2.5 kg becomes 2 kg, and an
    inertia of 0.03 becomes 0.

    What to do: write a point. ``dynx doctor --fix`` writes a point in every number of links and joints.

    In some files ``1,250`` means one thousand two hundred and fifty. dynx reads the comma as a decimal
    separator, unless you write ``--choose DX401=thousands``. A number with commas and a point, such as
    ``1,250.5``, is unambiguous.
    """

    advice = "Write decimals with a point."
    engines = EVERY_ENGINE
    choices = {
        "decimal": "read a comma in a number as the decimal separator",
        "thousands": "read a comma in a number as a separator between thousands",
    }
    changed = "wrote decimal points instead of commas"
    fault = "comma"
    description = "with a comma where {meant} needs a point"

    def text_for(self, case: Case, misspelling: Misspelling) -> str:
        """Return the number as the user chose to read it."""
        if self.chosen(case) == "thousands" and misspelling.otherwise is not None:
            return misspelling.otherwise
        return misspelling.meant


class CommaBetweenNumbers(MisspelledNumberRule):
    """DX402 comma-between-numbers: The numbers of a vector are separated by commas instead of blanks.

    URDF and MJCF separate the numbers of a vector by blanks. Other formats use commas or semicolons.

    - Pinocchio 4.1 refuses a URDF file if the vector is in a ``<joint>``. In an ``<inertial>`` it drops the
      whole inertial with a line on stderr, so the link has no mass. In MJCF (``buildModelFromMJCF``) it reads
      the number in front of the first comma, then 0, and takes the third from uninitialised memory.
    - PyBullet 3.2.7 reads ``1, 2, 3`` correctly, because it reads the number at the beginning of each word.
      In ``1,2,3`` it finds one word instead of three. It then prints a warning and uses zeros, so a joint is
      at the origin of its parent.
    - MuJoCo 4.0 and Drake 1.51 refuse the file. In MJCF, MuJoCo also refuses commas in an attribute without
      effect on the motion, such as the ``size`` of a ``<site>``.
    - In MJCF, dynx refuses commas in the attributes that it reads, and writes a note about the others.

    The effect is a missing offset or rotation: the positions of all links beyond this place have a relative
    error of order 1. An example is ``bicycle/bike.urdf``, which comes with PyBullet.

    What to do: separate numbers by blanks. ``dynx doctor --fix`` writes blanks. In ``0,2 0,5 0,1`` the commas
    are decimal separators, see DX401. In MJCF, ``0,5`` may be one number or two, so ``dynx doctor --fix``
    leaves it as it is.
    """

    formats: ClassVar[tuple[Format, ...]] = ("urdf", "mjcf")
    advice = "Separate the numbers of a vector only by blanks."
    engines = EVERY_ENGINE
    unambiguous = True
    changed = "separated the numbers of vectors by blanks instead of commas"
    fault = "separator"
    description = "with commas or semicolons between the numbers {meant}"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield every attribute with the fault; in MJCF also one whose commas may be decimal points."""
        if case.form != "mjcf":
            yield from super().corrections(case)
            return
        for element in case.source.root.walk():
            for name in attributes_with_commas(element.tag, element.attributes):
                text = element.attributes[name]
                message = f"{name} of <{element.tag}> is {shown(text)}, with commas or semicolons"
                meant = separated_by_blanks(text)
                if meant is None:
                    yield correction(element, f"{message} that may be decimal points")
                else:
                    edit = case.source.attribute_edit(element, name, meant)
                    yield correction(element, f"{message} between the numbers {meant}", edit)


class TextAfterNumber(MisspelledNumberRule):
    """DX403 text-after-number: A number is followed by text that does not belong to it.

    Examples of such text are a second point, a unit, a Fortran exponent (``1.5d-3``), or the ``x`` of a
    hexadecimal number.

    - Pinocchio 4.1 refuses the file if the number is in a ``<joint>``. If it is in the ``<mass>`` or
      ``<origin>`` of an ``<inertial>``, Pinocchio drops the whole inertial, so the link has no mass. If it is
      in the ``<inertia>``, Pinocchio drops only the tensor, so the link is a point mass. In both cases it
      prints a line on stderr.
    - PyBullet 3.2.7 reads the number at the beginning and ignores the rest, without a warning. It reads
      ``1.5d-3`` as 1.5, a thousand times too large.
    - MuJoCo 4.0 refuses the file and names the line, but reads hexadecimal numbers.
    - Drake 1.51 reads single numbers as PyBullet does, and refuses vectors. It reads a hexadecimal number as
      0.

    The effect ranges from none (for example in an effort limit) to a link without mass. An example is
    ``biped/biped2d_pybullet.urdf``, which comes with PyBullet. It has the number ``-1.57.``.

    What to do: write only the number, in SI units. ``dynx doctor --fix`` removes a point or the name of the
    SI unit after a number (``1.57.``, ``2.5 kg``). It writes a Fortran exponent with ``e``, and a hexadecimal
    number as a decimal number. DX420 describes text that changes the meaning of the number (``25mm``,
    ``90deg``, ``1/5``), and words without a number at the beginning (``heavy``).
    """

    advice = "Write only the number, in SI units."
    engines = EVERY_ENGINE
    changed = "kept the number where something followed it"
    fault = "rest"
    description = "which is no decimal number; {meant} is the readable part"

    def decision(self, case: Case) -> str | None:
        """Write the decision: there is one reading, and it is a guess."""
        return f"{self.id}: the number at the beginning was kept"


class VectorOfWrongLength(MisspelledNumberRule):
    """DX404 vector-of-wrong-length: A vector has more or fewer than three numbers.

    For example, ``rpy="-3.14159 1.57079 0 0"`` has one number too many, and ``xyz="0.2 0.1"`` has one too
    few.

    - Pinocchio 4.1 refuses the file if the vector is in a ``<joint>``. In an ``<inertial>`` it drops the
      whole inertial with a line on stderr, so the link has no mass.
    - PyBullet 3.2.7 uses the first three of four numbers without a warning. If there are only two, it prints
      a warning and uses zeros for all three. In an ``<axis>`` it refuses two numbers.
    - MuJoCo 4.0 and Drake 1.51 refuse the file.

    The effect: if a vector becomes zero, the positions of all links beyond this place have a relative error
    of order 1. An example is ``quadruped/microtaur/microtaur.urdf``, which comes with PyBullet. It has
    vectors of four numbers.

    What to do: find out which three numbers were intended. ``dynx doctor --fix`` keeps the first three
    numbers, and adds zeros for missing numbers. With ``--choose DX404=default`` it removes the attribute
    instead, so that the default applies: zero for an origin, (1, 0, 0) for an axis.
    """

    advice = "Write three numbers."
    engines = EVERY_ENGINE
    choices = {
        "first": "keep the first three numbers of a vector, and add zeros for missing numbers",
        "default": "remove a vector without three numbers",
    }
    changed = "made vectors have three numbers"
    fault = "count"
    description = "which has {count} numbers where three are wanted"
    elements = ("origin", "axis")

    def edit(self, case: Case, attribute: NumericAttribute, misspelling: Misspelling) -> Edit | None:
        """Correct or remove the vector, by the user's choice."""
        if self.chosen(case) == "first":
            return super().edit(case, attribute, misspelling)
        if attribute.element.tag == "axis":
            return case.source.removal(attribute.element)
        return case.source.attribute_removal(attribute.element, attribute.name)


_SHAPES_READ_ALIKE = ("box", "sphere", "cylinder", "capsule", "mesh")


class BlankAfterNumber(MisspelledNumberRule):
    """DX405 blank-after-number: White space follows a number, or a no-break space precedes it.

    Pinocchio 4.1 (its reader is urdfdom) accepts white space before a number, but not after it:

    - In a ``<mass>`` it prints on stderr that the mass "is not a float", and drops the whole inertial, so the
      link has no mass.
    - In an ``<inertia>`` it also prints a line on stderr. It drops only the tensor, so the link is a point
      mass.
    - In a ``<limit>``, ``<dynamics>`` or ``<mimic>`` of a joint it refuses the file.

    PyBullet 3.2.7, MuJoCo 4.0, Drake 1.51 and dynx read the number. All engines accept blanks, tabs and line
    breaks before a number. All engines accept blanks between and around the three numbers of a vector, but
    not tabs (DX406).

    No engine treats a no-break space (U+00A0) as a blank. If it follows a number, MuJoCo refuses the file. If
    it precedes a number, PyBullet reads 0, and MuJoCo and Drake refuse the file.

    The effect is a link without mass, or without a moment of inertia. The relative error of the mass matrix
    is of order 0.01 to 1.

    What to do: remove the white space, as ``dynx doctor --fix`` does.
    """

    advice = "Remove the white space."
    engines = measured_on("pinocchio")
    changed = "removed white space around numbers"
    fault = "blank"
    description = "with white space that not every engine skips"

    def applies(self, attribute: NumericAttribute) -> bool:
        """Check whether the attribute is no size of a shape, which all engines read alike."""
        return attribute.element.tag not in _SHAPES_READ_ALIKE


class TabInVector(MisspelledNumberRule):
    """DX406 tab-in-vector: The numbers of a vector are separated by a tab, a line break or another blank.

    In XML tabs and line breaks are white space, so a vector over two lines looks correct. Copied text can
    contain other blanks, such as the no-break space U+00A0.

    - Pinocchio 4.1 separates numbers only at blanks. It refuses a tab in a vector of a ``<joint>``. In an
      ``<inertial>`` it drops the whole inertial with a line on stderr, so the link has no mass.
    - PyBullet 3.2.7 also separates numbers only at blanks. If it finds one word instead of three, it prints a
      warning and uses zeros. In a vector with blanks and line breaks it may find three words, but these are
      not the three numbers. It refuses a tab in an ``<axis>``.
    - MuJoCo 4.0 and Drake 1.51 accept tabs and line breaks, and refuse the no-break space.

    The effect is a missing offset: the positions of all links beyond this place have a relative error of
    order 1. The error of the mass matrix of a small arm was 0.1.

    What to do: separate numbers by blanks, as ``dynx doctor --fix`` does.
    """

    advice = "Separate the numbers of a vector only by blanks."
    engines = measured_on("pinocchio", "pybullet")
    changed = "separated the numbers of vectors by blanks instead of tabs and line breaks"
    fault = "tab"
    description = "with a tab, a line break or another blank among its numbers"


class InfiniteLimit(MisspelledNumberRule):
    """DX407 infinite-limit: A limit of a joint is infinite.

    An example is ``<limit lower="-inf" upper="inf" effort="inf" velocity="inf"/>``. URDF has no notation for
    infinity, so engines differ.

    - Pinocchio 4.1, Drake 1.51 and dynx refuse the file.
    - PyBullet 3.2.7 and MuJoCo 4.0 read infinity. MuJoCo refuses ``1e999``.

    What to do: write ``type="continuous"`` without ``lower`` and ``upper``, or write a number that no joint
    reaches. ``dynx doctor --fix`` writes the largest double, 1.7976931348623157e+308. All four engines read
    this number, and dynx reads it as "no limit". For infinite masses, inertias and positions, see DX420.
    """

    advice = "Write a large finite number, or omit the limit."
    engines = measured_on("pinocchio", "drake")
    unambiguous = True
    changed = "wrote the largest double for infinite limits"
    fault = "infinite"
    description = "which is no finite number"
    elements = ("limit",)


class EmptyVector(MisspelledNumberRule):
    """DX408 empty-vector: An origin has a position or angles without numbers.

    An example is ``<origin xyz=""/>``. Usually a variable of a template was empty, or an exporter had no
    value. URDF's default for a missing attribute is zero.

    - Pinocchio 4.1 refuses the file if the origin is that of a ``<joint>``. In an ``<inertial>`` it drops the
      whole inertial with a line on stderr, so the link has no mass.
    - Drake 1.51 refuses the file.
    - PyBullet 3.2.7 prints a warning and uses zeros. MuJoCo 4.0 and dynx use zeros.

    The effect is a file that does not load, or a link without mass. The relative error of the mass matrix is
    then of order 0.01 to 1.

    What to do: remove the attribute, or write ``0 0 0``. ``dynx doctor --fix`` removes it.
    """

    advice = "Remove the empty attribute."
    engines = measured_on("pinocchio", "drake")
    changed = "removed empty vectors of origins"
    fault = "empty"
    description = "without any number"
    elements = ("origin",)

    def edit(self, case: Case, attribute: NumericAttribute, misspelling: Misspelling) -> Edit:
        """Return the edit that removes the attribute."""
        return case.source.attribute_removal(attribute.element, attribute.name)


_ELEMENTS_THAT_NEED_NUMBERS = ("mass", "inertia")


class AttributeWithoutNumber(MisspelledNumberRule):
    """DX420 attribute-without-number: An attribute that should hold numbers is empty or holds other text.

    If the user entered no limits, some exporters write ``<limit lower="" upper="" .../>``. Some write ``nan``
    for the centre of mass of a body without mass. Other examples are ``none`` and ``25mm``.

    - Pinocchio 4.1 refuses the file if the attribute is in a ``<joint>``, even in a fixed joint. In an
      ``<inertial>`` it drops the tensor or the whole inertial with a line on stderr.
    - Drake 1.51 refuses the file.
    - PyBullet 3.2.7 reads any word as 0, except ``nan`` and ``inf``. It reads these as not-a-number and
      infinity, so results are NaN.
    - MuJoCo 4.0 reads an empty attribute of a joint as missing, and accepts ``nan`` in a joint. It refuses
      words, and an empty mass or moment.

    dynx refuses the file and names the line, unless dynx does not need the element. For example, it does not
    need the limits of a fixed joint. For an empty ``xyz`` or ``rpy``, see DX408, and for an infinite limit
    DX407. dynx does not correct an expression of xacro, such as ``${mass}``: expand the file with ``xacro``.

    What to do: write the numbers. The file does not contain the missing numbers, so ``dynx doctor --fix``
    leaves the attributes as they are and lists each with its line. It removes only empty attributes that have
    a default or that no engine needs. ``--choose DX420=guess`` writes 0 for a mass, for an entry of a tensor
    and for a word in a vector. It removes all other attributes without a number, so that their defaults
    apply.
    """

    advice = "Write the numbers, or remove the attribute."
    engines = measured_on("pinocchio", "mujoco", "drake")
    choices = {
        "leave": "leave text that is not a number as it is, and list it",
        "guess": "write 0 for a mass, a moment and a word in a vector, and remove any other such attribute",
    }
    changed = "removed attributes without a number, or wrote 0 for what is none"
    fault = "word"
    description = "which is no number that every engine reads"

    def matches(self, attribute: NumericAttribute, misspelling: Misspelling) -> bool:
        """Check for words, empty numbers, and infinite numbers other than limits."""
        if misspelling.fault == "infinite":
            return attribute.element.tag != "limit"
        return misspelling.fault == "word" or (misspelling.fault == "empty" and attribute.count == 1)

    def edit(self, case: Case, attribute: NumericAttribute, misspelling: Misspelling) -> Edit | None:
        """Return the edit that removes the attribute, or writes 0 where one is required; by default only the
        removal of an attribute that is empty or that dynx does not read."""
        element = attribute.element
        required = element.tag in _ELEMENTS_THAT_NEED_NUMBERS
        if self.chosen(case) == "leave":
            kind = None if element.parent is None else element.parent.attributes.get("type")
            if required or not (misspelling.fault == "empty" or _is_unread(attribute, kind)):
                return None
        if required:
            return case.source.attribute_edit(element, attribute.name, "0")
        if misspelling.fault == "word" and misspelling.meant:
            return case.source.attribute_edit(element, attribute.name, misspelling.meant)
        if element.tag == "axis":
            return case.source.removal(element)
        return case.source.attribute_removal(element, attribute.name)


class MinusNotAscii(MisspelledNumberRule):
    """DX421 minus-not-ascii: A number has a typographic minus sign or dash instead of the hyphen-minus.

    Text that was copied from a document or a web page may have the minus sign U+2212 or a dash before
    negative numbers. It looks like ``-``, but no engine reads it.

    - Pinocchio 4.1 refuses the file if the number is in a ``<joint>``. In an ``<inertial>`` it drops the
      whole inertial, or the tensor, with a line on stderr.
    - PyBullet 3.2.7 reads 0, without a warning.
    - MuJoCo 4.0 and Drake 1.51 refuse the file.

    The effect in PyBullet: a position is 0, or the range of a joint ends at 0.

    What to do: write the hyphen-minus of the keyboard, as ``dynx doctor --fix`` does.
    """

    advice = "Write the hyphen-minus of the keyboard."
    engines = EVERY_ENGINE
    changed = "wrote the hyphen-minus in numbers"
    fault = "minus"
    description = "in which the minus sign is not the hyphen-minus of {meant}"


_NEVER_READ = ("calibration", "safety_controller")
_UNREAD_OF_FIXED = (*_NEVER_READ, "limit", "dynamics", "mimic")
_UNREAD_OF_CONTINUOUS = ("lower", "upper")

Expression = tuple[NumericAttribute, Misspelling]


class ExpressionNotExpanded(EditingRule):
    """DX429 expression-not-expanded: A number is an expression of xacro.

    Examples are ``<origin rpy="${3.14159/2} 0 0"/>`` in a ``<collision>``,
    ``<safety_controller k_velocity="${k}"/>``, and ``<origin xyz="$(optenv IMU_XYZ 0.19 0 0.149)"/>`` in a
    ``<joint>``. Such a file was never expanded by ``xacro``, or it was expanded by hand.

    - In a ``<collision>``, MuJoCo 4.0 refuses the expression ("bad format in attribute 'rpy'").
    - Pinocchio 4.1 refuses the expression in ``<calibration>``, in ``<safety_controller>``, in the position
      limits of a continuous joint, and in the ``<limit>``, ``<dynamics>`` and ``<mimic>`` of a fixed joint.
      Drake 1.51 refuses it in these limits and in this ``<mimic>``.
    - In the ``<origin>`` of a joint, Pinocchio, MuJoCo and Drake refuse the expression. In an ``<inertial>``,
      MuJoCo and Drake refuse it, and Pinocchio drops the whole inertial with a line on stderr.
    - PyBullet 3.2.7 takes the first three words, and reads 0 for each word that is no number, without a
      warning. From ``$(optenv IMU_XYZ 0.19 0 0.149)`` it reads the position (0, 0, 0.19), and from
      ``$(optenv MASS 2.5)`` the mass 0.

    In a ``<visual>`` every engine accepts the expression. In an ``<inertial>``, and in the elements of a
    joint that this list does not name, dynx refuses the expression, because the dynamics depends on the
    number.

    What to do: write the number, or copy the file, in its folder, to a name that ends in ``.xacro``, which
    dynx expands with ``xacro``. ``dynx doctor --fix`` calculates simple expressions (numbers, ``pi``,
    ``+ - * /``). For ``$(optenv NAME DEFAULT)`` it writes the default. For any other expression it removes
    the ``<collision>``, the element of the joint that dynx does not read, or the position limit.
    """

    stage = "reading"
    advice = "Write the number, or expand the file with xacro."
    engines = EVERY_ENGINE
    changed = "wrote the values of expressions of xacro, or removed what they belong to"

    def decision(self, case: Case) -> str | None:
        """Name the first environment variable whose default is written; None without one."""
        for each, _ in _expressions(case, numeric_attributes(case.source)):
            found = OPTIONAL_ENVIRONMENT.search(each.text_in(case.source))
            if found is not None:
                return f"{self.id}: the default of {shown(found.group())} was written"
        return None

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield one correction for each collision and each element of a joint with such numbers."""
        for collision in case.elements("link", "collision"):
            if found := list(_expressions(case, shape_attributes(collision))):
                yield _expression_correction(case, found, case.source.removal(collision))
        for joint in case.source.root.all("joint"):
            kind = joint.attributes.get("type")
            by_element: dict[SourceElement, list[Expression]] = {}
            for each in _expressions(case, joint_attributes(joint)):
                if _is_unread(each[0], kind):
                    by_element.setdefault(each[0].element, []).append(each)
            for element, found in by_element.items():
                if element.tag == "limit" and kind == "continuous":
                    removals = (case.source.attribute_removal(element, each.name) for each, _ in found)
                    yield _expression_correction(case, found, *removals)
                else:
                    yield _expression_correction(case, found, case.source.removal(element))
        yield from _needed_values(case)


def _needed_values(case: Case) -> Iterator[Correction]:
    """Yield one correction for each element of inertials and joints with numbers that dynx needs, and whose
    expressions all have a known value."""
    by_element: dict[SourceElement, list[Expression]] = {}
    for each in _expressions(case, numeric_attributes(case.source)):
        around = each[0].element.parent
        if around is None or around.tag not in ("inertial", "joint"):
            continue
        if around.tag == "inertial" or not _is_unread(each[0], around.attributes.get("type")):
            by_element.setdefault(each[0].element, []).append(each)
    for found in by_element.values():
        if all(misspelling.meant for _, misspelling in found):
            yield _expression_correction(case, found)


def _expressions(case: Case, attributes: Iterable[NumericAttribute]) -> Iterator[Expression]:
    for attribute in attributes:
        text = attribute.text_in(case.source)
        found = misspelled_number(text) if attribute.count == 1 else misspelled_vector(text)
        if found is not None and found.fault == "expression":
            yield attribute, found


def _is_unread(attribute: NumericAttribute, kind: str | None) -> bool:
    """Check whether dynx does not read an attribute of a joint of a type."""
    tag = attribute.element.tag
    if kind == "continuous" and tag == "limit":
        return attribute.name in _UNREAD_OF_CONTINUOUS
    return tag in (_UNREAD_OF_FIXED if kind == "fixed" else _NEVER_READ)


def _expression_correction(case: Case, found: list[Expression], *removals: Edit) -> Correction:
    """Write the values where all are known, and remove what has the expressions otherwise."""
    first = found[0][0]
    text = shown(first.element.attributes[first.name])
    edits = [
        case.source.attribute_edit(each.element, each.name, misspelling.meant)
        for each, misspelling in found
        if misspelling.meant
    ]
    message = f"{first.name} of <{first.element.tag}> is {text}, which xacro did not expand"
    return correction(first.element, message, *(edits if len(edits) == len(found) else removals))

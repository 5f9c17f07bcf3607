"""Corrections that write missing attributes: the number of a misspelled name, or a default."""

from __future__ import annotations

from collections.abc import Sequence

from dynx.errors import escaped
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules.case import Case
from dynx.rules.editing import Correction, found_at
from dynx.rules.text.misspelled_names import misspelled_numbers


def completion(
    case: Case, element: SourceElement, message: str, missing: Sequence[str], default: str
) -> Correction:
    """Return the correction of an element that lacks attributes, of which the message says so.

    An attribute whose number stands under a misspelled name gets that number, any other the default.
    """
    meant = misspelled_numbers(element, missing)
    edits = list[Edit]()
    for right in missing:
        if right in meant:
            edits += renaming(case, element, meant[right], right)
        else:
            edits.append(case.source.attribute_edit(element, right, default))
    notes = [
        f"{right} is {element.attributes[wrong].strip()} in {escaped(wrong)}"
        for right, wrong in meant.items()
    ]
    detection = found_at(element, "; ".join([message, *notes]))
    return Correction(detection, tuple(edits), tuple(meant), whole=len(meant) == len(missing))


def renaming(case: Case, element: SourceElement, wrong: str, right: str) -> tuple[Edit, ...]:
    """Return the edits that move the text of one attribute to another."""
    return (
        case.source.attribute_removal(element, wrong),
        case.source.attribute_edit(element, right, element.attributes[wrong]),
    )

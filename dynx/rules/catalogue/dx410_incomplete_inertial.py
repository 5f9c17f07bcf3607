"""DX410 incomplete-inertial: An inertial has no mass or no inertia tensor.

``<inertial>`` needs both ``<mass value="..."/>`` and ``<inertia .../>``. Often ``<mass>2.5</mass>`` was
written, which looks right but which no engine reads. A tensor without ``ixx``, ``iyy`` or ``izz`` is none:
``<inertia/>`` is what is left of a template.

- Pinocchio 4.1 reports that on stderr. Without a mass it drops the whole inertial, so the link weighs
  nothing; without a tensor the link is a point mass.
- PyBullet 3.2.7 and MuJoCo 4.0 refuse the file.
- Drake 1.51 reads missing parts as zero: a link with a mass and no tensor is a point mass. One with a tensor
  and no mass is impossible; Drake warns and replaces it.

The effect is a file that does not load, or a link without its mass: of order 0.01 to 1 in the mass matrix.

What to do: complete it. A number under a misspelled name, ``<mass valeu="1.5"/>`` or ``ixxx="0.02"``, is what
was meant; ``dynx doctor --fix`` corrects the name. Otherwise it can only guess, and the report says so: a
number between the tags, ``<mass>2.5</mass>``, is the mass; a tensor without mass is dropped, so that the link
weighs nothing; a mass without tensor stays as a point mass at the origin of the inertial, as in Pinocchio and
Drake. ``--choose DX410=weightless`` drops that mass too.
"""

from collections.abc import Iterable, Sequence

from dynx.errors import escaped
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import EVERY_ENGINE, Case, Correction, EditingRule, correction, found_at
from dynx.rules.attributes import misspelled_numbers, renaming
from dynx.rules.inertia import ZERO_TENSOR, zero_inertial
from dynx.rules.joints import text_in
from dynx.rules.numbers_in_text import is_number

_MOMENTS = ("ixx", "iyy", "izz")


class IncompleteInertial(EditingRule):
    stage = "reading"
    advice = "Give every <inertial> a <mass value> and an <inertia>."
    engines = EVERY_ENGINE
    choices = {
        "point": "make an inertial without mass zero, one without tensor a point mass",
        "weightless": "make an inertial without mass or tensor zero",
    }
    changed = "completed inertials that had no mass or no tensor"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the first inertial of each link, where it lacks something."""
        for link in case.source.root.all("link"):
            inertial = link.first("inertial")
            if inertial is not None:
                yield from self._in(case, inertial)

    def _in(self, case: Case, inertial: SourceElement) -> Iterable[Correction]:
        mass, tensor = inertial.first("mass"), inertial.first("inertia")
        misspelled = [
            found
            for element, names in ((mass, ("value",)), (tensor, _MOMENTS))
            if element is not None and (found := _misspelled(case, element, names)) is not None
        ]
        if misspelled:
            yield from misspelled
            return
        if mass is not None and "value" in mass.attributes:
            missing = [name for name in _MOMENTS if tensor is not None and name not in tensor.attributes]
            if tensor is None or missing:
                what = (
                    f"<inertia> has no {' and no '.join(missing)}"
                    if missing
                    else "<inertial> has no <inertia>"
                )
                yield correction(inertial, what, *self._without_tensor(case, inertial, tensor))
            return
        inside = "" if mass is None else text_in(case.source, mass)
        if mass is None or not is_number(inside):
            message = "<inertial> has no <mass>" if mass is None else "<mass> has no value"
            yield correction(inertial, message, case.source.replacement(inertial, zero_inertial()))
        else:
            edit = case.source.replacement(mass, f'<mass value="{inside}"/>')
            yield correction(mass, f"<mass> has {inside} between its tags and no value", edit)

    def _without_tensor(
        self, case: Case, inertial: SourceElement, tensor: SourceElement | None
    ) -> tuple[Edit, ...]:
        if self.chosen(case) == "weightless":
            return (case.source.replacement(inertial, zero_inertial()),)
        if tensor is not None:
            return (case.source.replacement(tensor, ZERO_TENSOR),)
        return (case.source.insertion(inertial, ZERO_TENSOR),)


def _misspelled(case: Case, element: SourceElement, names: Sequence[str]) -> Correction | None:
    """Return the correction of the names of attributes, where each that is missing has its number under a
    name that is close to it."""
    missing = [name for name in names if name not in element.attributes]
    meant = misspelled_numbers(element, missing)
    if not missing or len(meant) < len(missing):
        return None
    edits = [edit for right in missing for edit in renaming(case, element, meant[right], right)]
    texts = [f"{right} {element.attributes[meant[right]]} in {escaped(meant[right])}" for right in missing]
    detection = found_at(element, f"<{element.tag}> has its {' and its '.join(texts)}")
    return Correction(detection, tuple(edits), tuple(missing), whole=True)

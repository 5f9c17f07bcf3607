"""DX429 expression-in-collision: A number of a collision shape is an expression of xacro.

``<origin rpy="${3.14159/2} 0 0"/>`` is left in a file that was written as URDF and never passed through
``xacro``, or that was expanded by hand.

- MuJoCo 4.0 refuses the file ("bad format in attribute 'rpy'").
- PyBullet 3.2.7 reads 0, without a warning: the shape is elsewhere, or has no size.
- Pinocchio 4.1 and Drake 1.51 read no shapes into a model of the dynamics, and load the file.

In a ``<visual>`` every engine loads the file. In a joint or an ``<inertial>`` dynx refuses it, because the
dynamics depends on the number there.

What to do: write the number, or name the file ``.xacro`` and load it through ``xacro``. ``dynx doctor
--fix`` writes the value of mere arithmetic (numbers, ``pi``, ``+ - * /``), and removes a ``<collision>`` with
any other expression, because the file may not hold its value.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.model.xml.source import SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.text.number_text import Misspelling, misspelled_number, misspelled_vector
from dynx.rules.text.numeric_attributes import NumericAttribute, shape_attributes


class ExpressionInCollision(EditingRule):
    stage = "reading"
    advice = "Write the number, or expand the file with xacro."
    engines = measured_on("mujoco")
    changed = "wrote the values of expressions in collision shapes, or removed the shapes"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield one correction for each collision with such numbers, at the first."""
        for link in case.source.root.all("link"):
            for collision in link.all("collision"):
                found = [*_expressions(case, collision)]
                if not found:
                    continue
                first = found[0][0]
                text = shown(first.element.attributes[first.name])
                edits = [
                    case.source.attribute_edit(attribute.element, attribute.name, misspelling.meant)
                    for attribute, misspelling in found
                    if misspelling.meant
                ]
                if len(edits) < len(found):
                    edits = [case.source.removal(collision)]
                message = f"{first.name} of <{first.element.tag}> is {text}, which xacro did not expand"
                yield correction(first.element, message, *edits)


def _expressions(case: Case, collision: SourceElement) -> Iterable[tuple[NumericAttribute, Misspelling]]:
    for attribute in shape_attributes(collision):
        text = attribute.text_in(case.source)
        found = misspelled_number(text) if attribute.count == 1 else misspelled_vector(text)
        if found is not None and found.fault == "expression":
            yield attribute, found

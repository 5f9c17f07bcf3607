"""DX427 material-without-colour: A material of the robot has no name, no colour, or one of the wrong form.

A ``<material>`` directly in the robot defines a colour for its ``<visual>`` elements. Dynamics does not
depend on it; whether the file loads does:

- Drake 1.51 refuses the file for a material without name ("missing a required name"), without colour and
  texture ("has no color or texture information"), or whose ``rgba`` is not four numbers.
- MuJoCo 4.0 refuses the file for a ``<color>`` whose ``rgba`` is missing or not four numbers, in ``<visual>``
  too; it needs neither colour nor name.
- Pinocchio 4.1 and PyBullet 3.2.7 accept all of these.

What to do: write the name and the colour. ``dynx doctor --fix`` writes grey for a missing colour or one of
the wrong form, and removes a material without name, which nothing can refer to.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.model.xml.source import SourceElement, XmlSource
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.geometry import GREY
from dynx.rules.numbers_in_text import is_number


class MaterialWithoutColour(EditingRule):
    stage = "reading"
    advice = "Write the name and the colour of each material."
    engines = measured_on("drake", "mujoco")
    changed = "gave materials without colour a grey one, and removed those without name"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the materials directly in the robot that some engine refuses."""
        for material in case.source.root.all("material"):
            found = _correction(case.source, material)
            if found is not None:
                yield found


def _correction(source: XmlSource, material: SourceElement) -> Correction | None:
    name = material.attributes.get("name", "")
    if not name:
        return correction(material, "a material has no name", source.removal(material))
    color, texture = material.first("color"), material.first("texture")
    if color is None:
        if texture is not None and texture.attributes.get("filename"):
            return None
        grey = source.insertion(material, GREY, first=True)
        return correction(material, f"material {shown(name)} has neither colour nor texture", grey)
    rgba = color.attributes.get("rgba", "")
    words = rgba.split()
    if len(words) == 4 and all(map(is_number, words)):
        return None
    message = f"the colour of material {shown(name)} is {shown(rgba) if rgba else 'missing'}"
    return correction(color, f"{message}, not four numbers", source.replacement(color, GREY))

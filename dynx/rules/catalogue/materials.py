"""Materials and textures."""

from __future__ import annotations

from collections.abc import Iterable

from dynx.errors import shown
from dynx.model.xml.source import SourceElement, XmlSource
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.geometry import GREY, missing_texture, robot_textures
from dynx.rules.numbers_in_text import is_number


class MaterialDefinedTwice(EditingRule):
    """DX415 material-defined-twice: Two materials of the robot have the same name.

    Materials are only colours, but some engines refuse a second definition:

    - Pinocchio 4.1 ("material is not unique") and Drake 1.51 ("was previously defined") refuse the file.
    - PyBullet 3.2.7 prints a warning. MuJoCo 4.0 does not check.

    This happens when someone combines the files of an arm and of a hand.

    What to do: keep one definition. ``dynx doctor --fix`` keeps the first and removes the others, whatever
    their colour. It does not change materials inside ``<visual>``.
    """

    stage = "reading"
    advice = "Define each material once."
    engines = measured_on("pinocchio", "drake")
    changed = "removed further definitions of materials"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield materials directly in the robot whose name an earlier material has."""
        seen = set()
        for material in case.source.root.all("material"):
            name = material.attributes.get("name", "")
            if name in seen:
                message = f"material {shown(name)} is defined again"
                yield correction(material, message, case.source.removal(material))
            seen.add(name)


class TextureNotFound(EditingRule):
    """DX426 texture-not-found: A material of the robot has a texture that Drake does not find.

    A ``<material>`` directly in ``<robot>`` may name an image: ``<texture filename="wood.png"/>``.

    - Drake 1.51 looks for the image when it parses the file, with or without a scene graph. If the image is
      missing, it refuses the file ("which does not exist"). It finds a path relative to the robot file, and a
      ``file://`` path. It finds a ``package://`` path only if the program added the package to the parser
      (``parser.package_map().Add(name, folder)``). The documented call does not add packages.
    - Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 do not look for the image.
    - The texture of a material inside ``<visual>`` matters in Drake only with a scene graph (DX516).

    What to do: put the image where the file says it is, or give the material a colour. ``dynx doctor --fix``
    removes the texture. If the material has no colour, it becomes grey. ``--choose DX426=keep`` keeps the
    texture; Drake then refuses the file.
    """

    stage = "reading"
    advice = "Put the image where the file says it is, or give the material a colour."
    engines = measured_on("drake")
    choices = {
        "colour": "write a grey colour in place of textures that Drake does not find",
        "keep": "keep such textures; Drake then refuses the file",
    }
    changed = "write a grey colour in place of textures that Drake does not find"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the textures of materials of the robot whose file Drake does not find."""
        for material, texture in robot_textures(case.source):
            reason = missing_texture(texture, case.source.source)
            if reason is not None:
                name = shown(material.attributes.get("name", ""))
                coloured = material.first("color") is not None
                edit = case.source.removal(texture) if coloured else case.source.replacement(texture, GREY)
                yield correction(texture, f"material {name}: {reason}", edit)


class MaterialWithoutColour(EditingRule):
    """DX427 material-without-colour: A material of the robot has no name, no colour, or an invalid colour.

    A ``<material>`` directly in ``<robot>`` defines a colour for ``<visual>`` elements. The dynamics does not
    depend on it. But some engines refuse the file:

    - Drake 1.51 refuses a material without name ("missing a required name"), and a material without colour
      and texture ("has no color or texture information"). It also refuses an ``rgba`` that is not four
      numbers.
    - MuJoCo 4.0 refuses a ``<color>`` whose ``rgba`` is missing or not four numbers, even in a ``<visual>``.
      It accepts a material without colour or name.
    - Pinocchio 4.1 and PyBullet 3.2.7 accept all of these.

    What to do: write the name and the colour. ``dynx doctor --fix`` writes grey in place of a missing or
    wrong colour. It removes a material without name, because no other element can use it.
    """

    stage = "reading"
    advice = "Write the name and the colour of each material."
    engines = measured_on("drake", "mujoco")
    changed = "gave materials without colour a grey one, and removed those without name"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the materials directly in the robot that some engine refuses."""
        for material in case.source.root.all("material"):
            found = _material_correction(case.source, material)
            if found is not None:
                yield found


def _material_correction(source: XmlSource, material: SourceElement) -> Correction | None:
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

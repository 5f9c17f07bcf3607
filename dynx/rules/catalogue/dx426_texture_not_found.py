"""DX426 texture-not-found: A material of the robot has a texture that Drake does not find.

``<material>`` directly in the robot may name an image: ``<texture filename="wood.png"/>``.

- Drake 1.51 looks for the image when it parses the file, with or without a scene graph, and refuses the whole
  file where it is missing ("which does not exist"). It finds a path relative to the description and a
  ``file://`` path; a ``package://`` path only where the program added the package to the parser
  (``parser.package_map().Add(name, folder)``), which its documented call does not do.
- Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 do not look for it.
- The texture of a material inside ``<visual>`` matters in Drake only with a scene graph (DX516).

What to do: put the image where the description says it is, or give the material a colour.

``dynx doctor --fix`` puts a grey colour in place of the texture, unless the material has a colour.
``--choose DX426=keep`` keeps the texture, and Drake refuses the file.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.geometry import GREY, missing_texture, robot_textures


class TextureNotFound(EditingRule):
    stage = "reading"
    advice = "Put the image where the description says it is, or give the material a colour."
    engines = measured_on("drake")
    choices = {
        "colour": "put a grey colour in place of textures that Drake does not find",
        "keep": "keep them; Drake then refuses the file",
    }
    changed = "put a grey colour in place of textures that Drake does not find"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the textures of materials of the robot whose file Drake does not find."""
        for material, texture in robot_textures(case.source):
            reason = missing_texture(texture, case.source.source)
            if reason is not None:
                name = shown(material.attributes.get("name", ""))
                yield correction(texture, f"material {name}: {reason}", *self._edits(case, material, texture))

    def _edits(self, case: Case, material: SourceElement, texture: SourceElement) -> tuple[Edit, ...]:
        if self.chosen(case) == "keep":
            return ()
        if material.first("color") is not None:
            return (case.source.removal(texture),)
        return (case.source.replacement(texture, GREY),)

"""DX114 inertia-scaled-for-contact: A link has inertia_scaling, by which PyBullet alone multiplies its
inertia.

``<contact><inertia_scaling value="3.0"/></contact>`` is an extension of PyBullet's, intended to stabilise
contacts of light links. Many files that come with PyBullet, and files copied from them, have it.

- PyBullet 3.2.7 multiplies the moments of inertia of the link by the value, also with
  ``URDF_USE_INERTIA_FROM_FILE``, and in ``calculateInverseDynamics`` and ``calculateMassMatrix`` too. The
  mass stays.
- Pinocchio 4.1, MuJoCo 4.0 and Drake 1.51 do not know the tag. Neither does dynx: the value is no property of
  the robot.

The effect is that of a wrong tensor: a few per cent of the mass matrix at a scale of 3, more for light links
with reflected inertia.

What to do: remove the tag wherever the dynamics matters. ``dynx doctor --fix`` does so and leaves the rest of
``<contact>`` in place.
"""

from collections.abc import Iterable

from dynx.model.xml.source import SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.attributes import number_or_none


class InertiaScaledForContact(EditingRule):
    advice = "Remove <inertia_scaling>."
    engines = measured_on("pybullet")
    changed = "removed <inertia_scaling>"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the scales other than 1."""
        for link in case.source.root.all("link"):
            for contact in link.all("contact"):
                for scaling in contact.all("inertia_scaling"):
                    scale = _scale(scaling)
                    if scale != 1.0:
                        message = f"PyBullet multiplies the moments of inertia of the link by {scale:g}"
                        yield correction(scaling, message, case.source.removal(scaling))


def _scale(scaling: SourceElement) -> float:
    """Return the scale that PyBullet reads: 0 where the value is no number."""
    return number_or_none(scaling, "value") or 0.0

"""DX212 too-many-joints: The robot has more joints than PyBullet supports.

PyBullet 3.2.7 has room for 127 joints, and counts fixed ones. From the 128th on ``getJointState`` and
``getLinkState`` fail, so there are no positions; above 128 coordinates ``calculateInverseDynamics``,
``calculateMassMatrix`` and ``calculateJacobian`` return wrong results without a warning (20 % at 129). Hands
with sensors and robots with many named frames exceed this: ``tiago_dual`` of example-robot-data has 129
joints.

Pinocchio 4.1, MuJoCo 4.0 and Drake 1.51 have no such limit.

What to do: drop frames that PyBullet does not need. ``dynx doctor --fix`` removes links that have no mass,
nothing attached to them and a fixed joint: that is, frames. It removes as few as are needed, those without
shapes and at the end of the file first. The dynamics is unchanged; programs that use these frames need the
original file. ``--choose DX212=keep`` keeps them, and PyBullet cannot load the robot. Where there are not
enough of them, or too many joints move, there is no remedy.
"""

from collections.abc import Iterable, Iterator, Sequence

from dynx.engines.pybullet.file_checks import MAX_JOINTS
from dynx.model import Model
from dynx.model.elements import Link
from dynx.rules import Case, Detection, Remedy, Rule, measured_on


class TooManyJoints(Rule):
    advice = "Drop links that are mere frames from the file for PyBullet."
    engines = measured_on("pybullet")
    choices = {
        "drop": "remove frames without mass at the ends of the robot until 127 joints are left",
        "keep": "keep all links; PyBullet then cannot load the robot",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first joint too many, in document order."""
        joints = case.source.root.all("joint")
        if len(joints) <= MAX_JOINTS:
            return []
        message = f"the robot has {len(joints)} joints, fixed ones included; PyBullet accepts {MAX_JOINTS}"
        return [Detection(None, None, joints[MAX_JOINTS].line, message)]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Remove as many links without mass as there are joints too many."""
        excess = len(case.joints) - MAX_JOINTS
        if self.chosen(case) == "keep" or excess <= 0:
            return None
        dropped = _frames(case)[:excess]
        if len(dropped) < excess:
            return None
        source, carriers = case.source, {joint.child: joint.name for joint in case.model.joints}
        edits = []
        for name in dropped:
            edits += [source.removal(case.links[name]), source.removal(case.joints[carriers[name]])]
        return Remedy(
            case.with_source(source.apply(*edits)),
            f"removed {len(dropped)} links that are mere frames",
            self.decision(case),
        )


def _frames(case: Case) -> list[str]:
    """List the links that can be removed, each before its parent: those without shapes first, the last of the
    document before others."""
    plain: list[str] = []
    shaped: list[str] = []
    for name in _massless_ends(case.model):
        shapes = case.links[name].all("visual") + case.links[name].all("collision")
        (shaped if shapes else plain).append(name)
    return plain + shaped


def _massless_ends(model: Model) -> Iterator[str]:
    attached = dict.fromkeys((link.name for link in model.links), 0)
    for joint in model.joints:
        attached[joint.parent] += 1
    links = {link.name: link for link in model.links}
    # Depth-first order lists a link before what hangs on it, so backwards the ends come first.
    for joint in reversed(model.joints):
        if joint.type == "fixed" and not attached[joint.child] and not _has_inertia(links[joint.child]):
            attached[joint.parent] -= 1
            yield joint.child


def _has_inertia(link: Link) -> bool:
    inertial = link.inertial
    return inertial is not None and (inertial.mass != 0.0 or bool(inertial.tensor.any()))

"""DX531 left-over-xacro: The file has xacro elements, which every engine skips with all that they hold.

``<xacro:property>``, ``<xacro:include>`` or the call of a macro is left in a file that was expanded by hand
or renamed from ``.xacro`` to ``.urdf``. The program ``xacro`` evaluates such elements; readers of URDF do not
know them. Pinocchio 4.1, PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 load the rest without a warning, and so
does dynx, with a note. They agree, but links, joints and inertias that a macro would write are not in the
robot.

Expressions such as ``${mass}`` in a number are another matter: no two engines read them alike, and dynx
refuses them.

What to do: expand the file with ``xacro``, or load the ``.xacro`` file itself. Where nothing is missing,
remove the elements: ``dynx doctor --fix`` does so with ``--choose DX531=remove``, and by default leaves them.
An attribute ``xmlns:xacro`` of the robot does no harm and is not reported.
"""

from collections.abc import Iterable, Iterator

from dynx.errors import escaped
from dynx.model.xml.source import SourceElement
from dynx.rules import Case, Correction, OptionalEditingRule, correction

_PREFIX = "xacro:"


class LeftOverXacro(OptionalEditingRule):
    stage = "reading"
    skipped = "xacro elements that were not expanded"
    advice = "Expand the file with xacro, or remove these elements."
    choices = {
        "keep": "leave xacro elements, which every engine skips, in the file",
        "remove": "remove xacro elements, which every engine skips",
    }
    changed = "removed xacro elements"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield one correction for each tag, at its first element."""
        by_tag: dict[str, list[SourceElement]] = {}
        for element in _outermost(case.source.root):
            by_tag.setdefault(element.tag, []).append(element)
        for tag, elements in by_tag.items():
            times = "" if len(elements) == 1 else f" ({len(elements)} times)"
            message = f"engines skip <{escaped(tag)}>{times}, which xacro did not expand"
            yield correction(elements[0], message, *map(case.source.removal, elements))


def _outermost(root: SourceElement) -> Iterator[SourceElement]:
    """Yield the xacro elements that are in no other, in document order."""
    waiting = [root]
    while waiting:
        element = waiting.pop()
        if element.tag.startswith(_PREFIX):
            yield element
        else:
            waiting.extend(reversed(element.children))

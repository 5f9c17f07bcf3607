"""DX532 malformed-xml: The text is not well-formed XML, which engines forgive and other programs do not.

All engines parse URDF by tinyxml2, which is lenient: ``--`` in a comment, ``&`` or ``<`` in a name,
attributes without white space between them, a blank behind ``<``, a malformed or second XML declaration, text
in front of the robot and elements behind it. Pinocchio 4.1, PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 load
such a file without a warning, and read the same robot. Python's XML parsers, xacro and the launch system of
ROS refuse it.

dynx reads the file as the engines do, with a note; faults that tinyxml2 refuses too (an attribute that occurs
twice or has no quotes, an element that does not end) it refuses with their line.

What to do: correct the fault. No remedy of ``dynx doctor`` is needed: each file that it writes is
well-formed.
"""

from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule


class MalformedXml(Rule):
    stage = "reading"
    kind = "practice"
    advice = "Write well-formed XML."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first fault of each kind."""
        return [Detection(None, None, each.line, each.message) for each in case.source.repairs]

"""DX423 processing-instruction: The file has a processing instruction, which no engine accepts.

``<?xml-stylesheet ...?>`` or the mark of an editor, ``<?foo bar?>``, is legal anywhere in XML. tinyxml2, by
which all engines parse URDF, knows only declarations, and only at the beginning of the file.

- Pinocchio 4.1, PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 refuse the file, unless nothing but declarations
  precedes it.
- dynx reads the file without the instruction, as XML defines it.

What to do: remove the instruction. ``dynx doctor --fix`` does so; no engine reads anything in it.
"""

from collections.abc import Iterable, Iterator
from xml.parsers import expat

from dynx.errors import shown
from dynx.model.xml.source import Edit, XmlSource
from dynx.rules import EVERY_ENGINE, Case, Correction, Detection, EditingRule


class ProcessingInstruction(EditingRule):
    stage = "reading"
    advice = "Remove the processing instruction."
    engines = EVERY_ENGINE
    changed = "removed processing instructions"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the instructions behind anything but declarations."""
        source = case.source
        lines_before = len(source.text_with_lines_before) - len(source.text)
        for start, end, line, target in _instructions(source):
            message = f"engines refuse the processing instruction {shown(f'<?{target}')}"
            yield Correction(Detection(None, None, line + lines_before, message), (Edit(start, end, ""),))


def _instructions(source: XmlSource) -> Iterator[tuple[int, int, int, str]]:
    """Yield start and end [bytes], line and target of each such instruction."""
    found: list[tuple[int, int, int, str]] = []
    parser = expat.ParserCreate(encoding="utf-8")

    def instruction(target: str, _: str) -> None:
        start = parser.CurrentByteIndex
        end = source.data.index(b"?>", start) + len(b"?>")
        found.append((start, end, parser.CurrentLineNumber, target))

    parser.ProcessingInstructionHandler = instruction
    parser.Parse(source.data, True)
    # Declarations at the beginning, and instructions among them, are read.
    at = source.data.index(b"?>") + len(b"?>") if source.data.startswith(b"<?xml ") else 0
    for start, end, line, target in found:
        if not source.data[at:start].strip():
            at = end
        else:
            yield start, end, line, target

"""DX422 lone-carriage-return: A line ends with a carriage return alone, and PyBullet loses the text behind
it.

Programs end a line with a line feed (Linux, macOS), or with a carriage return and a line feed (Windows). A
carriage return alone ended lines on the Macintosh until 2001. Today it comes from conversions of line ends
and from pasted text: in a whole file, or in a single place that no editor shows.

- PyBullet 3.2.7 reads up to the next line feed, at most 8191 bytes, and drops all behind the first carriage
  return. Where that leaves no well-formed XML, or an element is missing that it requires, it refuses the file
  ("Cannot load URDF file"). Where whole elements are lost, such as an ``<axis>`` or an ``<origin>``, it loads
  another robot without a warning.
- Pinocchio 4.1, MuJoCo 4.0 and Drake 1.51 read a carriage return as a line end, as XML has it. Their errors
  count line feeds only: each fault of such a file is in line 1. The lines in reports of dynx count both.

A carriage return with nothing but blanks between it and the line feed has no effect and is not reported.

What to do: save the file with line feeds. ``dynx doctor --fix`` writes a line feed for each such carriage
return.
"""

import re
from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, measured_on

_LONE = re.compile(rb"\r(?![ \t\r]*(?:\n|\Z))")


class LoneCarriageReturn(Rule):
    stage = "reading"
    advice = "Save the file with line feeds."
    engines = measured_on("pybullet")
    unambiguous = True

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first such line end."""
        first = _LONE.search(case.source.data)
        if first is None:
            return
        count = len(_LONE.findall(case.source.data))
        lines = "a line ends" if count == 1 else f"{count} lines end"
        line = case.source.line_at(first.start())
        yield Detection(None, None, line, f"{lines} with a carriage return alone")

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the file with line feeds."""
        mended = case.with_source(case.source.with_line_feeds())
        return Remedy(mended, "wrote a line feed for each carriage return that stands alone")

"""Commands of the tutorial:

python -m docs.tutorial write FOLDER      the program and the notebook of each step
python -m docs.tutorial pictures [STEP]   run the pages and draw their pictures (extras viewer, plot)
"""

from __future__ import annotations

import sys
from pathlib import Path

from docs.tutorial import pages


def main(arguments: list[str]) -> int:
    """Run one of the commands; return the exit code."""
    if len(arguments) == 2 and arguments[0] == "write":
        for path in pages.write(Path(arguments[1])):
            print(path)
        return 0
    if arguments[:1] == ["pictures"] and all(step in _numbers() for step in arguments[1:]):
        from docs.tutorial import pictures

        for step in arguments[1:] or _numbers():
            pictures.draw(pages.STEPS[int(step) - 1])
        return 0
    print(__doc__, file=sys.stderr)
    return 2


def _numbers() -> list[str]:
    """Return the numbers of the steps."""
    return [str(number) for number in range(1, len(pages.STEPS) + 1)]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""All attacks, each against a process of its own under strace::

    python -m tests.security.attacks [--published] [SURFACE ...]

prints a table by surface and kind, and what is wrong with the end of each victim; exits with 1 if there is
anything. With --published only those of the modules `published_...`.
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

from tests.security.attack import KINDS
from tests.security.surfaces.every import ATTACKS
from tests.security.victims import attacked_apart


def main(words: list[str]) -> int:
    surfaces = [each for each in words if each != "--published"]
    chosen = [
        each
        for each in ATTACKS
        if (not surfaces or any(each.key.startswith(name) for name in surfaces))
        and ("--published" not in words or ".published_" in each.prepare.__module__)
    ]
    done: Counter[tuple[str, str]] = Counter()
    failed: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory(prefix="dynx-attacks-") as folder:
        for attack in chosen:
            found = attacked_apart(attack, Path(folder))
            done[attack.surface, attack.kind] += 1
            failed[attack.surface, attack.kind] += bool(found)
            print(
                f"{'FAILS' if found else 'held '} {attack.surface}: {attack.kind}: {attack.name}", flush=True
            )
            for each in found:
                print(f"      {each}", flush=True)
    print(f"\n{'surface':14}" + "".join(f"{kind:>10}" for kind in KINDS) + f"{'all':>8}")
    for surface in dict.fromkeys(each.surface for each in chosen):
        cells = [_cell(failed[surface, kind], done[surface, kind]) for kind in KINDS]
        total = sum(count for (name, _), count in done.items() if name == surface)
        print(f"{surface:14}" + "".join(f"{cell:>10}" for cell in cells) + f"{total:>8}")
    print(f"\n{len(chosen)} attacks, {sum(failed.values())} not held")
    return 1 if sum(failed.values()) else 0


def _cell(failed: int, done: int) -> str:
    return f"{failed} of {done}" if failed else str(done or "")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

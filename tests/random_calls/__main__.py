"""Random calls, as many as wanted::

    python -m tests.random_calls --seed 1 --calls 2000

prints each call that raises something else than an error of dynx, takes too long or ends the process, and
exits with 1 if there is one. It counts the errors whose messages omit the argument's name, what was given, or
what is valid; ``--messages`` prints them.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import warnings
from collections import Counter

from tests.random_calls.calls import outcome, random_call
from tests.random_calls.messages import omissions


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.random_calls", description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--calls", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0, help="number of the first call")
    parser.add_argument("--messages", action="store_true", help="print errors that omit something")
    parser.add_argument("-v", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    faults = errors = incomplete = 0
    omitted: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for number in range(arguments.first, arguments.first + arguments.calls):
            call = random_call(arguments.seed, number)
            if call is None:
                continue
            if arguments.v:
                print(number, call, file=sys.stderr, flush=True)
            wrong, error = outcome(call)
            missing = [] if wrong is not None or error is None else omissions(call, error)
            errors += error is not None
            if missing:
                omitted.update(missing)
                incomplete += 1
                if arguments.messages:
                    print(f"{number}: {call}\n    omits {', '.join(missing)}: {error}\n", flush=True)
            if wrong is not None:
                faults += 1
                print(f"{number}: {call}\n    {wrong}\n", flush=True)
    print(f"{faults} faults in {arguments.calls} calls")
    counts = ", ".join(f"{count} {what}" for what, count in omitted.items()) or "nothing"
    print(f"{errors} errors of dynx, of which {incomplete} omit something ({counts})")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())

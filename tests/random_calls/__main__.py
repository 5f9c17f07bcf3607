"""Random calls, as many as wanted::

    python -m tests.random_calls --seed 1 --calls 2000

prints each call that raises something else than an error of dynx, takes too long or ends the process, and
exits with 1 if there is one.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import warnings

from tests.random_calls.calls import fault, random_call


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.random_calls", description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--calls", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0, help="number of the first call")
    parser.add_argument("-v", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    faults = 0
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for number in range(arguments.first, arguments.first + arguments.calls):
            call = random_call(arguments.seed, number)
            if call is None:
                continue
            if arguments.v:
                print(number, call, file=sys.stderr, flush=True)
            wrong = fault(call)
            if wrong is not None:
                faults += 1
                print(f"{number}: {call}\n    {wrong}\n", flush=True)
    print(f"{faults} faults in {arguments.calls} calls")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())

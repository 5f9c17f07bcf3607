"""``python -m dynx`` is the command line `dynx`."""

from __future__ import annotations

from dynx.cli.shell.main import main

if __name__ == "__main__":
    main()

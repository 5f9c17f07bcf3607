"""What dynx publishes for testing with Hypothesis: see `dynx.testing.strategies`.

Needs the extra ``testing`` (``pip install "dynx[testing]"``).
"""

from __future__ import annotations

from importlib.util import find_spec

from dynx.errors import NotInstalledError

if find_spec("hypothesis") is None:
    raise NotInstalledError(
        "dynx.testing needs the package hypothesis, which is not installed; "
        'pip install "dynx[testing]" brings it'
    )

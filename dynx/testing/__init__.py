"""Tests of robots for other test suites.

- `assert_same_robot`: an assertion that two descriptions are those of one robot
- `agreement_tests`: one line in a test file of yours tests the agreement of engines on your robot
- `dynx.testing.plugin`: the same for ``pytest --dynx-robot my.urdf``, without a test file
- `dynx.testing.strategies`: Hypothesis strategies for robots and states (the extra ``testing``)

Importing this package imports neither Hypothesis nor an engine: pytest imports it for the plugin.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dynx.registry import moved_names

if TYPE_CHECKING:
    from dynx.testing.agreement_class import agreement_tests
    from dynx.testing.same_assertion import assert_same_robot

__all__ = ["agreement_tests", "assert_same_robot"]

# Hidden from type checkers, which would take any name for an attribute: they know the import above.
if not TYPE_CHECKING:
    __getattr__ = moved_names(
        __name__,
        {},
        {
            "agreement_tests": "dynx.testing.agreement_class",
            "assert_same_robot": "dynx.testing.same_assertion",
        },
    )

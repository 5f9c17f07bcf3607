"""The names of engines that move scenes."""

from __future__ import annotations

import pytest

from dynx.errors import NotInstalledError
from dynx.steppers.layout import EMPTY
from dynx.steppers.registry import BUILT_IN, world_class
from dynx.steppers.stepper import Feature


@pytest.mark.parametrize("name", BUILT_IN)
def test_engines_of_dynx_have_contacts(name: str) -> None:
    try:
        kind = world_class(name)
    except NotInstalledError as error:
        pytest.skip(str(error))
    assert Feature.CONTACTS in kind.provides(EMPTY)

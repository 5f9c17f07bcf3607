"""The names of engines that move scenes."""

from __future__ import annotations

import pytest

from dynx.errors import NotInstalledError
from dynx.steppers import registry
from dynx.steppers.layout import EMPTY
from dynx.steppers.registry import BUILT_IN, installed_worlds, world_class
from dynx.steppers.stepper import Feature, Stepper


@pytest.mark.parametrize("name", BUILT_IN)
def test_engines_of_dynx_have_contacts(name: str) -> None:
    try:
        kind = world_class(name)
    except NotInstalledError as error:
        pytest.skip(str(error))
    assert Feature.CONTACTS in kind.provides(EMPTY)


def test_an_engine_that_is_not_installed_hides_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    installed = installed_worlds()
    absent: set[str] = set()

    def find(name: str) -> type[Stepper]:
        if name in absent:
            raise NotInstalledError(f"{name} is not installed")
        return world_class(name)

    monkeypatch.setattr(registry, "world_class", find)
    for name in installed[1:]:
        absent = {name}
        assert installed_worlds() == tuple(other for other in installed if other != name)
    absent = set(installed[:-1])
    assert installed_worlds() == installed[-1:]
    absent = set(installed)
    with pytest.raises(NotInstalledError, match="no engine for worlds with contacts"):
        installed_worlds()

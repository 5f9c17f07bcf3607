"""Functions as arguments: what cannot be called as it will be is refused before the work begins."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

import dynx
from dynx.argument_types import checks_types
from dynx.errors import DTypeError
from dynx.world import Scene, SceneRobot, World, scene_to_mjcf
from tests.world.engines import WORLDS


@checks_types
def work(report: Callable[[str, float], object] | None = None, free: Callable[..., object] = print) -> None:
    """Take functions."""


class Reporter:
    def report(self, text: str, share: float) -> None: ...

    def __call__(self, text: str) -> None: ...


@pytest.mark.parametrize(
    "report",
    [
        lambda a, b: None,
        lambda *a: None,
        lambda a, b, c=1: None,
        Reporter().report,
        partial(lambda a, b, c: None, 1),
        print,
        max,  # it shows no signature
        None,
    ],
)
def test_what_can_be_called_is_taken(report: Any) -> None:
    work(report, free=lambda: None)


@pytest.mark.parametrize(
    ("report", "given"),
    [
        (lambda: None, "a lambda, which takes ()"),
        (lambda a: None, "a lambda, which takes (a)"),
        (lambda a, b, *, c: None, "a lambda, which takes (a, b, *, c)"),
        (Reporter(), "Reporter, which takes (text: 'str') -> 'None'"),
        (Reporter.report, "report, which takes (self, text: 'str', share: 'float') -> 'None'"),
    ],
)
def test_what_takes_other_arguments_is_named_with_its_parameters(report: Any, given: str) -> None:
    with pytest.raises(DTypeError) as refused:
        work(report)
    assert str(refused.value) == f"report is {given}; wanted a function that is called with 2 arguments"


def test_public_functions_refuse_a_function_of_other_arguments() -> None:
    calls: list[Any] = [dynx.agree, dynx.diagnose]
    for call in calls:
        with pytest.raises(
            DTypeError, match=r"progress is a lambda, which takes \(\); wanted a function that"
        ):
            call("ur5", progress=lambda: None)
    model = dynx.load("ur5")
    with World(Scene("one", robots=[SceneRobot("arm", model)]), WORLDS[0]) as world:
        wrong: list[Any] = [lambda: None, lambda world, time: {}]
        for loads in wrong:
            with pytest.raises(DTypeError, match=r"loads is a lambda, .*; wanted a function of the world"):
                world.run(0.01, loads=loads)
        with pytest.raises(DTypeError, match=r"loads is '5', of type int; wanted a function of the world"):
            world.run(0.01, loads=5)  # type: ignore[arg-type]
        assert world.time == 0.0


@pytest.mark.parametrize("option", ["joint_damping", "joint_friction", "joint_armature"])
@pytest.mark.parametrize("make", [World, scene_to_mjcf])
def test_a_scene_takes_no_number_for_what_the_description_states(make: Any, option: str) -> None:
    scene = Scene("one", robots=[SceneRobot("arm", dynx.load("planar_2r"))])
    wanted = (
        rf"^{option} is '0\.4', of type float; wanted True \(as described\) or False; dynx\.simulate takes"
    )
    with pytest.raises(DTypeError, match=wanted):
        make(scene, **{option: 0.4})

"""Exact values of cases that slide, spin, tip or are driven, against numbers found without them.

The numbers were computed outside of dynx: the motion of rods, tops and balls that collide by an integration
of rigid bodies on stiff springs with Coulomb's friction (SciPy's Radau and LSODA), the wedge by its four
linear equations for accelerations and the normal force, the ball on a turntable by an integration of the
condition of rolling, the chain joint by joint, and the pressure below plates by quadrature.
"""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from dynx.contacts import find_case
from dynx.world import World
from tests.world.engines import WORLDS

ENGINE = next((name for name in WORLDS if find_spec(name) is not None), "")

EXACT: dict[tuple[str, str], dict[str, float | tuple[float, float]]] = {
    ("fast_slide", "flat"): {"deceleration": 3.924, "largest tilt": 0.0},
    ("fast_slide", "cube"): {"deceleration": 3.924, "largest tilt": 0.0},
    ("fast_slide", "cube, friction 0.6"): {"deceleration": 5.886, "largest tilt": 0.0},
    ("oblique_impact", "slides"): {
        "speed of the separation": 1.0,
        "impulse of friction": 0.1,
        "moving ball": 2.0,
        "hit ball": 0.0,
        "momentum across": 2.0,
    },
    ("oblique_impact", "sticks"): {
        "speed of the separation": 1.0,
        "slip after the impact": 0.0,
        "moving ball": 1.0,
        "hit ball": 0.0,
        "momentum across": 1.0,
    },
    ("free_wedge", "friction 0"): {"of the wedge": -1.783636, "of the block": 5.982498, "momentum": 0.0},
    ("free_wedge", "friction 0.2"): {"of the wedge": -1.110566, "of the block": 3.724952, "momentum": 0.0},
    ("conveyor", ""): {
        "acceleration of the block": 3.924,
        "length of the slide": 0.127421,
        "speed of the block": 0.0,
        "speed of the belt": 1.0,
    },
    ("turntable", "block"): {"speed of the table": 3.0, "force towards the axis": 2.699595, "slip": 0.0},
    ("turntable", "ball"): {"speed of the table": 3.0, "distance of the ball": 0.0, "speed of the ball": 0.5},
    ("capstan", "towards the pull"): {"ratio of the forces": 2.629261},
    ("capstan", "against the pull"): {"ratio of the forces": 0.380335},
    ("falling_rod", "friction 0"): {"at 0.6 rad": 2.796806, "at 0.9 rad": 3.718773},
    ("falling_rod", "friction 0.1"): {"at 0.6 rad": 2.607643, "at 0.9 rad": 3.583922},
    ("falling_rod", "friction 1"): {"at 0.6 rad": 1.90822, "at 0.9 rad": 3.07528},
    ("tippe_top", ""): {"tilt of the axis": 1.043096, "angular velocity about the vertical": 24.48261},
    ("spinning_plate", "square"): {"mean distance of the pressure": (0.0, 1.0)},
    ("spinning_plate", "disc"): {"mean distance of the pressure": (0.0, 1.0)},
}
"""By case and trial, for a part of the name of each figure: its exact value, or its bounds."""

INTEGRATED = 3e-5
"""Relative error of the numbers: of the springs and the regularised friction, and of the digits given."""

AT_TURNTABLE = (0.542417, 0.052756)
"""Position [m] of the ball on the turntable after 0.5 s."""


@pytest.mark.parametrize(("name", "trial"), EXACT)
def test_exact_values_are_those_of_other_computations(name: str, trial: str) -> None:
    if not ENGINE:
        pytest.skip("needs an engine with contacts")
    case = find_case(name)
    parameters = case.trials[trial]
    with World(case.scene(parameters), ENGINE, 4e-3, contact_interval=case.contact_interval) as world:
        figures = case.measure(world, parameters)
        expected = EXACT[name, trial]
        assert len(figures) == len(expected)
        for (part, value), figure in zip(expected.items(), figures, strict=True):
            assert part in figure.name
            least, most = value if isinstance(value, tuple) else (value, None)
            assert figure.exact == pytest.approx(least, rel=INTEGRATED, abs=1e-12)
            assert figure.most == most
            # Bounds are relative to the distance of the farthest point.
            assert most is None or figure.scale == 1.0
        if (name, trial) == ("turntable", "ball"):
            # The figure is the distance from the orbit, which is exact where the ball of an integration is.
            x, y, _ = world.state.bodies["ball"].position.tolist()
            away = float(((x - AT_TURNTABLE[0]) ** 2 + (y - AT_TURNTABLE[1]) ** 2) ** 0.5)
            assert figures[1].measured == pytest.approx(away, abs=2e-6)
            # Its error is relative to the radius of the orbit.
            assert figures[1].scale == pytest.approx(0.583333, rel=1e-5)
        if name == "free_wedge":
            gained = 2.0 * abs(float(world.state.bodies["wedge"].twist[0]))
            assert figures[2].scale == pytest.approx(gained)


def test_no_case_of_these_has_a_trial_that_is_not_compared() -> None:
    for name in {each for each, _ in EXACT}:
        assert {trial for case, trial in EXACT if case == name} == set(find_case(name).trials)


def test_a_plate_under_uniform_pressure_would_have_the_deceleration_of_mechanics() -> None:
    """A square of 0.4 m under friction 0.5: 28.15 rad/s^2, and 52.03 with all pressure at its corners."""
    plate = find_case("spinning_plate").trials["square"]
    for share, slowing in ((0.541075, 28.1498), (1.0, 52.0254)):
        assert 0.5 * 9.81 * share * plate.farthest / plate.gyration == pytest.approx(slowing, rel=1e-5)

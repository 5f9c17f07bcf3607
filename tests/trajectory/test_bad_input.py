"""Invalid arguments of every trajectory function, and their errors."""

from __future__ import annotations

import pickle
import re
import sys
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import trajectory
from dynx.errors import (
    ArgumentError,
    DTypeError,
    DynxError,
    NotFiniteError,
    NotInstalledError,
    ShapeError,
    TrajectoryError,
    UnknownNameError,
)
from tests.trajectory.motions import REACH, floating, ur5

NAN, INF = float("nan"), float("inf")
IN_TIME = (trajectory.cycloidal, trajectory.cubic, trajectory.quintic)
SLOW = trajectory.cubic([0.0], [1.0], 1.0)
HALF = trajectory.cubic([0.0], [0.5], 1.0)
BEYOND = trajectory.quintic([0.0], [1.0], 1.0, v1=[3.0])


@pytest.mark.parametrize("made", IN_TIME)
@pytest.mark.parametrize("duration", [0.0, -1.0, NAN, INF, "1", None, True])
def test_durations(made: Any, duration: Any) -> None:
    with pytest.raises(ArgumentError, match=r"duration is .*; wanted a positive number of seconds"):
        made([0.0], [1.0], duration)


@pytest.mark.parametrize("made", IN_TIME)
@pytest.mark.parametrize("duration", [1e-31, 1e31])
def test_durations_out_of_all_proportion(made: Any, duration: float) -> None:
    """Durations whose powers would overflow raise; those just inside the bounds do not."""
    with pytest.raises(ArgumentError, match=r"wanted between 1e-30 and 1e\+30 s"):
        made([0.0], [1.0], duration)
    for possible in (1e-30, 1e30):
        assert all(np.isfinite(x).all() for x in made([0.0], [1.0], possible)(0.3 * possible))


@pytest.mark.parametrize(("limit", "way"), [(1e-300, 1.0), (1e300, 1.0), (1e300, 1e-300)])
def test_limits_out_of_all_proportion(limit: float, way: float) -> None:
    ends: Any = ([0.0], [way])
    with pytest.raises(TrajectoryError, match=r"takes .* s; wanted between 1e-30 and"):
        trajectory.trapezoidal(*ends, velocity=limit, acceleration=limit)
    with pytest.raises(TrajectoryError, match=r"takes .* s; wanted between 1e-30 and"):
        trajectory.s_curve(*ends, velocity=limit, acceleration=limit, jerk=limit)


@pytest.mark.parametrize("made", IN_TIME)
@pytest.mark.parametrize(
    ("q0", "q1", "error", "message"),
    [
        ([NAN], [0.0], NotFiniteError, r"q0\[0\] is nan"),
        ([0.0], [INF], NotFiniteError, r"q1\[0\] is inf"),
        ([0.0], [0.0, 1.0], ShapeError, r"q0 has shape \(1,\) and q1 \(2,\)"),
        ([[0.0]], [[1.0]], ShapeError, r"q0 has shape \(1, 1\); wanted \(nq,\)"),
        (0.0, 1.0, ShapeError, r"q0 has shape \(\)"),
        ([], [], ShapeError, r"q0 has shape \(0,\)"),
        (["a"], [0.0], DTypeError, "q0 has dtype"),
        ([1e80], [0.0], ArgumentError, "products of larger numbers overflow"),
    ],
)
def test_configurations(made: Any, q0: Any, q1: Any, error: type[DynxError], message: str) -> None:
    with pytest.raises(error, match=message):
        made(q0, q1, 1.0)


def test_velocities_at_the_ends() -> None:
    with pytest.raises(ShapeError, match=r"v0 has shape \(2,\); wanted \(\.\.\., 1\)"):
        trajectory.cubic([0.0], [1.0], 1.0, v0=[0.0, 0.0])
    with pytest.raises(ShapeError, match=r"a1 has shape \(2, 1\); wanted \(1,\)"):
        trajectory.quintic([0.0], [1.0], 1.0, a1=[[0.0], [0.0]])
    model = floating()
    with pytest.raises(ArgumentError, match=r"v1\[:6\] is not 0; a floating base"):
        trajectory.cubic(model.neutral(), model.neutral(), 1.0, v1=np.ones(model.nv), model=model)


def test_models() -> None:
    model: Any = "ur5"
    with pytest.raises(ArgumentError, match="model is 'ur5', of type str; wanted a Model"):
        trajectory.cycloidal([0.0], [1.0], 1.0, model=model)
    with pytest.raises(ShapeError, match=r"q0 has shape \(1,\); wanted \(\.\.\., 6\)"):
        trajectory.cycloidal([0.0], [1.0], 1.0, model=ur5())
    q = floating().neutral()
    with pytest.raises(ArgumentError, match="quaternion"):
        trajectory.cycloidal(q, 0.0 * q, 1.0, model=floating())


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"velocity": -1.0}, ArgumentError, r"velocity\[0\] is -1; wanted 0 or more"),
        ({"acceleration": NAN}, ArgumentError, r"acceleration\[0\] is nan; wanted 0 or more"),
        ({"jerk": [1.0, -2.0]}, ArgumentError, r"jerk\[1\] is -2"),
        (
            {"velocity": [1.0, 0.0]},
            TrajectoryError,
            "coordinate 1 has to move by 2 but its limit of velocity is 0",
        ),
        (
            {"acceleration": 0.0},
            TrajectoryError,
            "coordinate 0 has to move by 1 but its limit of acceleration",
        ),
        ({"jerk": 0.0}, TrajectoryError, "its limit of jerk is 0"),
        ({"jerk": INF}, ArgumentError, "jerk is infinite for everything that moves"),
        (
            {"velocity": [1.0, 1.0, 1.0]},
            ShapeError,
            r"velocity has shape \(3,\); wanted one number, or \(2,\)",
        ),
        ({"velocity": None}, ArgumentError, "neither velocity nor a model"),
        ({"acceleration": "fast"}, DTypeError, "acceleration has dtype"),
        ({"duration": 0.1}, TrajectoryError, "duration is 0.1; within the limits the motion takes at least"),
        ({"duration": -1.0}, ArgumentError, "duration is '-1.0'; wanted a positive number"),
    ],
)
def test_limits(options: dict[str, Any], error: type[DynxError], message: str) -> None:
    usual: dict[str, Any] = {"velocity": 1.0, "acceleration": 1.0, "jerk": 1.0}
    with pytest.raises(error, match=message):
        trajectory.s_curve([0.0, 0.0], [1.0, 2.0], **{**usual, **options})
    if "jerk" not in options:
        del usual["jerk"]
        with pytest.raises(error, match=message):
            trajectory.trapezoidal([0.0, 0.0], [1.0, 2.0], **{**usual, **options})


def test_a_trapezoid_needs_a_limit_of_acceleration() -> None:
    with pytest.raises(ArgumentError, match="acceleration is infinite for everything that moves"):
        trajectory.trapezoidal([0.0], [1.0], velocity=1.0, acceleration=INF)


def test_a_joint_that_does_not_move_may_have_a_velocity_limit_of_0() -> None:
    motion = trajectory.trapezoidal([0.0, 1.0], [1.0, 1.0], velocity=[1.0, 0.0], acceleration=[1.0, 0.0])
    assert motion(0.5).q[1] == 1.0


def test_standing_still_takes_a_duration() -> None:
    for made in (trajectory.trapezoidal, trajectory.s_curve):
        options: dict[str, Any] = {"velocity": 1.0, "acceleration": 1.0}
        if made is trajectory.s_curve:
            options["jerk"] = 1.0
        with pytest.raises(ArgumentError, match="q0 and q1 are the same; give a duration"):
            made([1.0], [1.0], **options)
        motion = made([1.0], [1.0], duration=2.0, **options)
        assert motion(1.3).q[0] == 1.0
        assert motion(1.3).v[0] == motion(1.3).a[0] == 0.0


@pytest.mark.parametrize(
    ("times", "points", "options", "error", "message"),
    [
        ([0.0], [[0.0]], {}, ShapeError, r"waypoints has shape \(1, 1\); wanted \(n, nq\) with n at least 2"),
        ([0.0, 1.0], [0.0, 1.0], {}, ShapeError, r"waypoints has shape \(2,\)"),
        ([0.0, 1.0, 2.0], [[0.0], [1.0]], {}, ShapeError, r"times has shape \(3,\); wanted \(2,\)"),
        (
            [0.0, 0.0],
            [[0.0], [1.0]],
            {},
            ArgumentError,
            r"times\[1\] is 0 after 0; wanted strictly ascending",
        ),
        ([0.0, -1.0], [[0.0], [1.0]], {}, ArgumentError, r"times\[1\] is -1 after 0"),
        ([1.0, 2.0], [[0.0], [1.0]], {}, ArgumentError, r"times\[0\] is 1; wanted 0"),
        ([0.0, NAN], [[0.0], [1.0]], {}, NotFiniteError, r"times\[1\] is nan"),
        ([0.0, 1.0], [[0.0], [INF]], {}, NotFiniteError, r"waypoints\[1, 0\] is inf"),
        ([0.0, 1.0], [[0.0], [1.0]], {"kind": "linear"}, ArgumentError, "kind is 'linear'; wanted 'cubic'"),
        ([0.0, 1.0], [[0.0], [1.0]], {"end": "free"}, ArgumentError, "end is 'free'; wanted 'clamped'"),
        ([0.0, 1.0], [[0.0], [1.0]], {"end": "natural", "v0": [1.0]}, ArgumentError, "v0 is given, but"),
        ([0.0, 1.0], [[0.0], [1.0]], {"v1": [1.0, 2.0]}, ShapeError, r"v1 has shape \(2,\); wanted \(1,\)"),
        ([0.0, 1.0], [[0.0], [0.0]], {"end": "periodic"}, ArgumentError, "a periodic cubic spline needs 3"),
        (
            [0.0, 1.0, 2.0],
            [[0.0], [1.0], [0.5]],
            {"end": "periodic"},
            ArgumentError,
            "coordinate 0 is 0 at the first waypoint and 0.5 at the last",
        ),
    ],
)
def test_waypoints(
    times: Any, points: Any, options: dict[str, Any], error: type[DynxError], message: str
) -> None:
    with pytest.raises(error, match=message):
        trajectory.spline(times, points, **options)


@pytest.mark.parametrize(
    ("changed", "error", "message"),
    [
        ({"model": "ur5"}, ArgumentError, "model is 'ur5', of type str"),
        ({"model": floating()}, ArgumentError, "floating base; a line needs a fixed one"),
        ({"frame": "tool"}, UnknownNameError, "no frame 'tool'"),
        ({"q0": [0.0]}, ShapeError, "q0 has shape"),
        ({"q0": REACH + 7.0}, TrajectoryError, "the line begins at 'shoulder_pan_joint' = 7.4, outside"),
        ({"target": np.eye(3)}, ShapeError, r"target has shape \(3, 3\); wanted a pose \(4, 4\) or"),
        ({"target": 2.0 * np.eye(4)}, ArgumentError, "not a rigid transform"),
        ({"duration": None}, ArgumentError, "wanted either a duration or a law"),
        ({"law": SLOW}, ArgumentError, "wanted either a duration or a law"),
        ({"duration": None, "law": "slow"}, ArgumentError, "law is 'slow', of type str"),
        ({"duration": None, "law": HALF}, ArgumentError, "law goes from 0 to 0.5; wanted from 0 to 1"),
        ({"duration": None, "law": BEYOND}, ArgumentError, "wanted within 0 and 1"),
        ({"deviation": 0.0}, ArgumentError, "^deviation is '0.0'; wanted a number, at least 1e-09"),
        ({"rotation_deviation": NAN}, ArgumentError, "rotation_deviation is 'nan'"),
        ({"backend": "none"}, dynx.errors.UnknownBackendError, "no backend 'none'"),
    ],
)
def test_lines(changed: dict[str, Any], error: type[DynxError], message: str) -> None:
    arguments: dict[str, Any] = {
        "model": ur5(),
        "frame": "tool0",
        "q0": REACH,
        "target": [0.1, 0.2, 0.3],
        "duration": 1.0,
        **changed,
    }
    with pytest.raises(error, match=message):
        trajectory.line(**arguments)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"duration": 0.0}, ArgumentError, "duration is '0.0'"),
        ({"harmonics": 2}, ArgumentError, "harmonics is '2'; wanted a whole number, at least 3"),
        ({"candidates": 0}, ArgumentError, "candidates is '0'"),
        (
            {"velocity": 0.0},
            TrajectoryError,
            "joint 'shoulder_pan_joint' cannot move: .* velocity limit leaves 0",
        ),
        ({"acceleration": -1.0}, ArgumentError, "acceleration.0. is -1"),
        ({"q0": REACH + 7.0}, TrajectoryError, "its upper position limit leaves"),
        ({"model": floating()}, ArgumentError, "a floating base; excitation needs joints on a fixed base"),
    ],
)
def test_excitations(options: dict[str, Any], error: type[DynxError], message: str) -> None:
    with pytest.raises(error, match=message):
        trajectory.excitation(**{"model": ur5(), "duration": 10.0, **options})


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (
            {"velocity": 0.0},
            TrajectoryError,
            "the limit of velocity of coordinate 0 is 0; wanted one above 0",
        ),
        ({"jerk": INF}, TrajectoryError, "the limit of jerk of coordinate 0 is inf"),
        ({"v0": [2.0]}, TrajectoryError, "v0 of coordinate 0 is 2, beyond its limit of velocity, 1"),
        ({"a1": [-3.0]}, TrajectoryError, "a1 of coordinate 0 is -3, beyond its limit of acceleration, 1"),
        (
            {"v0": [1.0], "a0": [1.0]},
            TrajectoryError,
            "takes a velocity of 1.5 afterwards, beyond its limit, 1",
        ),
        ({"v1": [1.0], "a1": [-1.0]}, TrajectoryError, "takes a velocity of 1.5 before, beyond its limit"),
        ({"q1": [0.0]}, ArgumentError, "no motion is needed"),
    ],
)
def test_time_optimal(options: dict[str, Any], error: type[DynxError], message: str) -> None:
    pytest.importorskip("ruckig")
    usual: dict[str, Any] = {"q0": [0.0], "q1": [1.0], "velocity": 1.0, "acceleration": 1.0, "jerk": 1.0}
    with pytest.raises(error, match=message):
        trajectory.time_optimal(**{**usual, **options})


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"waypoints": [[0.0], [0.0], [1.0]]}, ArgumentError, "waypoints 0 and 1 are the same"),
        ({"waypoints": [[0.0]]}, ShapeError, r"waypoints has shape \(1, 1\)"),
        ({"waypoints": [[0.0], [NAN]]}, NotFiniteError, r"waypoints\[1, 0\] is nan"),
        ({"model": ur5()}, ShapeError, r"a waypoint has shape \(1,\)"),
        (
            {"waypoints": floating().random(0, 2), "model": floating()},
            ArgumentError,
            "floating base; a path needs a fixed one",
        ),
        ({"velocity": 0.0}, TrajectoryError, "the limit of velocity of coordinate 0 is 0"),
        ({"acceleration": INF}, TrajectoryError, "the limit of acceleration of coordinate 0 is inf"),
        ({"acceleration": -1.0}, ArgumentError, "acceleration.0. is -1"),
    ],
)
def test_time_optimal_paths(options: dict[str, Any], error: type[DynxError], message: str) -> None:
    usual: dict[str, Any] = {"waypoints": [[0.0], [1.0]], "velocity": 1.0, "acceleration": 1.0}
    with pytest.raises(error, match=message):
        trajectory.time_optimal_path(**{**usual, **options})


def test_without_toppra_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "toppra", None)
    with pytest.raises(
        NotInstalledError, match=r"time_optimal_path needs .* pip install '\S*\[trajectory\]'"
    ):
        trajectory.time_optimal_path([[0.0], [1.0]], velocity=1.0, acceleration=1.0)


def test_without_ruckig_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ruckig", None)
    with pytest.raises(NotInstalledError, match=r"pip install '\S*\[trajectory\]'"):
        trajectory.time_optimal([0.0], [1.0], velocity=1.0, acceleration=1.0, jerk=1.0)


def test_an_error_of_ruckig_is_one_of_dynx(monkeypatch: pytest.MonkeyPatch) -> None:
    ruckig = pytest.importorskip("ruckig")

    class Failing:
        def __init__(self, joints: int) -> None:
            assert joints == 1

        def calculate(self, question: object, answer: object) -> None:
            raise ruckig.RuckigError("\n[ruckig] error in step 1\ninput:")

    monkeypatch.setattr(ruckig, "Ruckig", Failing)
    with pytest.raises(TrajectoryError, match=r"Ruckig finds no motion .* error in step 1$"):
        trajectory.time_optimal([0.0], [1.0], velocity=1.0, acceleration=1.0, jerk=1.0)


def test_errors_pickle() -> None:
    error = pickle.loads(pickle.dumps(TrajectoryError("no way", at=0.25)))
    assert (str(error), error.at) == ("no way", 0.25)


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("CubicSpline", "spline(times, waypoints)"),
        ("quintic_spline", "kind='quintic'"),
        ("minimum_jerk", "quintic(q0, q1, duration)"),
        ("lspb", "trapezoidal(q0, q1"),
    ],
)
def test_usual_names_of_motions_lead_to_the_function(name: str, call: str) -> None:
    with pytest.raises(AttributeError, match=re.escape(call)):
        getattr(trajectory, name)


@pytest.mark.parametrize("kind", [3, "linear", None])
def test_a_kind_of_splines_is_one_of_two_names(kind: Any) -> None:
    with pytest.raises(DynxError, match="wanted 'cubic' or 'quintic'"):
        trajectory.spline([0.0, 1.0], [[0.0], [1.0]], kind=kind)

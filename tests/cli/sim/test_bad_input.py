"""Options that `dynx sim` refuses: one line each, and nothing is simulated."""

from __future__ import annotations

import pytest

from tests.cli.sim.command import document, sim

ELBOW = ["ur5", "--to", "elbow_joint=0.1"]


@pytest.mark.parametrize(
    ("arguments", "clue"),
    [
        (["nosuchrobot"], "nosuchrobot"),
        ([], "ROBOT is missing"),
        (["ur5", "extra"], "extra"),
        ([*ELBOW, "--bogus"], "--bogus"),
        (["ur5", "--to", "0,nan,0,0,0,0"], "'--to': 'nan' is not finite"),
        (["ur5", "--to", "0,inf,0,0,0,0"], "'--to': 'inf' is not finite"),
        (["ur5", "--to", "0,1;5"], "'1;5' is not a number"),
        (["ur5", "--to", "0,0,0"], "--to has 3 numbers; ur5 needs 6"),
        (["ur5", "--to", "elbow=1"], "did you mean 'elbow_joint'"),
        (["ur5", "--to", "elbow_joint=4"], "position of 'elbow_joint' is 4"),
        ([*ELBOW, "--from", "1"], "--from has 1 number"),
        ([*ELBOW, "--q0", "1,2"], "--q0 has 2 numbers"),
        ([*ELBOW, "--v0", "1,2"], "--v0 has 2 numbers"),
        ([*ELBOW, "--lock", "elbow_joint=0"], "it is locked"),
        ([*ELBOW, "--base", "floating"], "floating base"),
        ([*ELBOW, "--gravity", "1,2"], "wanted 3 numbers"),
        ([*ELBOW, "--controller", "computed-torqe"], "did you mean 'computed-torque'"),
        ([*ELBOW, "--profile", "cubik"], "did you mean 'cubic'"),
        ([*ELBOW, "--integrator", "rk5"], "did you mean 'rk4'"),
        ([*ELBOW, "--integrator", "engine"], "no stepper"),
        ([*ELBOW, "--integrator", "adaptive", "--rtol", "0"], "rtol"),
        ([*ELBOW, "--plant", "bulet"], "did you mean 'pybullet'"),
        ([*ELBOW, "--backend", "nosuch"], "no backend 'nosuch'"),
        ([*ELBOW, "--dt", "0"], "dt is '0.0'"),
        ([*ELBOW, "--dt", "nan"], "'nan' is not finite"),
        ([*ELBOW, "--dt", "1e-11"], "this machine has"),
        ([*ELBOW, "--dt", "1e-20"], "more than 1e+12 steps of dt"),
        ([*ELBOW, "--duration", "0"], "duration is '0.0'"),
        ([*ELBOW, "--settle", "-1"], "--settle is -1"),
        ([*ELBOW, "--control-dt", "0.0015"], "control_dt is 0.0015 s, which is not a multiple"),
        ([*ELBOW, "--delay", "0.0005"], "delay is 0.0005 s, which is not a multiple"),
        ([*ELBOW, "--substeps", "0"], "--substeps"),
        ([*ELBOW, "--duration", "0.05"], "velocity of 'elbow_joint' is 4"),
        ([*ELBOW, "--effort-limits", "0"], "is 0, so that no torque is allowed"),
        ([*ELBOW, "--effort-limits", "1,2"], "wanted one number, or 6"),
        ([*ELBOW, "--effort-limits", "some"], "'some' is not a number"),
        ([*ELBOW, "--kp=-1"], "kp is negative"),
        ([*ELBOW, "--kp", "1,2"], "kp has shape"),
        ([*ELBOW, "--kp", ","], "--kp"),
        ([*ELBOW, "--kd", "1"], "kd is given without kp"),
        ([*ELBOW, "--ki", "1"], "computed-torque takes no ki"),
        ([*ELBOW, "--controller", "none", "--kp", "1"], "takes no gains"),
        ([*ELBOW, "--controller", "impedance"], "impedance needs kp"),
        ([*ELBOW, "--controller", "position-motor"], "pybullet"),
        ([*ELBOW, "--friction-compensation"], "needs joint dynamics: --damping"),
        ([*ELBOW, "--damping=-1"], "damping is negative"),
        ([*ELBOW, "--friction", "1", "--friction-slip=-1"], "slip"),
        ([*ELBOW, "--push", "tool0"], "--push"),
        ([*ELBOW, "--push", "tool0:1,2"], "--push"),
        ([*ELBOW, "--push", "tool:1,2,3"], "did you mean 'tool0'"),
        ([*ELBOW, "--push", "tool0:1,2,3:0:-1"], "lasts -1.0"),
        ([*ELBOW, "--payload", "tool0"], "--payload"),
        ([*ELBOW, "--payload", "tool0:1:2"], "tool0:1"),
        ([*ELBOW, "--payload", "tool0:-1"], "mass of a payload"),
        ([*ELBOW, "--mass-scale", "0"], "wanted a positive factor"),
        ([*ELBOW, "--mass-scale", "forearm=2"], "did you mean 'forearm_link'"),
        ([*ELBOW, "--mass-scale", "1.1", "--mass-scale", "1.2"], "given twice"),
        ([*ELBOW, "--noise-q=-1"], "noise.q is negative"),
        ([*ELBOW, "--seed", "-1"], "--seed"),
        ([*ELBOW, "--to-pose", "0.4,0.2,0.4"], "both given"),
        ([*ELBOW, "--frame", "tool0"], "--frame needs --to-pose"),
        (["ur5", "--to-pose", "0.4,0.2"], "--to-pose: wanted 3 numbers"),
        (["ur5", "--to-pose", "9,9,9"], "cannot follow the line"),
        (["ur5", "--to-pose", "0.4,0.2,0.4", "--profile", "hold"], "--to-pose takes --profile cycloidal"),
        (["ur5", "--profile", "cubic"], "needs --to or --to-pose"),
        ([*ELBOW, "--profile", "trapezoidal"], "needs --acceleration"),
        ([*ELBOW, "--profile", "s-curve", "--acceleration", "1"], "needs --jerk"),
        ([*ELBOW, "--profile", "trapezoidal", "--acceleration", "0"], "limit of acceleration is 0"),
        ([*ELBOW, "--jerk", "1"], "--jerk needs --profile s-curve"),
        ([*ELBOW, "--velocity", "1"], "--velocity needs --profile trapezoidal or s-curve"),
        ([*ELBOW, "--save", "/nosuch/folder/x.npz"], "/nosuch/folder"),
        ([*ELBOW, "--save", "x.txt"], "wanted one of .npz, .csv"),
        ([*ELBOW, "--save", "x.npz", "--save", "x.npz"], "twice"),
        ([*ELBOW, "--plot", "x.xyz"], "a plot is saved as .png, .pdf or .svg"),
        ([*ELBOW, "--plot", "/nosuch/folder/x.png"], "/nosuch/folder"),
        ([*ELBOW, "--resume", "/nosuch.npz"], "/nosuch.npz cannot be read"),
        ([*ELBOW, "--resume-step", "3"], "--resume-step needs --resume"),
        ([*ELBOW, "--method", "Radau"], "--method needs --integrator adaptive"),
        ([*ELBOW, "--atol", "1e-6", "--integrator", "rk4"], "--atol needs --integrator adaptive"),
        ([*ELBOW, "--friction-slip", "0.1"], "--friction-slip needs --friction"),
        ([*ELBOW, "--seed", "1"], "--seed needs --noise-q or --noise-v"),
        ([*ELBOW, "--integrator", "adaptive", "--method", "DOP85"], "did you mean 'DOP853'"),
    ],
)
def test_arguments_that_cannot_be_used(arguments: list[str], clue: str) -> None:
    result = sim(*arguments)
    assert result.exit_code == 2
    assert clue in result.stderr
    assert result.stdout == ""
    assert result.stderr.startswith("dynx: error: ")
    assert result.stderr.count("\n") == 1


def test_ignore_limits_simulates_a_motion_beyond_them() -> None:
    made = document("ur5", "--to", "elbow_joint=0.1", "--duration", "0.05", "--ignore-limits")
    assert made["joints"][2]["max_speed"] > 3.15

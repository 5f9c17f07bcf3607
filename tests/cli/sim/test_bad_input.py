"""What `dynx sim` cannot be asked: one line each, and nothing is simulated."""

from __future__ import annotations

import pytest

from tests.cli.sim.command import document, sim

GOES = ["ur5", "--to", "elbow_joint=0.1"]


@pytest.mark.parametrize(
    ("arguments", "clue"),
    [
        (["nosuchrobot"], "nosuchrobot"),
        ([], "ROBOT is missing"),
        (["ur5", "extra"], "extra"),
        ([*GOES, "--bogus"], "--bogus"),
        (["ur5", "--to", "0,nan,0,0,0,0"], "'--to': 'nan' is not finite"),
        (["ur5", "--to", "0,inf,0,0,0,0"], "'--to': 'inf' is not finite"),
        (["ur5", "--to", "0,1;5"], "'1;5' is not a number"),
        (["ur5", "--to", "0,0,0"], "--to has 3 numbers; ur5 needs 6"),
        (["ur5", "--to", "elbow=1"], "did you mean 'elbow_joint'"),
        (["ur5", "--to", "elbow_joint=4"], "position of 'elbow_joint' is 4"),
        ([*GOES, "--from", "1"], "--from has 1 number"),
        ([*GOES, "--q0", "1,2"], "--q0 has 2 numbers"),
        ([*GOES, "--v0", "1,2"], "--v0 has 2 numbers"),
        ([*GOES, "--lock", "elbow_joint=0"], "it is locked"),
        ([*GOES, "--base", "floating"], "floating base"),
        ([*GOES, "--gravity", "1,2"], "wanted 3 numbers"),
        ([*GOES, "--controller", "computed-torqe"], "did you mean 'computed-torque'"),
        ([*GOES, "--profile", "cubik"], "did you mean 'cubic'"),
        ([*GOES, "--integrator", "rk5"], "did you mean 'rk4'"),
        ([*GOES, "--integrator", "engine"], "no stepper"),
        ([*GOES, "--integrator", "adaptive", "--rtol", "0"], "rtol"),
        ([*GOES, "--plant", "bulet"], "did you mean 'pybullet'"),
        ([*GOES, "--backend", "nosuch"], "no backend 'nosuch'"),
        ([*GOES, "--dt", "0"], "dt is '0.0'"),
        ([*GOES, "--dt", "nan"], "'nan' is not finite"),
        ([*GOES, "--dt", "1e-12"], "this machine has"),
        ([*GOES, "--duration", "0"], "duration is '0.0'"),
        ([*GOES, "--duration", "2.0005"], "no multiple of dt = 0.001 s; 2.001 s would be"),
        ([*GOES, "--settle", "-1"], "--settle is -1"),
        ([*GOES, "--control-dt", "0.0015"], "control_dt is 0.0015 s, which is no multiple"),
        ([*GOES, "--delay", "0.0005"], "delay is 0.0005 s, which is no multiple"),
        ([*GOES, "--substeps", "0"], "--substeps"),
        ([*GOES, "--duration", "0.05"], "velocity of 'elbow_joint' is 4"),
        ([*GOES, "--effort-limits", "0"], "is 0, so that no torque is allowed"),
        ([*GOES, "--effort-limits", "1,2"], "wanted one number, or 6"),
        ([*GOES, "--effort-limits", "some"], "'some' is not a number"),
        ([*GOES, "--kp=-1"], "kp is negative"),
        ([*GOES, "--kp", "1,2"], "kp has shape"),
        ([*GOES, "--kp", ","], "--kp"),
        ([*GOES, "--kd", "1"], "kd is given without kp"),
        ([*GOES, "--ki", "1"], "computed-torque takes no ki"),
        ([*GOES, "--controller", "none", "--kp", "1"], "takes no gains"),
        ([*GOES, "--controller", "impedance"], "impedance needs kp"),
        ([*GOES, "--controller", "position-motor"], "pybullet"),
        ([*GOES, "--friction-compensation"], "needs joint losses: --damping"),
        ([*GOES, "--damping=-1"], "damping is negative"),
        ([*GOES, "--friction", "1", "--friction-slip=-1"], "slip"),
        ([*GOES, "--push", "tool0"], "--push"),
        ([*GOES, "--push", "tool0:1,2"], "--push"),
        ([*GOES, "--push", "tool:1,2,3"], "did you mean 'tool0'"),
        ([*GOES, "--push", "tool0:1,2,3:0:-1"], "lasts -1.0"),
        ([*GOES, "--payload", "tool0"], "--payload"),
        ([*GOES, "--payload", "tool0:1:2"], "tool0:1"),
        ([*GOES, "--payload", "tool0:-1"], "mass of a payload"),
        ([*GOES, "--mass-scale", "0"], "wanted a positive factor"),
        ([*GOES, "--mass-scale", "forearm=2"], "did you mean 'forearm_link'"),
        ([*GOES, "--mass-scale", "1.1", "--mass-scale", "1.2"], "given twice"),
        ([*GOES, "--noise-q=-1"], "noise.q is negative"),
        ([*GOES, "--seed", "-1"], "--seed"),
        ([*GOES, "--to-pose", "0.4,0.2,0.4"], "both given"),
        ([*GOES, "--frame", "tool0"], "--frame needs --to-pose"),
        (["ur5", "--to-pose", "0.4,0.2"], "--to-pose: wanted 3 numbers"),
        (["ur5", "--to-pose", "9,9,9"], "cannot follow the line"),
        (["ur5", "--to-pose", "0.4,0.2,0.4", "--profile", "hold"], "--to-pose takes --profile cycloidal"),
        (["ur5", "--profile", "cubic"], "needs --to or --to-pose"),
        ([*GOES, "--profile", "trapezoidal"], "needs --acceleration"),
        ([*GOES, "--profile", "s-curve", "--acceleration", "1"], "needs --jerk"),
        ([*GOES, "--profile", "trapezoidal", "--acceleration", "0"], "limit of acceleration is 0"),
        ([*GOES, "--jerk", "1"], "--jerk needs --profile s-curve"),
        ([*GOES, "--velocity", "1"], "--velocity needs --profile trapezoidal or s-curve"),
        ([*GOES, "--save", "/nosuch/folder/x.npz"], "/nosuch/folder"),
        ([*GOES, "--save", "x.txt"], "wanted one of .npz, .csv"),
        ([*GOES, "--save", "x.npz", "--save", "x.npz"], "twice"),
        ([*GOES, "--plot", "x.xyz"], "a plot is saved as .png, .pdf or .svg"),
        ([*GOES, "--plot", "/nosuch/folder/x.png"], "/nosuch/folder"),
        ([*GOES, "--resume", "/nosuch.npz"], "/nosuch.npz cannot be read"),
        ([*GOES, "--resume-step", "3"], "--resume-step needs --resume"),
        ([*GOES, "--method", "Radau"], "--method needs --integrator adaptive"),
        ([*GOES, "--atol", "1e-6", "--integrator", "rk4"], "--atol needs --integrator adaptive"),
        ([*GOES, "--friction-slip", "0.1"], "--friction-slip needs --friction"),
        ([*GOES, "--seed", "1"], "--seed needs --noise-q or --noise-v"),
        ([*GOES, "--integrator", "adaptive", "--method", "DOP85"], "did you mean 'DOP853'"),
    ],
)
def test_arguments_that_cannot_be_used(arguments: list[str], clue: str) -> None:
    result = sim(*arguments)
    assert result.exit_code == 2
    assert clue in result.stderr
    assert result.stdout == ""
    assert result.stderr.startswith("dynx: error: ")
    assert result.stderr.count("\n") == 1


def test_limits_are_ignored_when_asked_for() -> None:
    made = document("ur5", "--to", "elbow_joint=0.1", "--duration", "0.05", "--ignore-limits")
    assert made["joints"][2]["max_speed"] > 3.15

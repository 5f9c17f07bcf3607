"""Speed of two checkouts of dynx, in interleaved rounds:

    python -m benchmarks.side_by_side --before OLD/.venv/bin/python --after NEW/.venv/bin/python

Each checkout is given by a Python that imports it. Both stay open in a process of their own and are timed in
turn, in rounds, so that what else the machine does meets both. The row of a case has the processor time of
one call in the thread that makes it, as the median of the rounds; the ratio of the medians, above 1 where the
second checkout is faster; and its 95 % interval, by resampling the rounds. Before it is timed, a case returns
its answer in both. The command ends with 1 if an answer differs, if the lower end of an interval is below
``--bar``, or if a case of the first checkout cannot be made in the second.

``--only TEXT`` (repeated) chooses cases whose names contain a text; ``--list`` lists them. ``--json FILE``
writes the rows whenever one is finished; cases that it has are not measured again.

The cases use the public interface alone, since one file serves both checkouts.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np

Call = Callable[[], Any]
Answer = Callable[[Any], Any]

MIN_SECONDS = 0.01
"""Shortest time of one measurement [s]; shorter calls are repeated."""

MIN_RATIO = 0.95
"""Default of the bar under the lower end of an interval."""

RESAMPLES = 2000
"""Samples of rounds that give the interval."""

ENGINES = ("pinocchio", "compiled", "reference", "mujoco", "drake", "pybullet")
PLANTS = ("pinocchio", "compiled", "reference", "mujoco", "drake", "pybullet")
WORLD_ENGINES = ("pybullet", "mujoco", "drake")
TASKS = ("CartPole", "Pendulum", "Acrobot")

QUANTITIES = {
    "forward_kinematics": "q",
    "jacobian": "q",
    "jacobian_derivative": "qv",
    "frame_velocity": "qv",
    "frame_acceleration": "qva",
    "inverse_dynamics": "qva",
    "forward_dynamics": "qva",
    "mass_matrix": "q",
    "bias_torque": "qv",
    "gravity_torque": "q",
    "coriolis_matrix": "qv",
    "inertial_regressor": "qva",
    "center_of_mass": "q",
    "center_of_mass_jacobian": "q",
    "centroidal_momentum": "qv",
    "kinetic_energy": "qv",
    "potential_energy": "q",
}
"""Quantities and their arguments; the torque of forward dynamics has the numbers of an acceleration."""

OF_FRAME = frozenset(list(QUANTITIES)[:5])

ROBOTS = ("ur5", "panda", "a1:floating", "talos:floating", "serial64", "tree101")

BATCH = 128
"""Samples of a batch."""


@dataclass(frozen=True)
class Case:
    """Work that is timed.

    `make` imports what it needs and returns the call, and the function that makes numbers of its result.
    """

    name: str
    make: Callable[[], tuple[Call, Answer]]
    tolerance: float = 1e-12
    """Largest difference of two answers, relative to the largest number."""


# -- cases ----------------------------------------------------------------------------------------------


def cases() -> Iterator[Case]:
    """Yield all cases."""
    for engine in ENGINES:
        for quantity in QUANTITIES:
            yield Case(f"call {engine} {quantity}", partial(_quantity, "ur5", engine, quantity, 0))
    for robot in ROBOTS:
        for quantity in QUANTITIES:
            for samples in (0, BATCH):
                name = f"quantity {robot} {quantity} {samples or 1}"
                yield Case(name, partial(_quantity, robot, "compiled", quantity, samples))
        yield Case(f"derivatives {robot} 1", partial(_derivatives, robot, 0))
        yield Case(f"derivatives {robot} {BATCH}", partial(_derivatives, robot, BATCH))
    for plant in PLANTS:
        yield Case(f"loop {plant}", partial(_loop, plant), 1e-9)
    yield Case("loop compiled with dry friction", partial(_loop, "compiled", friction=True), 1e-9)
    yield Case("rollouts compiled", _rollouts, 1e-9)
    for engine in WORLD_ENGINES:
        yield Case(f"world {engine} box", partial(_world, engine), 1e-9)
        yield Case(f"world {engine} robot", partial(_world_of_robot, engine), 1e-9)
    for engine in ("pinocchio", "compiled", "mujoco"):
        for robot in ("ur5", "panda"):
            yield Case(f"ik {robot} {engine} 1", partial(_inverse_kinematics, robot, engine, 0), 1e-6)
    yield Case(f"ik ur5 compiled {BATCH}", partial(_inverse_kinematics, "ur5", "compiled", BATCH), 1e-6)
    yield Case(f"ik panda compiled {BATCH}", partial(_inverse_kinematics, "panda", "compiled", BATCH), 1e-6)
    for task in TASKS:
        yield Case(f"environments {task} 256", partial(_environments, task), 1e-9)
        yield Case(f"environment {task} compiled", partial(_environment, task, "compiled"), 1e-9)
    yield Case("environment CartPole mujoco", partial(_environment, "CartPole", "mujoco"), 1e-9)


def _robot(name: str) -> Any:
    import dynx

    if name == "serial64":
        return _built(64, prismatic=0)
    if name == "tree101":
        return _built(101, prismatic=10)
    name, _, base = name.partition(":")
    return dynx.load(name, base="floating" if base == "floating" else "fixed")


def _built(n: int, *, prismatic: int) -> Any:
    """Return n joints in series; or a tree, if every joint number `prismatic` is prismatic."""
    from dynx.model import Inertial, Joint, Link, Model, Pose

    rng = np.random.default_rng(0)
    links = [
        Link(f"link{k}", Inertial(1.0 + k % 5, Pose((0.1, 0.02, 0.03)), 0.1, 0.01, 0.0, 0.2, 0.0, 0.15))
        for k in range(n + 1)
    ]
    joints = []
    for k in range(n):
        slides = prismatic and k % prismatic == prismatic - 1
        parent = rng.integers(max(0, k - 9), k + 1) if prismatic else k
        origin = Pose((0.05, 0.0, 0.2), (0.3 * (k % 4), 0.0, 0.1))
        kind: Any = "prismatic" if slides else "revolute"
        axis = (0.0, float(k % 2), 1.0 - k % 2)
        joints.append(Joint(f"joint{k}", kind, f"link{parent}", f"link{k + 1}", origin, axis))
    return Model.build(f"{n} joints", links, joints)


def _sample(model: Any, samples: int) -> dict[str, Any]:
    rng = np.random.default_rng(1)
    size = (samples,) if samples else ()
    q = model.random(rng, size)
    v, a = rng.standard_normal((2, *size, model.nv))
    return {"q": q, "v": v, "a": a}


def _quantity(robot: str, engine: str, quantity: str, samples: int) -> tuple[Call, Answer]:
    import dynx

    model = _robot(robot)
    options = {"threads": 1} if engine == "compiled" else {}
    values = _sample(model, samples)
    arguments = [values[argument] for argument in QUANTITIES[quantity]]
    frame = (model.frame_names[-1],) if quantity in OF_FRAME else ()
    return partial(getattr(dynx.backend(engine, model, **options), quantity), *arguments, *frame), np.asarray


def _derivatives(robot: str, samples: int) -> tuple[Call, Answer]:
    import dynx

    model = _robot(robot)
    values = _sample(model, samples).values()
    return partial(dynx.Derivatives(model, threads=1).inverse_dynamics_derivatives, *values), np.concatenate


def _task() -> tuple[Any, Any, Any]:
    import dynx
    from dynx import control, trajectory

    model = dynx.load("ur5")
    goal = [-1.5, -1.0, 1.0, -1.57, -1.57, -1.57]
    motion = trajectory.cycloidal(np.zeros(6), goal, duration=2.0)
    return model, control.ComputedTorque, motion


def _loop(plant: str, *, friction: bool = False) -> tuple[Call, Answer]:
    import dynx

    model, controller, motion = _task()
    engine = plant if plant != "pybullet" else "pinocchio"
    law = controller(model, kp=400.0, kd=40.0, backend=engine)
    more: dict[str, Any] = {"joint_friction": 0.5} if friction else {}
    # Algorithms in Python take hundreds of times as long.
    duration = 0.01 if plant == "reference" else 0.5
    run = partial(dynx.simulate, model, law, motion, plant=plant, dt=1e-3, duration=duration, **more)
    return run, lambda rollout: rollout.q


def _rollouts() -> tuple[Call, Answer]:
    import dynx

    model, controller, motion = _task()
    law = controller(model, kp=400.0, kd=40.0)
    options: dict[str, Any] = {"rollouts": 64, "dt": 1e-3, "duration": 0.2, "threads": 1}
    noise = dynx.Noise(q=1e-4, v=1e-3, seed=3)
    run = partial(dynx.simulate_batch, model, law, motion, noise=noise, **options)
    return run, lambda batch: batch.q


def _world(engine: str) -> tuple[Call, Answer]:
    import dynx
    from dynx.world import Scene, World, box, ground

    cubes = [box(f"cube{k}", (0.1, 0.1, 0.1), mass=0.5, pose=dynx.Pose((0.3 * k, 0, 0.06))) for k in range(4)]
    return _steps(World(Scene("cubes", bodies=(ground(), *cubes)), engine=engine, dt=1e-3))


def _world_of_robot(engine: str) -> tuple[Call, Answer]:
    import dynx
    from dynx.world import Scene, SceneRobot, World, ground

    robot = SceneRobot("arm", dynx.load("ur5"))
    return _steps(World(Scene("arm", bodies=(ground(),), robots=(robot,)), engine=engine, dt=1e-3))


def _steps(world: Any) -> tuple[Call, Answer]:
    def answer(_: Any) -> Any:
        """Return the state after the first hundred steps, from the start."""
        state = world.state
        bodies = [body.T_world_body.ravel() for body in state.bodies.values()]
        return np.concatenate([*bodies, *(robot.q for robot in state.robots.values()), [state.time]])

    return partial(world.step, 100), answer


def _inverse_kinematics(robot: str, engine: str, samples: int) -> tuple[Call, Answer]:
    import dynx

    model = _robot(robot)
    backend = dynx.backend(engine, model)
    # The last frame may be one that no joint moves.
    frame = [joint.child for joint in model.joints if joint.moves][-1]
    rng = np.random.default_rng(2)
    count = samples or 16
    targets = backend.forward_kinematics(model.random(rng, (count,)), frame)
    starts = model.random(rng, (count,))

    def solve() -> Any:
        if samples:
            return [backend.inverse_kinematics(targets, frame, starts)]
        return [backend.inverse_kinematics(T, frame, q) for T, q in zip(targets, starts, strict=True)]

    def reached(results: Any) -> Any:
        """Return the poses where the search succeeds: a solution is one of several."""
        q = np.concatenate([np.atleast_2d(result.q) for result in results])
        success = np.concatenate([np.atleast_1d(result.success) for result in results])
        poses = backend.forward_kinematics(q, frame)
        return np.where(success[:, None, None], poses, 0.0)

    return solve, reached


def _environments(task: str) -> tuple[Call, Answer]:
    import gymnasium

    import dynx.envs  # noqa: F401  registers the environments

    envs = gymnasium.make_vec(f"dynx/{task}-v0", num_envs=256)
    envs.action_space.seed(0)
    actions = [envs.action_space.sample() for _ in range(50)]
    envs.reset(seed=0)
    return partial(_last, envs, actions), np.asarray


def _environment(task: str, engine: str) -> tuple[Call, Answer]:
    import gymnasium

    import dynx.envs  # noqa: F401  registers the environments

    env = gymnasium.make(f"dynx/{task}-v0", engine=engine)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(50)]
    env.reset(seed=0)

    def episode() -> Any:
        for action in actions:
            observation, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset(seed=0)
        return observation

    return episode, np.asarray


def _last(envs: Any, actions: Sequence[Any]) -> Any:
    """Return the observation after the last of the actions."""
    return [envs.step(action)[0] for action in actions][-1]


# -- one checkout ---------------------------------------------------------------------------------------


def serve() -> None:
    """Answer requests on standard input, each with a line on standard output."""
    by_name = {case.name: case for case in cases()}
    reply_to = os.fdopen(os.dup(1), "w")
    # What engines print goes to standard error.
    os.dup2(2, 1)
    call: Call = time.thread_time_ns
    for line in sys.stdin:
        request = json.loads(line)
        try:
            if "case" in request:
                call, reply = _prepared(by_name[request["case"]])
            else:
                reply = {"seconds": _seconds(call, request["calls"])}
        except Exception as error:
            reply = {"error": f"{type(error).__name__}: {error}".splitlines()[0]}
        print(json.dumps(reply), file=reply_to, flush=True)


def _prepared(case: Case) -> tuple[Call, dict[str, Any]]:
    call, answer = case.make()
    numbers = np.asarray(answer(call()), dtype=float).ravel()
    call()
    calls = max(1, int(MIN_SECONDS / max(_seconds(call, 1), 1e-7)))
    return call, {"answer": numbers.tolist(), "calls": calls}


def _seconds(call: Call, calls: int) -> float:
    """Return the processor time of one call in this thread [s]."""
    start = time.thread_time_ns()
    for _ in range(calls):
        call()
    return (time.thread_time_ns() - start) * 1e-9 / calls


# -- both -----------------------------------------------------------------------------------------------


class Checkout:
    """A process in which one checkout is timed."""

    def __init__(self, python: Path) -> None:
        self._python = python.absolute()
        self._process = self._opened()

    def _opened(self) -> subprocess.Popen[str]:
        # -P keeps the checkout of this file off the path.
        command = [str(self._python), "-P", str(Path(__file__).resolve()), "--serve"]
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=environment,
            cwd=self._python.parent,
        )

    def ask(self, **request: Any) -> dict[str, Any]:
        """Return the reply to a request; a process that an engine ended is opened again for the next case."""
        pipes: tuple[IO[str] | None, IO[str] | None] = self._process.stdin, self._process.stdout
        assert pipes[0] is not None
        assert pipes[1] is not None
        try:
            print(json.dumps(request), file=pipes[0], flush=True)
            line = pipes[1].readline()
        except BrokenPipeError:
            line = ""
        if not line:
            status = self._process.wait()
            self._process = self._opened()
            return {"error": f"the process ended with {status}"}
        reply: dict[str, Any] = json.loads(line)
        return reply

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()


@dataclass(frozen=True)
class Row:
    """Times of one case: medians over the rounds [s], and the ratio of the first to the second with its 95 %
    interval. `problem` says why there are none."""

    case: str
    before: float = 0.0
    after: float = 0.0
    ratio: float = 0.0
    low: float = 0.0
    high: float = 0.0
    rounds: int = 0
    difference: float = 0.0
    """Largest difference of the answers, relative to the largest number."""
    problem: str = ""
    failed: bool = False

    def __str__(self) -> str:
        if self.problem:
            return f"{self.case:48}{self.problem}"
        times = f"{1e6 * self.before:12,.2f}{1e6 * self.after:12,.2f}"
        verdict = "  SLOWER" if self.failed else ""
        return f"{self.case:48}{times}{self.ratio:8.3f}  {self.low:.3f} .. {self.high:.3f}{verdict}"


def measure(case: Case, before: Checkout, after: Checkout, rounds: int, bar: float) -> Row:
    """Check and time one case."""
    first, second = (checkout.ask(case=case.name) for checkout in (before, after))
    if "error" in first:
        # Absent in both, or new.
        return Row(case.name, problem=f"not in the first: {first['error']}")
    if "error" in second:
        return Row(case.name, problem=f"not in the second: {second['error']}", failed=True)
    apart = difference(first["answer"], second["answer"])
    if not apart <= case.tolerance:
        return Row(case.name, difference=apart, problem=f"answers differ by {apart:.1e}", failed=True)
    calls = min(first["calls"], second["calls"])
    times: list[tuple[float, float]] = []
    for number in range(rounds):
        tell(f"{case.name}: round {number + 1} of {rounds}")
        pair = {}
        # Each checkout is the first in every other round.
        for k in (0, 1) if number % 2 else (1, 0):
            reply = (before, after)[k].ask(calls=calls)
            if "error" in reply:
                return Row(case.name, problem=reply["error"], failed=True)
            pair[k] = reply["seconds"]
        times.append((pair[0], pair[1]))
    tell("")
    samples = np.array(times)
    medians = np.median(samples, axis=0)
    low, high = interval(samples)
    ratio = float(medians[0] / medians[1])
    return Row(
        case.name, float(medians[0]), float(medians[1]), ratio, low, high, rounds, apart, failed=low < bar
    )


def difference(a: Sequence[float], b: Sequence[float]) -> float:
    """Return the largest difference of two answers relative to the largest number; NaN equals NaN."""
    x, y = np.array(a), np.array(b)
    if x.shape != y.shape or np.any(np.isnan(x) != np.isnan(y)):
        return float("inf")
    scale = max(float(np.nanmax(np.abs(x), initial=0.0)), 1e-300)
    return float(np.nanmax(np.abs(x - y), initial=0.0)) / scale


def interval(samples: Any) -> tuple[float, float]:
    """Return the 95 % interval of the ratio of the medians of two columns (n, 2), by resampling rows."""
    rng = np.random.default_rng(0)
    chosen = samples[rng.integers(len(samples), size=(RESAMPLES, len(samples)))]
    medians = np.median(chosen, axis=1)
    low, high = np.quantile(medians[:, 0] / medians[:, 1], (0.025, 0.975))
    return float(low), float(high)


def tell(what: str) -> None:
    """Write how far the command is over the line before, on standard error; nothing in a file."""
    if sys.stderr.isatty():
        print(f"\r{what:100.100}", end="\r" if not what else "", file=sys.stderr, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the rows; return 1 if one failed."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.side_by_side", description=__doc__)
    parser.add_argument("--before", type=Path, help="Python that imports the first checkout")
    parser.add_argument("--after", type=Path, help="Python that imports the second", default=sys.executable)
    parser.add_argument("--rounds", type=int, default=30)
    parser.add_argument("--only", action="append", metavar="TEXT", help="cases whose names contain it")
    parser.add_argument("--bar", type=float, default=MIN_RATIO, help="lowest end of an interval")
    parser.add_argument("--json", type=Path, metavar="FILE", help="the rows, written after each")
    parser.add_argument("--list", action="store_true", help="list the cases")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args(arguments)
    if chosen.serve:
        serve()
        return 0
    wanted = [case for case in cases() if any(text in case.name for text in chosen.only or [""])]
    if chosen.list:
        print(*(case.name for case in wanted), sep="\n")
        return 0
    if chosen.before is None:
        parser.error("--before is needed")
    rows = _recorded(chosen.json)
    print(f"{'case':48}{'before [us]':>12}{'after [us]':>12}{'ratio':>8}  95 % interval")
    checkouts = Checkout(chosen.before), Checkout(chosen.after)
    try:
        for number, case in enumerate(wanted):
            if case.name not in rows:
                tell(f"{number} of {len(wanted)} cases; {case.name}")
                rows[case.name] = measure(case, *checkouts, chosen.rounds, chosen.bar)
                if chosen.json:
                    text = json.dumps([asdict(row) for row in rows.values()], indent=1)
                    chosen.json.write_text(text + "\n")
            print(rows[case.name], flush=True)
    finally:
        for checkout in checkouts:
            checkout.close()
    failed = [row for row in rows.values() if row.failed]
    untimed = sum(not row.rounds for row in rows.values())
    print(
        f"{len(rows)} cases, {untimed} of them not timed; {len(failed)} below the bar or with other answers"
    )
    return 1 if failed else 0


def _recorded(file: Path | None) -> dict[str, Row]:
    """Return the rows of an interrupted run."""
    if file is None or not file.exists():
        return {}
    return {row["case"]: Row(**row) for row in json.loads(file.read_text())}


if __name__ == "__main__":
    sys.exit(main())

"""Every benchmark runs once, its answer checked and nothing timed, so that none can rot."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from dynx.backends import installed_backends

ROOT = Path(__file__).resolve().parent.parent


def test_every_benchmark_runs() -> None:
    finished = run("pytest", "benchmarks", "--benchmark-disable", "-q")
    assert finished.returncode == 0, finished.stdout + finished.stderr


def test_many_joints_are_opened_or_refused_by_every_backend() -> None:
    finished = run("benchmarks.many_joints", "248")
    assert finished.returncode == 0, finished.stdout + finished.stderr
    for name in installed_backends():
        assert name in finished.stdout


def test_the_table_of_peers_has_dynx_first() -> None:
    # Without the two peers for which something is compiled for seconds.
    quick = ["--without", "adam, JAX", "--without", "CasADi map, C code"]
    table = ["ur5", "--quantity", "mass_matrix", "--batch", "4096", "--repetitions", "3", *quick]
    finished = run("benchmarks.compare", *table)
    assert finished.returncode == 0, finished.stdout + finished.stderr
    rows = [line for line in finished.stdout.splitlines() if line.startswith("| ")]
    assert [row.split(" | ")[0] for row in rows[:2]] == ["| implementation", "| compiled"]


def test_simulators_are_right_and_timed() -> None:
    finished = run("benchmarks.simulation", "--quick", "--repetitions", "1", "--json")
    assert finished.returncode == 0, finished.stdout + finished.stderr
    results = json.loads(finished.stdout)["results"]
    ours = [each for each in results if each["name"].startswith("dynx, ")]
    assert {each["threads"] for each in ours} == {1, 2}
    assert all(each["step"] > 0.0 and each["checks"] for each in results)


def test_robots_on_their_feet_obey_the_laws_of_contact() -> None:
    quick = ["--batch", "16", "--mujoco-batch", "2", "--seconds", "0.1", "--motion", "standing"]
    finished = run("benchmarks.contact_steps", *quick)
    assert finished.returncode == 0, finished.stdout + finished.stderr
    assert "standing: dynx " in finished.stdout


def test_two_checkouts_are_timed_side_by_side(tmp_path: Path) -> None:
    file = tmp_path / "rows.json"
    names = ["call compiled inverse_dynamics", "quantity ur5 mass_matrix 128", "rollouts compiled"]
    only = [word for name in names for word in ("--only", name)]
    both = ["--before", sys.executable, "--after", sys.executable]
    finished = run(
        "benchmarks.side_by_side", *both, *only, "--rounds", "3", "--bar", "0", "--json", str(file)
    )
    assert finished.returncode == 0, finished.stdout + finished.stderr
    rows = json.loads(file.read_text())
    assert [row["case"] for row in rows] == names
    for row in rows:
        assert row["difference"] == 0.0
        assert 0.0 < row["low"] <= row["ratio"] <= row["high"]
        assert row["rounds"] == 3


def test_poses_are_solved_in_kernels() -> None:
    finished = run("benchmarks.inverse_kinematics", "z1", "--poses", "200")
    assert finished.returncode == 0, finished.stdout + finished.stderr
    assert finished.stdout.split()[:3] == ["z1", "100.00%", "solved;"]


def test_paths_are_followed_in_kernels() -> None:
    finished = run("benchmarks.kinematics.tracking", "z1", "--paths", "2")
    assert finished.returncode == 0, finished.stdout + finished.stderr
    assert finished.stdout.splitlines()[-1].startswith("| z1 | 100 / 0 / 0 / 0 / 0 | 2 |")


def test_obstacles_are_avoided() -> None:
    finished = run("benchmarks.kinematics.avoidance", "z1", "--poses", "20")
    assert finished.returncode == 0, finished.stdout + finished.stderr
    assert finished.stdout.splitlines()[-1].startswith("| z1 | 20 |")


def test_integrators_are_of_their_order() -> None:
    finished = run("benchmarks.integrators", "--quick")
    assert finished.returncode == 0, finished.stdout + finished.stderr
    assert finished.stdout.count("fitted order") == 3
    # The drift from one start says little about that from another.
    assert "20 random starts" in finished.stdout


def test_calls_of_bindings_have_the_results_of_dynx() -> None:
    finished = run("benchmarks.call_overhead", "--repetitions", "1")
    # A time measured once on a busy machine may be beyond the bound.
    assert finished.returncode in (0, 1), finished.stdout + finished.stderr
    rows = finished.stdout.splitlines()[1:]
    engines = [name for name in ("pinocchio", "pybullet", "mujoco", "drake") if name in installed_backends()]
    assert all(sum(row.startswith(name) for row in rows) >= 9 for name in engines), finished.stdout


def test_batches_of_every_size_are_right() -> None:
    finished = run("benchmarks.batch_sizes", "ur5", "--batch", "8", "--batch", "300", "--repetitions", "1")
    # A ratio measured once on a busy machine may be below its bound.
    assert finished.returncode in (0, 1), finished.stdout + finished.stderr
    assert len(finished.stdout.splitlines()) == 8, finished.stdout


def test_the_table_of_every_quantity_compares_the_engines() -> None:
    chosen = ["--robot", "ur5", "--quantity", "mass_matrix", "--batch", "64", "--repetitions", "1"]
    finished = run("benchmarks.every_quantity", *chosen)
    # A ratio measured once on a busy machine may be below 1.
    assert finished.returncode in (0, 1), finished.stdout + finished.stderr
    assert len([line for line in finished.stdout.splitlines() if line.startswith("ur5")]) == 2


def test_compile_times_are_measured_with_an_empty_cache_and_kept(tmp_path: Path) -> None:
    record = tmp_path / "rows.jsonl"
    command = ["benchmarks.compile_times", "--robots", "pendulum", "--bases", "fixed"]
    command += ["--kinds", "mass_matrix", "--record", str(record)]
    finished = run(*command)
    assert finished.returncode == 0, finished.stdout + finished.stderr
    heading, *rows = finished.stdout.splitlines()
    assert heading.split() == ["seconds", "MiB", "robot", "kind"]
    assert {row.split("fixed")[1].strip() for row in rows} == {"mass_matrix", "parametric mass_matrix"}
    assert all(float(row.split()[0]) > 0.0 for row in rows)
    # A row of the file is not measured again, and its time is judged all the same.
    first, second = record.read_text(encoding="utf-8").splitlines()
    record.write_text(json.dumps({**json.loads(first), "seconds": 77.0}) + "\n", encoding="utf-8")
    resumed = run(*command)
    assert resumed.returncode == 1, resumed.stdout + resumed.stderr
    assert "77.00" in resumed.stdout
    kinds = [json.loads(line)["kind"] for line in record.read_text(encoding="utf-8").splitlines()]
    assert kinds == [json.loads(each)["kind"] for each in (first, second)]


def run(*command: str) -> subprocess.CompletedProcess[str]:
    """Run `python -m` with these arguments in the root of the repository."""
    # Options meant for this run, such as its number of processes, are not meant for that one.
    environment = {name: value for name, value in os.environ.items() if name != "PYTEST_ADDOPTS"}
    return subprocess.run(
        [sys.executable, "-m", *command],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )

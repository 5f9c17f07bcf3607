"""The site: each page has its place, each link and anchor its target, each public name its entry."""

from __future__ import annotations

import ast
import re
from functools import cache
from importlib import import_module
from inspect import unwrap
from pathlib import Path

import pytest

from docs.heading_anchors import anchor

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
ENTRIES = re.findall(
    r"^\.\. auto(class|function|data|exception):: ([\w.]+)$",
    "\n".join(path.read_text(encoding="utf-8") for path in sorted((DOCS / "reference/api").glob("*.md"))),
    flags=re.MULTILINE,
)


def public_names() -> dict[str, list[str]]:
    """Return what each module of dynx declares as public, and the classes of `dynx.errors`."""
    found = {}
    for path in sorted((ROOT / "dynx").rglob("*.py")):
        if path.name == "library.py":  # what a foreign library gives to dynx itself
            continue
        parts = path.relative_to(ROOT).with_suffix("").parts
        module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        text = path.read_text(encoding="utf-8")
        if module != "dynx.errors" and "__all__" not in text:
            continue
        tree = ast.parse(text)
        if module == "dynx.errors":
            found[module] = [each.name for each in tree.body if isinstance(each, ast.ClassDef)]
        for node in tree.body:
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
                found[module] = ast.literal_eval(node.value)
    return found


PUBLIC = public_names()

EXAMPLES = {
    "dynx": (
        "Backend BatchRollouts Derivatives ExternalForce IKResult Model Noise PDMotor Payload "
        "Pose PositionMotor Rollout Scenario Scene ScenePlant Simulation TorqueMotor "
        "VelocityMotor World agree backend compare compare_as_loaded diagnose inertial_parameters "
        "installed_backends inverse_kinematics load parametric quat_from_rpy robots "
        "rotation_from_quat rotation_from_rpy rpy_from_rotation same_robot simulate simulate_batch"
    ),
    "dynx.contacts": "conform",
    "dynx.control": (
        "BulletPositionMotor ComputedTorque Controller DiscreteComputedTorque Encoders "
        "FeedForward FrictionCompensation GravityCompensatedPD Impedance MomentumObserver "
        "MotorLag OpenLoop OperationalSpace PD PID Saturated model_dynamics"
    ),
    "dynx.distance": "Hull contact_points distance",
    "dynx.envs": "Randomization make_environment",
    "dynx.ik": "FrameTarget closed_form",
    "dynx.ik.tracking": "track",
    "dynx.model": "Joint Link",
    "dynx.sim": "plant_model",
    "dynx.testing": "agreement_tests assert_same_robot",
    "dynx.trajectory": (
        "Identifiability Setpoint Trajectory check concatenate cubic cycloidal excitation from_function "
        "line quintic s_curve spline time_optimal time_optimal_path trapezoidal violations"
    ),
    "dynx.viewer": "Viewer view",
    "dynx.world": (
        "Camera ContactSensor Encoder ForceTorqueSensor Imu JointTorqueSensor Material Picture "
        "RaySensor SceneRobot Weld box capsule cylinder ellipsoid ground read_scene scene_to_mjcf sphere "
        "write_scene"
    ),
}
"""Names, by their module, that most users meet: the entry of each has an example."""


@cache
def value(name: str) -> object:
    """Return the object of a name, without what answers mistaken keywords around it."""
    module, _, attribute = name.rpartition(".")
    found = getattr(import_module(module), attribute)
    return unwrap(found) if callable(found) else found


@pytest.mark.parametrize("module", PUBLIC)
def test_every_public_name_has_an_entry(module: str) -> None:
    """Under its own name, or as the same object under a shorter one."""
    entries = {name for _, name in ENTRIES}
    missing = [name for name in PUBLIC[module] if f"{module}.{name}" not in entries]
    if missing:
        documented = [value(name) for name in entries if not name.startswith("dynx.training.")]
        missing = [
            name
            for name in missing
            if not (name.islower() and f"{module}.{name}" in PUBLIC)  # a module, whose names have entries
            and not any(value(f"{module}.{name}") is each for each in documented)
        ]
    assert missing == []


def test_every_entry_is_public_and_stands_once() -> None:
    names = [name for _, name in ENTRIES]
    assert len(names) == len(set(names))
    public = {f"{module}.{name}" for module, declared in PUBLIC.items() for name in declared}
    assert set(names) - public == set()


def test_what_users_meet_has_an_example() -> None:
    """Below its entry; tests/test_readme.py runs a sample of the examples, tests/page_blocks.py all."""
    pages = "\n".join(path.read_text(encoding="utf-8") for path in (DOCS / "reference/api").glob("*.md"))
    shown = re.findall(r"^\.\. auto\w+:: ([\w.]+)\n\n {3}\.\. code-block:: python$", pages, re.MULTILINE)
    wanted = [f"{module}.{name}" for module, names in EXAMPLES.items() for name in names.split()]
    assert len(wanted) >= 80
    assert sorted(shown) == sorted(wanted)


def targets(path: Path) -> list[str]:
    """Return what the table of contents of a page lists, as paths below docs without the suffix."""
    text = path.read_text(encoding="utf-8")
    found = []
    for block in re.findall(r"^```\{toctree\}\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL):
        for line in block.splitlines():
            if line and not line.startswith(":"):
                target = re.sub(r".*<(.*)>", r"\1", line)  # a title stands in front
                base = DOCS if target.startswith("/") else path.parent
                matches = base.glob(f"{target.lstrip('/')}.md")
                found += [each.relative_to(DOCS).as_posix() for each in matches if each != path]
    return found


def test_every_page_has_one_place() -> None:
    listed = [target for path in PAGES for target in targets(path)]
    assert sorted([*listed, "index.md"]) == [path.relative_to(DOCS).as_posix() for path in PAGES]


@cache
def anchors(path: Path) -> set[str]:
    text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = (
        re.sub(r"`|\[|\]\([^)]*\)", "", line) for line in re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    )
    return {anchor(line) for line in headings}


@pytest.mark.parametrize(
    "path", [*PAGES, ROOT / "README.md"], ids=lambda path: path.relative_to(ROOT).as_posix()
)
def test_links_to_sections_have_their_heading(path: Path) -> None:
    for target, name in re.findall(r"\]\(([^)#:]*)#([^)]+)\)", path.read_text(encoding="utf-8")):
        assert name in anchors((path.parent / target).resolve() if target else path), f"{target}#{name}"


def test_every_schema_is_listed() -> None:
    listed = re.findall(
        r"\]\(\.\./schemas/(.*)\)", (DOCS / "reference/schemas.md").read_text(encoding="utf-8")
    )
    assert listed == sorted(path.name for path in (DOCS / "schemas").glob("*.json"))

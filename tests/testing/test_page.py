"""docs/testing.md: its YAML is valid, its commands have the options that they use; its reference has all."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from dynx.cli.commands.comparison import doctor, same
from dynx.testing import plugin
from tests.page_blocks import ROOT, fenced

PAGE = (ROOT / "docs" / "testing.md").read_text(encoding="utf-8")
REFERENCE = (ROOT / "docs" / "reference" / "testing.md").read_text(encoding="utf-8")


class Options:
    """Takes the options of the plugin, as pytest does."""

    def __init__(self) -> None:
        self.flags: dict[str, dict[str, Any]] = {}
        self.settings: list[str] = []
        parser: Any = self
        plugin.pytest_addoption(parser)

    def getgroup(self, *_: str) -> Options:
        return self

    def addoption(self, flag: str, **how: Any) -> None:
        self.flags[flag] = how

    def addini(self, name: str, *_: str, **__: str) -> None:
        self.settings.append(name)


def workflow_commands() -> Iterator[str]:
    """Yield the commands of the workflow, of the step that stands for one of its steps, and of the hook."""
    yaml = import_module("yaml")
    action, workflow, step, hooks = map(yaml.safe_load, fenced("yaml", PAGE))
    (used,) = [each for each in action if each["uses"].startswith("OWNER/dynx@")]
    own_action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    assert used["with"].keys() <= own_action["inputs"].keys()
    assert workflow["permissions"]["security-events"] == "write"
    for each in [*(step for job in workflow["jobs"].values() for step in job["steps"]), *step]:
        assert ("run" in each) != ("uses" in each)
        if "run" in each:
            yield from each["run"].splitlines()
    (repository,) = hooks["repos"]
    (hook,) = repository["hooks"]
    for each in (hook, own_hook()):
        yield f"{each['entry']} robots/my.urdf"  # pre-commit appends the files of the commit


def own_hook() -> Any:
    return own_hooks()["dynx-doctor"]


def own_hooks() -> dict[str, Any]:
    text = (ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8")
    return {hook["id"]: hook for hook in import_module("yaml").safe_load(text)}


def commands() -> list[str]:
    shown = [line for block in fenced("sh", PAGE) for line in block.splitlines()]
    return [*shown, *workflow_commands()]


def test_the_hook_of_the_page_takes_the_files_of_dynx_own_hook() -> None:
    *_, hooks = map(import_module("yaml").safe_load, fenced("yaml", PAGE))
    (shown,) = hooks["repos"][0]["hooks"]
    own = own_hook()
    assert all(shown[key] == own[key] for key in ("id", "files", "require_serial"))
    taken = re.compile(own["files"])
    assert all(taken.search(name) for name in ("robots/my.urdf", "my.urdf.xacro"))
    assert not any(taken.search(name) for name in ("my.xacro", "my.urdf.md"))
    # The environment that pre-commit makes has the dependencies of dynx, and no extra.
    assert any(each.startswith("xacro") for each in own["additional_dependencies"])


def test_commands_have_the_options() -> None:
    programs = set()
    for command in commands():
        program, *words = shlex.split(command)
        programs.add(program)
        if program == "dynx":
            assert words[0] == "doctor"
            doctor.make_context("doctor", words[1:])
        elif program == "pytest":
            flags = {word.partition("=")[0] for word in words if word.startswith("--dynx")}
            assert flags <= Options().flags.keys()
        else:
            assert program in ("pip", "mkdir")
    assert programs == {"dynx", "pytest", "pip", "mkdir"}


def test_the_page_on_pairs_has_the_action_and_the_hook() -> None:
    page = (ROOT / "docs" / "same.md").read_text(encoding="utf-8")
    (step,), hooks = map(import_module("yaml").safe_load, fenced("yaml", page))
    action = import_module("yaml").safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    assert step["with"].keys() <= action["inputs"].keys()
    (shown,) = hooks["repos"][0]["hooks"]
    own = own_hooks()[shown["id"]]
    assert own["pass_filenames"] is False
    taken = re.compile(own["files"])
    assert all(taken.search(name) for name in shown["args"])
    program, command = own["entry"].split()
    assert program == "dynx"
    same.make_context(command, [*shown["args"]])


def test_extras_exist() -> None:
    known = re.search(
        r"^\[project.optional-dependencies\]\n(.*?)^\[",
        (ROOT / "pyproject.toml").read_text(encoding="utf-8"),
        flags=re.MULTILINE | re.DOTALL,
    )
    assert known
    extras = re.findall(r"^(\w+) = ", known.group(1), flags=re.MULTILINE)
    used = [extra for found in re.findall(r"dynx\[([\w,]+)\]", PAGE) for extra in found.split(",")]
    assert used
    assert set(used) <= set(extras)


def test_the_sarif_that_is_written_is_the_one_uploaded() -> None:
    (written,) = re.findall(r"--sarif (\S+)", PAGE)
    (uploaded,) = re.findall(r"sarif_file: (\S+)", PAGE)
    assert written == uploaded


def test_every_option_and_input_is_in_the_reference() -> None:
    options = Options()
    for flag in options.flags:
        assert f"`{flag}" in REFERENCE, flag
    for setting in options.settings:
        assert setting in REFERENCE
    action = import_module("yaml").safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    for name in (*action["inputs"], *action["outputs"]):
        assert f"`{name}`" in REFERENCE, name
    (ini,) = fenced("toml", PAGE)
    assert re.search(r"^dynx_robots = \[", ini, flags=re.MULTILINE)


def test_the_plugin_is_an_entry_point() -> None:
    text = (Path(ROOT) / "pyproject.toml").read_text(encoding="utf-8")
    assert '[project.entry-points.pytest11]\ndynx = "dynx.testing.plugin"\n' in text


def test_the_page_on_mutation_testing_has_its_options() -> None:
    page = (ROOT / "docs" / "explanation" / "how-dynx-is-tested.md").read_text(encoding="utf-8")
    shown = [shlex.split(line, comments=True) for block in fenced("sh", page) for line in block.splitlines()]
    found = [words[3:] for words in shown if words[:3] == ["python", "-m", "tests.mutation"]]
    assert found
    for words in found:
        assert {word for word in words if word.startswith("--")} <= {"--record", "--seed", "--count"}

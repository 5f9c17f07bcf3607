"""List, show and check the tasks: see the package's docstring."""

import argparse
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from tests.tasks.task import Task, Wrong

AUDIENCES = {"student": "student", "control": "control engineer", "learning": "RL researcher"}


def task_modules() -> dict[int, str]:
    """Return the module of each task by its number."""
    modules: dict[int, str] = {}
    for folder in AUDIENCES:
        for module in iter_modules([str(Path(__file__).with_name(folder))]):
            if not module.name.startswith("task_"):
                continue
            number = int(module.name.split("_")[1])
            modules[number] = f"tests.tasks.{folder}.{module.name}"
    return dict(sorted(modules.items()))


def load_task(number: int) -> Task:
    """Return the task of this number."""
    task = import_module(task_modules()[number]).TASK
    assert isinstance(task, Task)
    return task


def show(number: int, folder: Path | None) -> None:
    """Print the text of a task and its files; write the files to a folder if one is named."""
    task = load_task(number)
    print(f"Task {number}: {task.title}\n\n{task.text.strip()}")
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    for name, text in task.files.items():
        content = text()
        if folder is not None:
            (folder / name).write_text(content)
            print(f"\n[{name} is in {folder}]")
        elif content.count("\n") < 150:
            print(f"\n--- {name}\n{content.rstrip()}")
        else:
            print(f"\n[{name}: run `python -m tests.tasks show {number} FOLDER` to get this long file]")


def check(number: int, folder: Path) -> int:
    """Check an answer; return the exit code."""
    try:
        load_task(number).check(folder.resolve())
    except Wrong as wrong:
        print(f"task {number}: {' '.join(str(wrong).split())}")
        return 1
    print(f"task {number}: right")
    return 0


def main(arguments: list[str]) -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.tasks")
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="numbers and titles")
    for name, text in (("show", "text of a task"), ("check", "check of an answer")):
        command = commands.add_parser(name, help=text)
        command.add_argument("number", type=int, choices=task_modules(), metavar="N")
        command.add_argument("folder", type=Path, nargs="?" if name == "show" else None)
    options = parser.parse_args(arguments)
    if options.command == "check":
        return check(options.number, options.folder)
    if options.command == "show":
        show(options.number, options.folder)
        return 0
    for number, module in task_modules().items():
        print(f"{number:2}  {AUDIENCES[module.split('.')[2]]:16}  {load_task(number).title}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

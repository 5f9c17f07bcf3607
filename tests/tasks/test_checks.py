"""The checks accept answers by hand and refuse wrong ones."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.tasks.__main__ import load_task, main, task_modules
from tests.tasks.by_hand import ANSWERS
from tests.tasks.task import Wrong

WRITTEN_TEXT: dict[int, tuple[str, str, str]] = {
    12: ("answer.urdf", '<mass value="0"/>', '<mass value="0.1"/>'),
    13: ("check.sh", '"$1"', '"$1" || true'),
    19: ("program.py", "-0.5]", "0]"),
    20: ("answer.xml", 'damping="0.2"', 'damping="0.3"'),
    21: ("policy.py", "return -", "return "),
    28: ("env.py", "np.array([10, 3])", "np.array([10, 2])"),
}
"""File, text and wrong text of answers that are programs or descriptions."""


def refused(number: int, folder: Path) -> None:
    """Require that a task refuses what lies in a folder."""
    with pytest.raises(Wrong):
        load_task(number).check(folder)


def perturbations(value: object) -> list[object]:
    """Return wrong values in place of a value of `answer.json`."""
    if isinstance(value, str):
        return ["base"]
    array = np.array(value, dtype=float)
    wrong = [array * 1.1 + 0.1, -array - 0.1]
    if array.ndim and array.size > 1:
        wrong += [array[..., ::-1] + 0.0, array.ravel()[:-1]]
        one = array.copy()
        one.flat[-1] = one.flat[-1] * 1.3 + 0.2
        wrong.append(one)
    return [item.tolist() for item in wrong if not np.array_equal(item, array)]


def refuse_wrong_numbers(number: int, folder: Path) -> None:
    """Replace each entry of `answer.json` by wrong ones; also leave it out."""
    path = folder / "answer.json"
    right = json.loads(path.read_text())
    for key, value in right.items():
        path.write_text(json.dumps({name: entry for name, entry in right.items() if name != key}))
        refused(number, folder)
        for wrong in perturbations(value):
            path.write_text(json.dumps({**right, key: wrong}))
            refused(number, folder)
    path.write_text(json.dumps(right))


def refuse_wrong_table(number: int, folder: Path) -> None:
    """Change the last row of `answer.csv`, and leave it out."""
    path = folder / "answer.csv"
    lines = path.read_text().splitlines()
    cells = lines[-1].split(",")
    cells[-1] = str(float(cells[-1]) + 0.1)
    for wrong in ([*lines[:-1], ",".join(cells)], lines[:-1]):
        path.write_text("\n".join(wrong))
        refused(number, folder)
    path.write_text("\n".join(lines))


def refuse_wrong_array(number: int, folder: Path) -> None:
    """Change one row of a NumPy file."""
    path = folder / ("answer.npy" if number == 23 else "answer.npz")
    if number == 23:
        states = np.load(path)
        states[7, 1] += 0.1
        np.save(path, states)
    else:
        with np.load(path) as archive:
            data = dict(archive)
        data["actions"][3, 4] += 1.0
        np.savez(path, **data)
    refused(number, folder)


def test_thirty_tasks_and_an_answer_to_each() -> None:
    assert list(task_modules()) == list(range(1, 31)) == list(ANSWERS)


@pytest.mark.long_cases
@pytest.mark.parametrize("number", ANSWERS)
def test_answers(number: int, tmp_path: Path) -> None:
    """An empty folder is refused, the answer by hand accepted, and each wrong answer refused."""
    refused(number, tmp_path)
    ANSWERS[number](tmp_path)
    load_task(number).check(tmp_path)
    if (tmp_path / "answer.json").is_file():
        refuse_wrong_numbers(number, tmp_path)
    if (tmp_path / "answer.csv").is_file():
        refuse_wrong_table(number, tmp_path)
    if number in (23, 30):
        refuse_wrong_array(number, tmp_path)
    if number in WRITTEN_TEXT:
        name, right, wrong = WRITTEN_TEXT[number]
        text = (tmp_path / name).read_text()
        assert right in text
        (tmp_path / name).write_text(text.replace(right, wrong))
        refused(number, tmp_path)


def test_given_files_are_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`show` writes what a task gives, `check` prints one line."""
    command: Callable[..., int] = main
    assert command(["show", "17", str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"arm.urdf", "log.csv"}
    capsys.readouterr()
    assert command(["check", "17", str(tmp_path)]) == 1
    assert capsys.readouterr().out.count("\n") == 1


def test_a_right_answer_is_called_right(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    number = min(ANSWERS)
    monkeypatch.chdir(tmp_path)
    assert main(["show", str(number), "answers/mine"]) == 0
    ANSWERS[number](Path("answers/mine"))
    capsys.readouterr()
    assert main(["check", str(number), "answers/mine"]) == 0
    assert capsys.readouterr().out == f"task {number}: right\n"

"""Errors of dynx: what they carry, also through a pickle, and the parts of their messages."""

from __future__ import annotations

import ast
import importlib.metadata
import json
import pickle
import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx import errors
from dynx.errors import (
    DescriptionError,
    DivergedError,
    DynxError,
    LimitError,
    LimitViolation,
    NoClosedFormError,
    NotInstalledError,
    SimulationError,
    TrajectoryError,
    escaped,
    located,
    nearest,
    nonblank_lines,
    shown,
    traceback_wanted,
)

KINDS = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, DynxError)]

VIOLATION = LimitViolation("elbow", "velocity", 0.25, 3.0625, 2.5, "rad/s")

FIELDS: dict[type[DynxError], dict[str, Any]] = {
    DescriptionError: {"source": "robot.urdf", "line": 7},
    TrajectoryError: {"at": 0.25},
    LimitError: {"violations": (VIOLATION,)},
    SimulationError: {"time": 0.5, "step": 50, "state": ([1.0], [2.0]), "rollout": None},
    NoClosedFormError: {"remedies": (("waist",), ("elbow", "wrist"))},
}
"""Attributes of a class and its subclasses besides the message."""


@pytest.mark.parametrize("kind", KINDS)
def test_an_error_has_its_fields_and_keeps_them_in_a_pickle(kind: type[DynxError]) -> None:
    fields = next((FIELDS[each] for each in kind.__mro__ if each in FIELDS), {})
    error = kind("went wrong", **fields)
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is kind
    assert "went wrong" in str(error)
    assert str(again) == str(error)
    for each in (error, again):
        assert vars(each).items() >= fields.items()
        assert getattr(each, "message", "went wrong") == "went wrong"
        assert getattr(each, "overshoot", None) is None
    assert hasattr(error, "overshoot") == issubclass(kind, DivergedError)


@pytest.mark.parametrize(
    ("source", "line", "whole"),
    [
        (None, None, "bad tag"),
        (None, 7, "line 7: bad tag"),
        ("a.urdf", None, "a.urdf: bad tag"),
        ("a.urdf", 7, "a.urdf:7: bad tag"),
        ("a.xacro", None, "a.xacro: bad tag"),
        ("a.xacro", 7, "a.xacro, line 7 of its URDF: bad tag"),
    ],
)
def test_a_message_begins_with_its_place(source: str | None, line: int | None, whole: str) -> None:
    assert located("bad tag", source, line) == whole
    assert str(DescriptionError("bad tag", source=source, line=line)) == whole


@given(st.text(max_size=400), st.integers(40, 200))
def test_quoted_text_is_printable_and_at_most_as_long_as_wanted(text: str, limit: int) -> None:
    for write, quotes in ((shown, 1), (escaped, 0)):
        written = write(text, limit)
        assert written.isprintable()
        whole = repr(text) if quotes else repr(text)[1:-1]
        if len(whole) <= limit:
            assert written == whole
            continue
        # As much of the text as fits beside its length.
        assert len(written) == limit
        kept, dots, length = written.rpartition("...")
        assert dots
        assert whole.startswith(kept)
        assert f"({len(text)} characters)" in length
        assert length.startswith("'") == bool(quotes)


@pytest.mark.parametrize("value", [10**5000, [1, 10**5000]], ids=["alone", "in a list"])
def test_a_number_of_too_many_digits_is_named_by_its_type(value: object) -> None:
    for write in (shown, escaped):
        assert f"{type(value).__name__} with too many digits" in write(value)


def test_only_near_names_are_offered_and_at_most_three() -> None:
    known = ["tool0", "base_link", "wrist_1", "wrist_2", "wrist_3", "wrist_4"]
    assert quoted(nearest("Tool", known)) == ["tool0"]
    assert len(quoted(nearest("wrist", known))) == 3
    assert set(quoted(nearest("wrist", known))) < set(known[2:])
    assert quoted(nearest("BASE_LINK", known)) == ["base_link"]


def test_without_a_near_name_the_known_ones_are_named_or_counted() -> None:
    names = [f"axis_{number}" for number in range(9)]
    assert nearest("gripper", []) == ""
    assert all(name in nearest("gripper", names[:8]) for name in names[:8])
    told = nearest("gripper", names)
    assert "9 are known" in told
    assert re.findall(r"axis_\d", told) == names[:5]
    # A text of any length is compared in no time: a very long one is near to none.
    assert quoted(nearest(names[0] * 100, names)) == []


def quoted(text: str) -> list[str]:
    return [ast.literal_eval(each) for each in re.findall(r"'[^']*'", text)]


@pytest.mark.parametrize("count", range(1, 9))
def test_remedies_after_the_first_are_named_or_counted(count: int) -> None:
    remedies = [(f"joint_{number}", f"other_{number}") for number in range(count)]
    error = NoClosedFormError("no spherical wrist", remedies)
    assert "given={'joint_0': ..., 'other_0': ...}" in str(error)
    named = re.findall(r"joint_(\d) and other_\1", error.alternatives)
    more = re.findall(r"or (\d) more", error.alternatives)
    assert len(named) + sum(map(int, more)) == count - 1
    assert len(named) == (3 if more else count - 1)
    assert error.alternatives in str(error)
    assert bool(error.alternatives) == (count > 1)


def test_without_remedies_the_error_advises_a_search() -> None:
    assert "all_solutions" in str(NoClosedFormError("no spherical wrist"))


def test_a_violation_states_value_and_limit_with_their_unit() -> None:
    assert str(VIOLATION) == "velocity of 'elbow' is 3.0625 rad/s at 0.25 s; its limit is 2.5 rad/s"


def test_blank_lines_are_left_out() -> None:
    assert nonblank_lines(ValueError("\n  one \n\n \t\ntwo\n")) == ["one", "two"]
    assert nonblank_lines("") == []


@pytest.mark.parametrize(
    ("value", "wanted"), [(None, False), ("", False), ("0", False), ("1", True), ("yes", True)]
)
def test_the_environment_turns_tracebacks_on(
    value: str | None, wanted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DYNX_TRACEBACK", raising=False)
    if value is not None:
        monkeypatch.setenv("DYNX_TRACEBACK", value)
    assert traceback_wanted() == wanted


ORIGINS = {
    "a clone": (
        {"url": "file:///home/me/dynx", "dir_info": {"editable": True}},
        "pip install '.[plot]' in the clone",
    ),
    "a repository": (
        {"url": "https://example.org/dynx", "vcs_info": {"vcs": "git"}},
        "pip install 'dynx-robotics[plot] @ git+https://example.org/dynx'",
    ),
    "a wheel": ({"url": "file:///tmp/dynx.whl", "archive_info": {}}, "pip install 'dynx-robotics[plot]'"),
    "an index": (None, "pip install 'dynx-robotics[plot]'"),
}
"""Note of an installer on the origin of dynx, and the words that install an extra."""


@pytest.mark.parametrize("origin", ORIGINS)
def test_an_extra_is_installed_as_dynx_was(origin: str, monkeypatch: pytest.MonkeyPatch) -> None:
    noted, words = ORIGINS[origin]

    class Installed:
        def read_text(self, name: str) -> str | None:
            assert name == "direct_url.json"
            return None if noted is None else json.dumps(noted)

    monkeypatch.setattr(importlib.metadata, "distribution", lambda name: Installed())
    for quote in ("'", '"'):
        error = NotInstalledError(f"a plot needs matplotlib: pip install {quote}dynx[plot]{quote} (or not)")
        assert str(error) == f"a plot needs matplotlib: {words} (or not)"
        assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_without_an_installation_an_extra_is_installed_in_the_clone(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> None:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "distribution", absent)
    assert errors.install_command("plot") == "pip install '.[plot]' in the clone"

"""Anything but a readable regular file raises an error at once that names it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from dynx.errors import DescriptionError, RobotNotFoundError
from dynx.files.reading import MAX_BYTES, read_file


def test_a_file_is_read_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_bytes(b"\r\n\0\xff")
    assert read_file(str(path)) == b"\r\n\0\xff"


def test_a_missing_file_is_not_found(tmp_path: Path) -> None:
    with pytest.raises(RobotNotFoundError, match=r"no such file: .*nothing\.urdf"):
        read_file(str(tmp_path / "nothing.urdf"))


def test_a_directory_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match="is a directory; wanted a file"):
        read_file(str(tmp_path))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no FIFOs")
def test_a_fifo_is_refused_without_waiting(tmp_path: Path) -> None:
    path = tmp_path / "pipe.urdf"
    os.mkfifo(path)
    with pytest.raises(DescriptionError, match="is a FIFO; wanted a regular file"):
        read_file(str(path))


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="this system has no /dev/zero")
def test_a_device_is_refused() -> None:
    with pytest.raises(DescriptionError, match="is a device or socket; wanted a regular file"):
        read_file("/dev/zero")


def test_an_unreadable_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "secret.urdf"
    path.touch()

    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    # Permissions of the file itself do not bind the superuser, under whom tests may run.
    monkeypatch.setattr("dynx.files.reading.os.open", refuse)
    with pytest.raises(DescriptionError, match=r"secret\.urdf: cannot be read: Permission denied"):
        read_file(str(path))


def test_a_file_above_the_cap_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "huge.urdf"
    with path.open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    with pytest.raises(DescriptionError, match="is larger than 64 MiB"):
        read_file(str(path))


@pytest.mark.parametrize("path", ["a\0b.urdf", "x" * 10_000 + ".urdf", "folder\n/\x1b[31m.urdf"])
def test_a_name_that_no_file_can_have_is_an_error_of_ours(path: str) -> None:
    with pytest.raises((DescriptionError, RobotNotFoundError)) as caught:
        read_file(path)
    assert len(str(caught.value)) < 1000
    assert str(caught.value).isprintable()


def test_a_pointer_of_git_lfs_is_no_file(tmp_path: Path) -> None:
    path = tmp_path / "arm.obj"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 14925\n")
    with pytest.raises(DescriptionError, match=r"arm\.obj: is a pointer of Git LFS .*git lfs pull"):
        read_file(str(path))

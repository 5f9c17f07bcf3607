"""A file is written whole or not at all, with the permissions it had; pipes and devices are not replaced."""

from __future__ import annotations

import os
import stat
import sys
import threading
from pathlib import Path

import pytest

from dynx.errors import ArgumentError
from dynx.files.writing import atomic_file, write_bytes


def test_ctrl_c_leaves_nothing_half_written(tmp_path: Path) -> None:
    def interrupted() -> None:
        with atomic_file(tmp_path / "run.csv") as file:
            file.write(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="permissions and links of POSIX")
def test_links_are_followed_and_permissions_kept(tmp_path: Path) -> None:
    target, link = tmp_path / "run.csv", tmp_path / "link.csv"
    with atomic_file(target) as file:
        file.write(b"first")
    (tmp_path / "plain").write_bytes(b"")
    assert target.stat().st_mode == (tmp_path / "plain").stat().st_mode
    target.chmod(0o640)
    link.symlink_to(target)
    with atomic_file(link) as file:
        file.write(b"second")
    assert link.is_symlink()
    assert target.read_bytes() == b"second"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640


@pytest.mark.skipif(sys.platform == "win32", reason="permissions of POSIX")
@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
def test_a_new_file_has_the_mode_asked_for_less_the_umask(tmp_path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        write_bytes(tmp_path / "open", b"")
        write_bytes(tmp_path / "private", b"", mode=0o600)
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "open").stat().st_mode) == 0o666 & ~umask
    assert stat.S_IMODE((tmp_path / "private").stat().st_mode) == 0o600


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no FIFOs")
def test_a_pipe_is_written_to_its_reader_and_stays_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_bytes(pipe, b"content")
    assert os.read(reader, 100) == b"content"
    os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    with pytest.raises(ArgumentError, match="nobody reads from this pipe"):
        write_bytes(pipe, b"content")
    assert [each.name for each in tmp_path.iterdir()] == ["pipe"]


def test_a_device_is_not_replaced(tmp_path: Path) -> None:
    write_bytes(os.devnull, b"content")
    assert not Path(os.devnull).is_file()


def test_of_several_writers_one_wins_with_its_whole_content(tmp_path: Path) -> None:
    contents = [bytes([k]) * 200_000 for k in range(8)]
    path = tmp_path / "shared"
    writers = [threading.Thread(target=write_bytes, args=(path, content)) for content in contents]
    for each in writers:
        each.start()
    for each in writers:
        each.join()
    assert path.read_bytes() in contents
    assert [each.name for each in tmp_path.iterdir()] == ["shared"]

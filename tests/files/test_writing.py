"""A file is written whole or not at all, with the permissions it had; pipes and devices are not replaced."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from dynx.errors import ArgumentError
from dynx.files.writing import atomic_file, clear_unfinished, write_bytes


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


KILLED = """
import os, signal, sys
from dynx.files.writing import atomic_file
with atomic_file(sys.argv[1]) as file:
    file.write(b"half")
    file.flush()
    print("open", flush=True)
    sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL and no file locks")
def test_unfinished_files_are_deleted_when_their_process_has_ended(tmp_path: Path) -> None:
    (tmp_path / ".dynx-mine.part").write_bytes(b"not of that form")
    command = [sys.executable, "-c", KILLED, str(tmp_path / "run.npz")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"open\n"
        clear_unfinished(tmp_path)
        assert len(list(tmp_path.iterdir())) == 2
        process.send_signal(signal.SIGKILL)
    write_bytes(tmp_path / "run.npz", b"whole")
    assert sorted(each.name for each in tmp_path.iterdir()) == [".dynx-mine.part", "run.npz"]


@pytest.mark.skipif(sys.platform == "win32", reason="links and FIFOs of POSIX")
def test_only_regular_files_count_as_unfinished(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    kept.write_bytes(b"")
    (tmp_path / f".dynx-{'0' * 16}.part").symlink_to(kept)
    (tmp_path / f".dynx-{'1' * 16}.part").mkdir()
    os.mkfifo(tmp_path / f".dynx-{'2' * 16}.part")
    clear_unfinished(tmp_path)
    assert len(list(tmp_path.iterdir())) == 4


def test_the_content_is_on_the_disk_before_the_file_gets_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    events: list[object] = []
    sync, rename = os.fsync, os.replace

    def synced(descriptor: int) -> None:
        events.append(
            os.fstat(descriptor).st_size if stat.S_ISREG(os.fstat(descriptor).st_mode) else "folder"
        )
        sync(descriptor)

    def renamed(source: Path, target: Path) -> None:
        events.append("renamed")
        rename(source, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", renamed)
    write_bytes(tmp_path / "run.npz", b"12345")
    assert events == [5, "renamed"] + ["folder"] * (sys.platform != "win32")
    events.clear()
    write_bytes(tmp_path / "cached", b"12345", sync=False)
    assert events == ["renamed"]

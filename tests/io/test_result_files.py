"""A result file is the new one or the old one, never half of one, and never behind a link."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from apo_bench import InputError
from apo_bench.io import open_to_append, replace_file, write_file


def names(folder: Path) -> list[str]:
    return sorted(os.listdir(folder))


def test_what_is_written_takes_the_place_of_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 250 + ".txt")  # as long as names of files may be
    for text in ("one", "two µ", ""):
        write_file(path, text)
        assert path.read_bytes() == text.encode()
    write_file(path, b"\x00\xff")
    assert path.read_bytes() == b"\x00\xff"
    assert names(tmp_path) == [path.name]


@pytest.mark.parametrize("raised", [ValueError, KeyboardInterrupt])
def test_a_block_that_fails_leaves_the_old_file(raised: type[BaseException], tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail() -> None:
        with replace_file(path) as file:
            file.write(b"new")
            raise raised

    with pytest.raises(raised):
        fail()
    assert path.read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_disk_that_fails_is_one_sentence_with_the_path(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fails(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, call, fails)
    with pytest.raises(InputError, match=r"a\.txt cannot be written \(No space left on device\); choose another place"):
        write_file(path, "new")
    assert path.read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


def _link(path: Path) -> None:
    (path.parent / "victim").write_text("mine")
    path.symlink_to("victim")


def _dangling(path: Path) -> None:
    path.symlink_to("nowhere")


@pytest.mark.skipif(sys.platform == "win32", reason="makes links and pipes")
@pytest.mark.parametrize(
    ("made", "what"),
    [(_link, "a symbolic link"), (_dangling, "a symbolic link"), (os.mkfifo, "a pipe"), (os.mkdir, "a folder")],
)
def test_only_an_ordinary_file_is_replaced(made: Callable[[Path], None], what: str, tmp_path: Path) -> None:
    made(tmp_path / "a.txt")
    before = names(tmp_path)
    for write in (lambda path: write_file(path, "new"), open_to_append):
        with pytest.raises(InputError, match=f"a.txt is {what}, and only an ordinary file is written over; remove it"):
            write(tmp_path / "a.txt")
    assert names(tmp_path) == before
    assert made is not _link or (tmp_path / "victim").read_text() == "mine"


@pytest.mark.skipif(sys.platform == "win32", reason="makes links")
def test_a_link_that_is_made_meanwhile_is_replaced_itself(tmp_path: Path) -> None:
    with replace_file(tmp_path / "a.txt") as file:
        file.write(b"new")
        _link(tmp_path / "a.txt")
    assert not (tmp_path / "a.txt").is_symlink()
    assert (tmp_path / "a.txt").read_text() == "new"
    assert (tmp_path / "victim").read_text() == "mine"

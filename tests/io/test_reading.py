"""What is no ordinary file is refused at once by every reader; costly text is refused or read in a moment."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from apo_bench import InputError, load_scenario, read_observation
from apo_bench.files.bop import read_results
from apo_bench.io.documents import DEEPEST_NESTING, parse_json, parse_toml
from apo_bench.io.ordinary_files import read_bytes, read_text
from apo_bench.observation.noise_file import read_noise
from apo_bench.parts import load_part
from apo_bench.sweeps.sweep_file import read_sweep

READERS: dict[str, Callable[[Path], object]] = {
    "any": lambda path: read_text(path, "file"),
    "part": load_part,
    "scenario": load_scenario,
    "sweep": read_sweep,
    "noise": read_noise,
    "observation.json": lambda path: read_observation(path, "stick_in_tower"),
    "observation.csv": lambda path: read_observation(path, "stick_in_tower"),
    "results": read_results,
}


def special(tmp_path: Path, suffix: str) -> dict[str, Path]:
    """Things of every kind that are no ordinary files, and the words that name them."""
    fifo, folder, unix = (tmp_path / f"{name}{suffix}" for name in ("fifo", "folder", "socket"))
    os.mkfifo(fifo)
    folder.mkdir()
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(unix))
    loop = tmp_path / f"loop{suffix}"
    loop.symlink_to(loop)
    link = tmp_path / f"link{suffix}"
    link.symlink_to("/dev/zero")
    return {
        "a pipe": fifo,
        "a folder": folder,
        "a socket": unix,
        "a device": link,
        "cannot be read": loop,
        "not a path": Path(f"zero\0byte{suffix}"),
    }


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no FIFOs")
@pytest.mark.parametrize("reader", READERS)
def test_what_is_no_ordinary_file_is_refused_at_once(reader: str, tmp_path: Path) -> None:
    suffix = {"part": ".xml", "observation.json": ".json", "observation.csv": ".csv"}.get(reader, ".toml")
    for words, path in special(tmp_path, suffix).items():
        with pytest.raises(InputError, match=words) as refused:
            READERS[reader](path)
        assert "\n" not in str(refused.value)


def test_only_so_much_is_read(tmp_path: Path) -> None:
    """Also of a file that has no end in sight."""
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(InputError, match=r"larger than 0\.5 MB; give a sweep file"):
        read_bytes(path, "sweep file", 500_000)
    path.write_bytes(b"\xef\xbb\xbfone\r\n")
    assert read_text(path, "file") == "one\r\n"


DEEP = "at most 32 names|nested too deep|more than 32 levels"
COSTLY = {
    "names with dots": ("a." * 50_000 + "a = 1", DEEP),
    "quoted names with dots": ('"a" . ' * 50_000 + "a = 1", DEEP),
    "a deep table": ("[" + "a." * 50_000 + "a]", DEEP),
    "deep lists": ("a = " + "[" * 5_000, DEEP),
    "deep tables": ("a = " + "{a = " * 5_000, DEEP),
    "a huge hexadecimal": ("schema = 0x" + "f" * 900_000, "schema: whole numbers go to 1e308"),
    "a huge number": ("schema = " + "9" * 5_000, "a huge number"),
    "a large number": ("schema = [1, " + "9" * 4_000 + "]", "schema: whole numbers go to 1e308"),
    "a zero byte": ("a = 1\0", "this is not TOML"),
}


@pytest.mark.parametrize("case", COSTLY)
def test_costly_toml_is_refused(case: str) -> None:
    text, words = COSTLY[case]
    with pytest.raises(InputError, match=words) as refused:
        parse_toml(text.encode(), "costly.toml")
    assert len(str(refused.value)) < 300


def test_long_words_and_texts_are_no_long_keys() -> None:
    text = f'a = "{"." * 100_000}"\nb = "{"b." * 20}"\n{"c" * 100_000} = 1\n' + "\n".join(
        f"d{i} = 0.5" for i in range(99)
    )
    assert len(parse_toml(text.encode(), "long.toml").value) == 102


def test_names_with_dots_as_deep_as_allowed_are_read() -> None:
    assert parse_toml((".".join("a" * (DEEPEST_NESTING - 1)) + " = 1").encode(), "deep.toml").value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{" + ",".join(f'"{i}": 1' for i in range(60_000)) + ', "59999": 1}', "'59999' stands twice"),
        ("[" * 40 + "]" * 40, "more than 32 levels"),
        ('{"a":' * 900 + "1" + "}" * 900, "more than 32 levels"),
        ('{"schema": ' + "9" * 4_000 + "}", "schema: whole numbers go to"),
        ('{"' + "k" * 900_000 + '": 1}', "unknown key 'k"),
    ],
)
def test_costly_json_is_refused(text: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as refused:
        parse_json(text, "costly.json").fields(("schema",))
    assert len(str(refused.value)) < 300


@pytest.mark.skipif(sys.platform != "linux", reason="the devices have these names on Linux")
def test_the_command_line_does_not_wait_for_its_input() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "apo_bench.cli.app", "graph", "stick_in_tower", "--observation", "/dev/stdin"],
        stdin=subprocess.PIPE,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert "/dev/stdin: a pipe was given" in done.stderr

"""Standard streams that are closed, full or not read, and a current folder that is gone: one sentence, exit code 1."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from apo_bench.cli.app import main

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="/dev/full is a device of Linux")
RUN = f"{sys.executable} -m apo_bench.cli.app"
FULL = "No space left on device"
CLOSED = "standard output is closed"
CASES = {
    "a full device, a table": (f"{RUN} scenarios > /dev/full", FULL, 1),
    "a full device, one object": (f"{RUN} graph stick_in_tower --json > /dev/full", FULL, 1),
    "closed": (f"{RUN} scenarios >&-", CLOSED, 1),
    "all closed": (f"{RUN} scenarios <&- >&- 2>&-", "", 1),
    "an error that cannot be told": (f"{RUN} graph nothing 2> /dev/full", "", 2),
    "standard error and input closed": (f"{RUN} --version 2>&- <&-", "", 0),
    "no current folder": (f"mkdir gone; cd gone; rmdir ../gone; {RUN} scenarios", "change into one that exists", 1),
}


@pytest.mark.parametrize("case", CASES)
def test_one_sentence_and_exit_code_1(case: str, tmp_path: Path) -> None:
    command, words, code = CASES[case]
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == code, done.stderr
    assert words in done.stderr
    assert done.stderr.count("\n") == (1 if words else 0)
    assert done.stdout.count("\n") == (code == 0)


@pytest.mark.parametrize("both", ["", "2>&1"])
@pytest.mark.parametrize(
    ("words", "code"),
    [("graph stick_in_tower", 0), ("explain stick_in_tower --out drawn.png", 0), ("graph nothing", 2)],
)
def test_a_closed_pipe_is_no_error(words: str, code: int, both: str, tmp_path: Path) -> None:
    command = f"(sleep 0.1; {RUN} {words} {both}; echo $? > code) | true"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (tmp_path / "code").read_text() == f"{code}\n"
    assert done.stderr.count("\n") == (code != 0 and not both)
    assert "drawn.png" not in words or (tmp_path / "drawn.png").stat().st_size > 1000


def test_results_are_written_where_nothing_can_be_printed(tmp_path: Path) -> None:
    command = f"{RUN} explain stick_in_tower --out drawn.png > /dev/full"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert f"standard output could not be written ({FULL}); what was not printed is lost" in done.stderr
    assert (tmp_path / "drawn.png").stat().st_size > 1000


def test_letters_that_the_terminal_does_not_have(tmp_path: Path) -> None:
    command = f"PYTHONIOENCODING=ascii {RUN} scenarios $'\\xff'"
    done = subprocess.run(["bash", "-c", command], capture_output=True, check=False, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count(b"\n") == 1


def test_what_is_too_long_to_be_read_is_said_without_its_middle(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenario", "show", "x" * 100_000 + ".toml"]) == 2
    said = capsys.readouterr().err
    assert len(said) < 2000
    assert said.startswith("apo-bench: xxx")
    assert said.endswith("check the path.\n")

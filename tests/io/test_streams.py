"""Standard output that is closed, full or not read, and a current folder that is gone: one sentence, exit code 1."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="/dev/full is a device of Linux")
RUN = f"{sys.executable} -m apo_bench.cli.app"
CASES = {
    "a full device": (f"{RUN} scenario list > /dev/full", "No space left on device"),
    "closed": (f"{RUN} scenario list >&-", "standard output is closed"),
    "no current folder": (f"mkdir gone; cd gone; rmdir ../gone; {RUN} scenario list", "change into one that exists"),
}


@pytest.mark.parametrize("case", CASES)
def test_one_sentence_and_exit_code_1(case: str, tmp_path: Path) -> None:
    command, words = CASES[case]
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_closed_pipe_is_no_error(tmp_path: Path) -> None:
    command = f"(sleep 0.1; {RUN} inspect graph stick_in_tower; echo $? > code) | true"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (tmp_path / "code").read_text() == "0\n"
    assert done.stderr == ""

"""Commands run no file of the current folder that the user did not name."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(sys.executable).with_name("apo-bench")
TRIED = ("OCP", "build123d", "cffi", "glfw", "gymnasium", "jax", "mujoco", "numpy", "pandas", "pyarrow", "ray")
TRIED += ("scipy", "sitecustomize", "sksparse", "viser", "yaml")
"""Packages that dependencies try to import, installed or not."""
SHORT = (
    *("--trials", "1", "--noise-level", "1", "--human-error-scale", "0", "--fidelity", "near-contact"),
    *("--method", "uncorrected,mine:correct", "--workers", "1"),
)
COMMANDS = """
inspect graph block_on_block --out graph.png
inspect poses block_on_block --noise-level 1 --out poses.png
inspect dof block_on_block
noise show isotropic
detect-contacts block_on_block
inspect plan block_on_block
inspect scene block_on_block --out scene.xml
scenario show block_on_block
arm list
part import a.step --out parts
inspect depth block_on_block
view block_on_block
report run --max-pictures 1
compare run run
doctor
"""


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files that are called like packages and like modules of Python, and one that a user names."""
    folder = tmp_path_factory.mktemp("downloaded")
    spoil = "import os\nopen(os.environ['OWNED'], 'a').write(__name__ + ' ')\nraise ImportError(__name__)\n"
    for name in {*TRIED, *sys.stdlib_module_names}:
        (folder / f"{name}.py").write_text(spoil)
    (folder / "mine.py").write_text(
        "def correct(seen):\n    import apo_bench\n    return apo_bench.correct(seen, 'contact')\n"
    )
    return folder


def started(hostile: Path, *command: str) -> tuple[subprocess.CompletedProcess[str], str]:
    """What came of a command in that folder, and which of its files ran."""
    owned = hostile / "owned.txt"
    owned.write_text("")
    done = subprocess.run(
        command, cwd=hostile, env=os.environ | {"OWNED": str(owned)}, capture_output=True, text=True, timeout=300
    )
    return done, owned.read_text()


@pytest.fixture(scope="module")
def run(hostile: Path) -> Path:
    """A sweep of another process with a method of that folder."""
    done, owned = started(hostile, str(PROGRAM), "sweep", "block_on_block", *SHORT, "--out", "run")
    assert (done.returncode, owned) == (0, "")
    return hostile / "run"


def test_a_module_that_is_named_is_found(run: Path) -> None:
    records = [json.loads(line) for line in (run / "trials.jsonl").read_text().splitlines()]
    assert {record["method"]: record["failure_code"] for record in records}["mine:correct"] != "raised"
    assert len(records) == 2


def test_no_command_runs_files_of_the_current_folder(hostile: Path, run: Path) -> None:
    """All in one process, which starts as the program does."""
    commands = [line.split() for line in COMMANDS.strip().splitlines()]
    said = f"from apo_bench.cli.app import main; print([main(each) for each in {commands!r}])"
    done, owned = started(hostile, sys.executable, "-P", "-c", said)
    assert owned == ""
    assert "Traceback" not in done.stderr
    codes = json.loads(done.stdout.splitlines()[-1])
    assert {tuple(each)[:2] for each, code in zip(commands, codes, strict=True) if code} == {
        ("part", "import"),
        ("view", "block_on_block"),
    }

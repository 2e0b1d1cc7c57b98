"""Commands that are started in a folder of somebody else's run nothing that lies there and was not asked for."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from apo_bench.names import admit, folder_of_own_modules, own_modules_in, resolve

PROGRAM = Path(sys.executable).with_name("apo-bench")
TRIED = (
    *("OCP", "OpenGL_accelerate", "bottleneck", "build123d", "cadquery", "cffi", "clarabel", "coverage", "cvxopt"),
    *("cython", "daqp", "ecos", "glfw", "glfw_preview", "gtsam", "gurobipy", "gymnasium", "jax", "mosek", "mujoco"),
    *("numba", "numexpr", "numpy", "olefile", "org", "osqp", "pandas", "pillow_heif", "piqp", "proxsuite", "pytz"),
    *("quadprog", "ray", "rnc2rng", "scikits", "scipy", "scs", "sitecustomize", "sksparse", "uarray", "viser", "yaml"),
)
"""What a trace of all commands found to be tried and not always there, and some that are always there."""
SHORT = (
    *("--trials", "1", "--noise-level", "1", "--human-error-scale", "0", "--fidelity", "near-contact"),
    *("--method", "uncorrected,mine:correct", "--workers", "2"),
)
COMMANDS = """
inspect graph block_on_block --out graph.png
inspect poses block_on_block --noise-level 1 --out show.png
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
report run --pictures 1 --trust-code
compare run run
"""


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files that are called like packages and like modules of Python, and one that somebody asks for."""
    folder = tmp_path_factory.mktemp("downloaded")
    spoil = "import os\nopen(os.environ['OWNED'], 'a').write(__name__ + ' ')\nraise ImportError(__name__)\n"
    for name in {*TRIED, *sys.stdlib_module_names}:
        (folder / f"{name}.py").write_text(spoil)
    (folder / "mine.py").write_text(
        "import beside_mine\n"
        "def correct(seen):\n"
        "    import apo_bench, later_beside_mine\n"
        "    return apo_bench.correct(seen, 'contact')\n"
    )
    (folder / "beside_mine.py").write_text("")
    (folder / "later_beside_mine.py").write_text("")
    return folder


def started(hostile: Path, *command: str) -> tuple[subprocess.CompletedProcess[str], str]:
    """What came of a command in that folder, and which of its files were run."""
    owned = hostile / "owned.txt"
    owned.write_text("")
    done = subprocess.run(
        command, cwd=hostile, env=os.environ | {"OWNED": str(owned)}, capture_output=True, text=True, timeout=300
    )
    return done, owned.read_text()


@pytest.fixture(scope="module")
def run(hostile: Path) -> Path:
    """A sweep of two processes, one of whose methods lies in that folder and imports what lies beside it."""
    done, owned = started(hostile, str(PROGRAM), "sweep", "block_on_block", *SHORT, "--out", "run")
    assert (done.returncode, owned) == (0, "")
    return hostile / "run"


def test_a_module_that_is_named_is_found_beside_files_that_are_not_run(run: Path) -> None:
    rows = [json.loads(line) for line in (run / "trials.jsonl").read_text().splitlines()]
    assert {row["method"]: row["failure_code"] for row in rows}["mine:correct"] != "raised"
    assert len(rows) == 2


def test_no_command_runs_what_lies_in_the_current_folder(hostile: Path, run: Path) -> None:
    """All in one process, which is started as the program is."""
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


@pytest.fixture
def forgotten() -> Iterator[None]:
    before = set(sys.modules)
    yield
    for name in {*sys.modules} - before:
        del sys.modules[name]


@pytest.mark.usefixtures("forgotten")
def test_only_what_was_admitted_and_what_that_imports_is_found(tmp_path: Path) -> None:
    (tmp_path / "named_one.py").write_text("def later():\n    import named_beside\n    return named_beside\n")
    (tmp_path / "named_beside.py").write_text("from importlib import import_module\nimport_module('named_third')\n")
    for name in ("named_third", "stranger_one"):
        (tmp_path / f"{name}.py").write_text("")
    (tmp_path / "named_space").mkdir()
    (tmp_path / "named_space" / "inside.py").write_text("thing = 3\n")
    with own_modules_in(str(tmp_path)):
        assert folder_of_own_modules() == str(tmp_path)
        for name in ("named_one", "named_beside", "stranger_one"):
            with pytest.raises(ImportError):
                __import__(name)
        assert resolve("named_one:later", {}, "thing")().__name__ == "named_beside"
        assert "named_third" in sys.modules
        assert resolve("named_space.inside:thing", {}, "thing") == 3
        with pytest.raises(ImportError):
            __import__("stranger_one")
    assert folder_of_own_modules() == ""
    admit("stranger_one")
    with pytest.raises(ImportError):
        __import__("stranger_one")

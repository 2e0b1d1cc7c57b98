"""The pure modules know no simulator, and importing the package does nothing that a person would notice."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import apo_bench

PACKAGE = Path(apo_bench.__file__).parent
IMPURE = (
    *("simulation", "mjcf", "trial", "testing", "envs", "viz", "cli"),
    *("benchmark.evaluation", "benchmark.sweeps", "benchmark.scoring", "benchmark.datasets", "importers.assembly"),
)
"""Packages that import a simulator, directly or through another."""


def pure_modules() -> list[str]:
    """Every module of the package outside the packages that may know the simulator."""
    names = []
    for path in sorted(PACKAGE.rglob("*.py")):
        inside = [part for part in path.relative_to(PACKAGE).with_suffix("").parts if part != "__init__"]
        if not {".".join(inside[:i]) for i in (1, 2)} & {*IMPURE}:
            names.append(".".join(("apo_bench", *inside)))
    return names


def python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=PACKAGE.parent,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_pure_modules_import_without_any_simulator() -> None:
    """The corrector uses contacts and noisy poses and nothing else; here that is an import rule.

    The package itself registers its environment, so Gymnasium is taken away once it has done so.
    """
    done = python(
        "import sys, importlib\n"
        "for name in ('mujoco', 'mink', 'dm_control'): sys.modules[name] = None\n"
        "import apo_bench\n"
        "sys.modules['gymnasium'] = sys.modules['apo_bench.simulation'] = None\n"
        f"for name in {pure_modules()!r}: importlib.import_module(name)\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


HEAVY = (
    *("mujoco", "dm_control", "mink", "glfw", "OpenGL", "matplotlib"),
    *("trimesh", "manifold3d", "scipy.optimize", "msgspec", "pandas"),
)


def test_importing_the_package_is_light_and_silent() -> None:
    done = python(f"import sys, apo_bench; print([name for name in {HEAVY!r} if name in sys.modules])")
    assert (done.returncode, done.stdout, done.stderr) == (0, "[]\n", "")


def test_the_help_of_the_command_line_is_light() -> None:
    """Its options are made from the settings, whose schema is msgspec's; nothing else that is heavy is loaded."""
    heavy = tuple(name for name in HEAVY if name != "msgspec")
    done = python(
        "import contextlib, io, sys\n"
        "from apo_bench.cli.app import main\n"
        "with contextlib.redirect_stdout(io.StringIO()) as said: code = main(['--help'])\n"
        f"print(code, 'sweep' in said.getvalue(), [name for name in {heavy!r} if name in sys.modules])"
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "0 True []\n", "")


def test_dm_control_need_not_be_there() -> None:
    """It has no wheels for Python 3.13: only the adapter to dm_env asks for its modules, when `physics` is used."""
    asked = [path for path in PACKAGE.rglob("*.py") if re.search('dm_control|"dm-control"', path.read_text("utf-8"))]
    assert asked == [PACKAGE / "envs" / "dm_adapter.py"]
    done = python("import sys; sys.modules['dm_control'] = None; import apo_bench.envs.dm_adapter")
    assert (done.returncode, done.stderr) == (0, "")

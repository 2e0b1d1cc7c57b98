"""Check a built package in an empty virtual environment: `python benchmarks/empty_environment.py dist/*.whl`.

pip installs the package with the Python that runs this. In an empty folder the script imports every module, runs a
trial, makes an environment, corrects measured poses, runs a small sweep with its report, and the Python of README.
`--tests` runs the core of the tests there. The script prints the number of installed packages and the large ones.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import venv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
CORE = ("geometry", "assembly", "correction", "judging", "simulation", "trial/test_trial.py")
"""Tests of the packages that hold the method."""
TEST_TOOLS = ("pytest>=8", "hypothesis>=6.100")
LARGE_MB = 50
TIMES = 5  # runs of the import, of which the fastest counts
INSTALLERS = ("pip", "setuptools")  # part of every environment
PIP = ("-m", "pip", "--quiet", "--disable-pip-version-check")
OPTIONAL = ("build123d", "dm_env", "OCP", "pyarrow", "ray", "viser")
"""Packages of the extras; a module that needs one of these may be missing."""
IMPORT = f"""
import importlib, pkgutil, sys, apo_bench
assert apo_bench.__file__.startswith(sys.prefix), apo_bench.__file__
count = 0
for each in pkgutil.walk_packages(apo_bench.__path__, "apo_bench."):
    try:
        importlib.import_module(each.name)
        count += 1
    except ModuleNotFoundError as error:
        if error.name not in {OPTIONAL}:
            raise
print(count)
"""
MAKE = """
import gymnasium, numpy, apo_bench
env = gymnasium.make("APOReplay-v0", scenario="block_on_block", noise_level=0.0, human_error_scale=0.0)
env.reset(seed=0)
print(env.step(numpy.zeros(env.action_space.shape))[1])
"""
SIZES = """
import json
from importlib import metadata
found = {}
for each in metadata.distributions():
    files = (each.locate_file(file) for file in each.files or ())
    found[each.metadata["Name"]] = [each.version, sum(file.stat().st_size for file in files if file.is_file())]
print(json.dumps(found))
"""
TIME = "import time; began = time.process_time(); import apo_bench; print(time.process_time() - began)"
TRIAL = ("run", "stick_in_tower", "--seed", "7", "--fidelity", "near-contact", "--json")
CORRECT = ("correct", "stick_in_tower", "--observation", "seen.csv", "--method", "contact")
SWEEP = (
    *(
        "sweep",
        "block_on_block",
        "--noise-level",
        "0,1",
        "--human-error-scale",
        "0",
        "--method",
        "uncorrected,paper,contact",
    ),
    *("--trials", "2", "--workers", "1", "--fidelity", "near-contact", "--out", "run"),
)


class Installed(NamedTuple):
    """An installed package."""

    version: str
    mb: float


@dataclass(frozen=True)
class EmptyEnvironment:
    """A virtual environment, and an empty folder in which its programs run."""

    folder: Path

    @property
    def here(self) -> Path:
        return self.folder / "empty"

    def run(self, program: str, *arguments: str) -> str:
        """What a program of the environment prints; ends this one if it fails."""
        alone = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        place = self.folder / "env" / ("Scripts" if sys.platform == "win32" else "bin") / program
        done = subprocess.run([place, *arguments], cwd=self.here, env=alone, stdout=subprocess.PIPE, text=True)
        if done.returncode != 0:
            sys.exit(f"{program} {' '.join(arguments)[:200]} ended with {done.returncode}. {done.stdout[-2000:]}")
        return done.stdout

    def packages(self) -> dict[str, Installed]:
        """What is installed, the package itself too: name -> version and size."""
        found = json.loads(self.run("python", "-c", SIZES))
        return {
            name: Installed(version, size / 1e6) for name, (version, size) in found.items() if name not in INSTALLERS
        }


def empty_environment(folder: Path, package: str, bounds: Sequence[str] = ()) -> EmptyEnvironment:
    """Make it and install the package, a file or a folder with extras in brackets; `bounds` are versions, `name==1`."""
    made = EmptyEnvironment(folder)
    made.here.mkdir()
    venv.create(folder / "env", with_pip=True)
    install(made, bounds, package)
    return made


def install(made: EmptyEnvironment, bounds: Sequence[str], *packages: str) -> None:
    """Install more, of versions no others than `bounds`."""
    constraints = made.folder / "bounds.txt"
    constraints.write_text("".join(f"{bound}\n" for bound in bounds), encoding="utf-8")
    made.run("python", *PIP, "install", "--constraint", str(constraints), *packages)


def check(made: EmptyEnvironment) -> str:
    """Use the installed package as a new user does; return what was done, in words."""
    modules = made.run("python", "-c", IMPORT).strip()
    row = json.loads(made.run("apo-bench", *TRIAL))
    if row["success"] is not True:
        sys.exit(f"the trial {' '.join(TRIAL)} has no success: {row['failure_stage']}, {row['failure_code']}")
    reward = float(made.run("python", "-c", MAKE))
    if reward != 1.0:
        sys.exit(f"the environment gave {reward} for a plan without error; 1.0 was expected.")
    shutil.copy(ROOT / "docs" / "seen.csv", made.here)
    made.run("apo-bench", *CORRECT)
    made.run("apo-bench", *SWEEP)
    made.run("apo-bench", "report", "run")
    made.run("python", "-c", "\n".join(readme_programs()))
    return f"{modules} modules, a trial, an environment, a correction, a sweep and its report, and README work"


def readme_programs() -> list[str]:
    """Return the blocks of Python in README, which continue each other."""
    return re.findall(r"^```python\n(.*?)^```$", (ROOT / "README.md").read_text(encoding="utf-8"), re.M | re.S)


def check_by_tests(made: EmptyEnvironment, bounds: Sequence[str], packages: Sequence[str]) -> str:
    """Run tests of these packages on the installed package; return the last line of their output."""
    install(made, bounds, *TEST_TOOLS)
    for name in ("tests", "benchmarks", "docs", "assets", "scenarios", "pyproject.toml"):
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, made.here / name)
    options = ("-q", "-m", "not slow and not extras", "--override-ini", "addopts=--import-mode=importlib")
    output = made.run("python", "-m", "pytest", *options, *(f"tests/{package}" for package in packages))
    return output.strip().splitlines()[-1]


def sizes(made: EmptyEnvironment) -> str:
    """How many packages are installed, how large all are with this one, and how long the import takes."""
    packages = made.packages()
    large = sorted(((name, each.mb) for name, each in packages.items() if each.mb > LARGE_MB), key=lambda one: -one[1])
    seconds = min(float(made.run("python", "-c", TIME)) for _ in range(TIMES))
    whole = sum(each.mb for each in packages.values())
    listed = ", ".join(f"{name} {mb:.0f}" for name, mb in large)
    counted = f"{len(packages) - 1} packages are installed, {whole:.0f} MB; above {LARGE_MB} MB: {listed}"
    return f"{counted}; import apo_bench: {seconds:.2f} s"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("package", help="a wheel, an archive of sources, or a folder")
    parser.add_argument("--tests", action="store_true", help="run the core of the tests there, too")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        made = empty_environment(Path(folder), str(Path(given.package).resolve()))
        counted = sizes(made)
        works = check(made)
        mujoco = made.packages()["mujoco"].version
        print(f"Python {sys.version.split()[0]}, MuJoCo {mujoco}: {works}", flush=True)
        print(counted, flush=True)
        if given.tests:
            print(check_by_tests(made, (), CORE))


if __name__ == "__main__":
    main()

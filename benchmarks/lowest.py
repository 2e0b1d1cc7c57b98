"""Whether the package works with the oldest versions that `pyproject.toml` allows: `python benchmarks/lowest.py`.

In an environment made for it, pip installs this package and of each dependency just the version that the bound names,
of what those need the newest that fits. There every module is imported, one trial is replayed, and a small sweep has
its report. A few minutes, most of them for pip.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
EXTRAS = ("fast", "dm")
"""Of the optional dependencies these are tried too."""
BOUND = re.compile(r"([A-Za-z0-9._-]+)(?:\[[^]]*\])?>=([0-9][0-9.]*)(?:,<[0-9.]+)?(?:; .*)?")
IMPORT = """
import importlib, pkgutil, sys, apo_bench
assert apo_bench.__file__.startswith(sys.prefix), apo_bench.__file__
names = [each.name for each in pkgutil.walk_packages(apo_bench.__path__, "apo_bench.")]
names.remove("apo_bench.cad.step.open_cascade")  # the process that reads STEP, with the extra cad
for name in names:
    importlib.import_module(name)
print(len(names))
"""
TRIAL = ("replay", "stick_in_tower", "--seed", "7", "--fidelity", "contact", "--json")
SWEEP = (
    *("sweep", "block_on_block", "--levels", "0,1", "--careless", "0", "--methods", "none,paper,contact"),
    *("--trials", "2", "--workers", "1", "--fidelity", "contact", "--out", "run"),
)


def main() -> None:
    bounds = lowest(ROOT / "pyproject.toml")
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        venv.create(here / "env", with_pip=True)
        (here / "bounds.txt").write_text("".join(f"{bound}\n" for bound in bounds), encoding="utf-8")
        pip = ("-m", "pip", "--quiet", "--disable-pip-version-check")
        run(here, "python", *pip, "install", "--constraint", "bounds.txt", f"{ROOT}[{','.join(EXTRAS)}]")
        modules = run(here, "python", "-c", IMPORT).strip()
        row = json.loads(run(here, "apo-bench", *TRIAL))
        if row["success"] is not True:
            sys.exit(f"the trial {' '.join(TRIAL)} has no success: {row['failure_stage']}, {row['failure_code']}")
        run(here, "apo-bench", *SWEEP)
        run(here, "apo-bench", "report", "run")
    print(f"{modules} modules, a trial, a sweep and its report work with {', '.join(bounds)}")


def lowest(pyproject: Path) -> list[str]:
    """`name==version` of every dependency, at the version that its bound names.

    Raises:
        ValueError: A dependency has no bound.
    """
    project = tomllib.loads(pyproject.read_text(encoding="utf-8"))["project"]
    stated = [*project["dependencies"], *(each for extra in EXTRAS for each in project["optional-dependencies"][extra])]
    found = [BOUND.fullmatch(each) for each in stated]
    for each, bound in zip(stated, found, strict=True):
        if bound is None:
            raise ValueError(f"'{each}' states no version from which on it works; write it as 'name>=1.2'.")
    return [f"{bound[1]}=={bound[2]}" for bound in found if bound is not None]


def run(here: Path, program: str, *arguments: str) -> str:
    """What a program of the environment prints; ends this one if it fails."""
    alone = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [here / "env" / "bin" / program, *arguments], cwd=here, env=alone, stdout=subprocess.PIPE, text=True
    )
    if done.returncode != 0:
        sys.exit(f"{program} {' '.join(arguments)[:200]} ended with {done.returncode}.")
    return done.stdout


if __name__ == "__main__":
    main()

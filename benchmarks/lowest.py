"""Check the package with the oldest versions that `pyproject.toml` allows: `python benchmarks/lowest.py` (minutes).

In a virtual environment pip installs this package, or a wheel or archive, and of each dependency the version of its
bound. `empty_environment.py` then uses the package as a new user does; `--tests` adds the core of the tests. Newer
versions of Python lack wheels of the old versions, so this runs with Python 3.11.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from benchmarks.empty_environment import CORE, ROOT, check, check_by_tests, empty_environment

EXTRAS = ("dm", "data", "film", "range")
"""Of the optional dependencies these are tried too."""
BOUND = re.compile(r"([A-Za-z0-9._-]+)(?:\[[^]]*\])?>=([0-9][0-9.]*)(?:,<[0-9.]+)?(?:; .*)?")
OLDEST = (3, 11)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("package", nargs="?", default=str(ROOT), help="a wheel, an archive of sources, or a folder")
    parser.add_argument("--tests", action="store_true", help="run the core of the tests there, too")
    given = parser.parse_args()
    if sys.version_info[:2] != OLDEST:
        print(
            f"The oldest versions are tried with Python {OLDEST[0]}.{OLDEST[1]} only: newer ones lack wheels of them."
        )
        return
    bounds = lowest(ROOT / "pyproject.toml")
    with tempfile.TemporaryDirectory() as folder:
        made = empty_environment(Path(folder), f"{Path(given.package).resolve()}[{','.join(EXTRAS)}]", bounds)
        print(f"{check(made)} with {', '.join(bounds)}")
        if given.tests:
            print(check_by_tests(made, bounds, CORE))


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
    return list(dict.fromkeys(f"{bound[1]}=={bound[2]}" for bound in found if bound is not None))


if __name__ == "__main__":
    main()

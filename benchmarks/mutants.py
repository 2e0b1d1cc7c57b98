"""Count the random changes of the code that the tests notice; `mutant_draw.py` draws them with a seed.

    python -m benchmarks.mutants [--mutants 300] [--seed 0] [--root FOLDER] [--only PACKAGE ...] [--write X]

All mutants stand in one copy of the checkout, each behind a switch (`mutant_switch.py`). The tests of all packages
but `extras` run once without any mutant, which shows what each test reaches and how long it takes. With a mutant on,
only the tests that reach it run, quickest first, up to 30 s or the first failure. A mutant that runs while tests are
imported gets its own process. Mutants that no test notices are printed. `--only` takes
mutants and tests of some packages, `--root` another checkout, which stays as it is.
"""

import argparse
import ast
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.mutant_draw import Mutant, changed, drawn, packages_of, placed, starts_of
from benchmarks.mutant_switch import LONGEST_S

ROOT = Path(__file__).parents[1]
CACHE = re.compile(r"^(functools\.)?(cache|lru_cache|cached_property)\b")
"""Decorators that keep what was computed."""


class Ran(NamedTuple):
    """What came of the tests of a package."""

    passed: bool
    by: str
    """The test that failed first; how they ended where none did."""
    seconds: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--root", type=Path, default=ROOT)
    parser.add_argument("--only", nargs="+", metavar="PACKAGE", default=())
    parser.add_argument("--write", type=Path)
    arguments = parser.parse_args()
    chosen = drawn(arguments.root, arguments.mutants, np.random.default_rng(arguments.seed), arguments.only)
    with tempfile.TemporaryDirectory() as work:
        ran = outcomes(arguments.root, chosen, arguments.only or packages_of(arguments.root), Path(work))
    noticed = Counter(mutant.package for mutant, how in zip(chosen, ran, strict=True) if not how.passed)
    for package, count in sorted(Counter(mutant.package for mutant in chosen).items()):
        print(f"{package:14} {noticed[package]} of {count} noticed")
    print(f"all            {noticed.total()} of {len(chosen)} noticed")
    if arguments.write:
        kept = [mutant._asdict() | how._asdict() for mutant, how in zip(chosen, ran, strict=True)]
        arguments.write.write_text(json.dumps(summary(arguments.root, kept), indent=1) + "\n", encoding="utf-8")


def summary(root: Path, kept: Sequence[dict[str, object]]) -> dict[str, object]:
    survivors = [mutant for mutant in kept if mutant["passed"]]
    return {
        **provenance(root),
        "mutants": len(kept),
        "noticed": len(kept) - len(survivors),
        "not_noticed": survivors,
    }


def provenance(root: Path) -> dict[str, str]:
    """The command that runs, and the commit of the checkout that it tries."""
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=root, capture_output=True, text=True, check=False)
    return {
        "command": "python -m benchmarks." + " ".join([Path(sys.argv[0]).stem, *sys.argv[1:]]),
        "commit": head.stdout.strip(),
    }


def copy(root: Path, place: Path) -> None:
    """All files that git knows, and new ones that it does not ignore."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    said = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout
    for name in filter(None, said.split("\0")):
        if (root / name).is_file():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, place / name)


def outcomes(root: Path, mutants: Sequence[Mutant], packages: Sequence[str], work: Path) -> list[Ran]:
    """What the tests of some packages say of each mutant, in a copy that has them all, in `work`."""
    place = work / "copy"
    copy(root, place)
    for path in [*(place / "apo_bench").rglob("*.py"), *(place / "tests").rglob("*.py")]:
        file = path.relative_to(place / "apo_bench").as_posix() if path.is_relative_to(place / "apo_bench") else ""
        numbers = {
            (mutant.begin, mutant.before): (number, mutant.after)
            for number, mutant in enumerate(mutants, start=1)
            if mutant.file == file
        }
        if numbers or b"cache" in path.read_bytes():
            path.write_text(switched(path.read_bytes(), numbers), encoding="utf-8")
    switch = (ROOT / "benchmarks" / "mutant_switch.py").read_bytes()
    (place / "mutant_switch.py").write_bytes(switch)
    known = [(number, mutant.package) for number, mutant in enumerate(mutants, start=1)]
    (place / "mutants.json").write_text(json.dumps(known))
    pytest(place, [f"tests/{package}" for package in packages], {"MUTANT_NOTES": "1"}, None)
    ran = []
    for line in (place / "outcomes.jsonl").read_text().splitlines():
        outcome = json.loads(line)
        mutant = mutants[outcome["number"] - 1]
        if not outcome["tests"]:
            how = Ran(True, "no test reaches it", 0.0)
        elif outcome["early"]:
            how = imported(place, outcome)
        else:
            how = Ran(outcome["passed"], outcome["by"] or f"{len(outcome['tests'])} tests pass", outcome["seconds"])
        if how.passed:
            print(
                f"NOT NOTICED {mutant.file}:{mutant.line}: {mutant.before!r} -> {mutant.after!r} ({how.by})", flush=True
            )
        ran.append(how)
    return ran


def imported(place: Path, outcome: Mapping[str, Any]) -> Ran:
    """The tests of a mutant that is there while the package is imported."""
    (place / "chosen.json").write_text(json.dumps(outcome["tests"]))
    env = {"MUTANT": str(outcome["number"])}
    ran = pytest(place, sorted({test.split("::")[0] for test in outcome["tests"]}), env, LONGEST_S)
    return ran if ran.by else ran._replace(by=f"{len(outcome['tests'])} tests pass")


def pytest(place: Path, paths: Sequence[str], more: Mapping[str, str], longest_s: float | None) -> Ran:
    """Tests in the copy, up to the first that fails; what hypothesis draws is the same every time."""
    options = ["-q", "-x", "-n", "0", "-m", "not extras", "--tb=no", "-rfE", "--hypothesis-seed=0"]
    options += ["-p", "mutant_switch", "-p", "no:cacheprovider", f"--basetemp={place.parent / 'pytest'}"]
    env = os.environ | {"PYTHONPATH": str(place)}
    env |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", **more}
    shutil.rmtree(place / ".hypothesis", ignore_errors=True)
    began = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", "pytest", *options, *paths],
        cwd=place,
        env=env,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )
    try:
        words, _ = process.communicate(timeout=longest_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return Ran(False, f"no end within {longest_s:g} s", float(longest_s or 0))
    if "MUTANT_NOTES" in more:
        print(words if process.returncode else re.search(r"\d+ of \d+ tests pass.*", words)[0], flush=True)
        if process.returncode:
            raise RuntimeError("the tests could not be run as they are")
    by = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", words, re.MULTILINE)
    how = by[1] if by else "" if not process.returncode else "nothing could be imported"
    return Ran(not process.returncode, how, round(time.monotonic() - began, 1))


def switched(source: bytes, numbers: Mapping[tuple[int, str], tuple[int, str]]) -> str:
    """A file that asks at each mutant whether it is on.

    Args:
        numbers: The number of each mutant and what stands there when it is on, by its begin and what stands there now.
    """
    tree = Switch(source, numbers).visit(ast.parse(source))
    first = next(
        (
            at
            for at, node in enumerate(tree.body)
            if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
            and not (isinstance(node, ast.ImportFrom) and node.module == "__future__")
        ),
        len(tree.body),
    )
    tree.body.insert(first, ast.parse("import mutant_switch as _switch").body[0])
    return ast.unparse(ast.fix_missing_locations(tree))


class Switch(ast.NodeTransformer):
    """Puts the questions into a file, and notes beside each cache who uses it."""

    def __init__(self, source: bytes, numbers: Mapping[tuple[int, str], tuple[int, str]]) -> None:
        self.source = source
        self.starts = starts_of(source)
        self.numbers = numbers

    def visit(self, node: ast.AST) -> Any:
        known = None
        if isinstance(node, ast.expr | ast.stmt) and changed(node) is not None:
            known = self.numbers.get(placed(node, self.source, self.starts))
        node = self.generic_visit(node)
        if isinstance(node, ast.FunctionDef):
            caches = [at for at, by in enumerate(node.decorator_list) if CACHE.search(ast.unparse(by))]
            for at in caches[:1]:
                node.decorator_list.insert(at, ast.parse("_switch.shared", mode="eval").body)
        if known is None:
            return node
        number, after = known
        asks = ast.parse(f"_switch.on({number})", mode="eval").body
        if isinstance(node, ast.stmt):
            return ast.If(asks, ast.parse(after).body, [node])
        return ast.IfExp(asks, ast.parse(after, mode="eval").body, node)


if __name__ == "__main__":
    main()

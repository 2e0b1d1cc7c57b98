"""How many random changes of the code the tests notice: each in a copy of its own, drawn with a seed over all rooms.

    python -m benchmarks.mutants [--mutants 300] [--seed 0] [--root FOLDER] [--workers 2] [--only ROOM ...] [--write X]

A mutant is one operator, number, condition or statement of a function or a constant that is another one. The tests of
its room, those of `tests/ROOM` that `make test` runs, are run in a copy that has it, up to the first that fails. What
no test notices is printed with its line: some of it changes nothing that can be seen, the rest lacks a test. With
`--root` another checkout is tried, such as one before tests were taken out. The checkout itself is never changed.
"""

import argparse
import ast
import json
import tempfile
import threading
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.faults import ROOT, Ran, copy, provenance, tested

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}
CONJUNCTIONS: dict[type[ast.boolop], type[ast.boolop]] = {ast.And: ast.Or, ast.Or: ast.And}
LONGEST_S = 300
"""Tests that have not ended by then have noticed: most such mutants never end."""


class Mutant(NamedTuple):
    """One change of one file."""

    file: str
    """Under `apo_bench`; its first folder is the room whose tests are run."""
    line: int
    before: str
    after: str
    begin: int
    """Offset of `before` in the file, in bytes."""

    @property
    def room(self) -> str:
        return self.file.split("/")[0]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutants", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--root", type=Path, default=ROOT)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", nargs="+", metavar="ROOM", default=())
    parser.add_argument("--write", type=Path)
    arguments = parser.parse_args()
    chosen = drawn(arguments.root, arguments.mutants, np.random.default_rng(arguments.seed), arguments.only)
    with tempfile.TemporaryDirectory() as work, ThreadPoolExecutor(arguments.workers) as pool:
        jobs = [pool.submit(run, arguments.root, mutant, Path(work)) for mutant in chosen]
        ran = [job.result() for job in jobs]
    noticed = Counter(mutant.room for mutant, how in zip(chosen, ran, strict=True) if not how.passed)
    for room, count in sorted(Counter(mutant.room for mutant in chosen).items()):
        print(f"{room:14} {noticed[room]} of {count} noticed")
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


def drawn(root: Path, count: int, rng: np.random.Generator, only: Sequence[str] = ()) -> list[Mutant]:
    """Different mutants, each as likely as any other."""
    package = root / "apo_bench"
    rooms = {folder.name for folder in (root / "tests").iterdir() if folder.is_dir()}
    files = [path for path in sorted(package.rglob("*.py")) if path.relative_to(package).parts[0] in rooms]
    every = [mutant for path in files for mutant in mutants_of(path.read_bytes(), path.relative_to(package).as_posix())]
    every = [mutant for mutant in every if not only or mutant.room in only]
    numbers = rng.choice(len(every), min(count, len(every)), replace=False)
    return [every[int(number)] for number in numbers]


def mutants_of(source: bytes, file: str) -> Iterator[Mutant]:
    """All mutants of a file that differ from it."""
    starts = [0]
    for text in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(text))
    tree = ast.parse(source)
    left_out = {id(inner) for node in ast.walk(tree) for part in not_code(node) for inner in ast.walk(part)}
    for node in ast.walk(tree):
        if id(node) in left_out or (after := changed(node)) is None:
            continue
        assert isinstance(node, ast.expr | ast.stmt)
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0)
        yield Mutant(file, node.lineno, source[begin:end].decode(), after, begin)


def not_code(node: ast.AST) -> Iterator[ast.AST]:
    """What of a node says nothing about what happens: annotations, words of messages, what a room exports."""
    for name in ("annotation", "returns"):
        if isinstance(part := getattr(node, name, None), ast.AST):
            yield part
    if isinstance(node, ast.JoinedStr):
        yield node
    if isinstance(node, ast.Raise) and node.exc is not None:
        yield node.exc


def changed(node: ast.AST) -> str | None:
    """The source of a node after a change; None where nothing of it is changed."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
        operators = [COMPARISONS[type(node.ops[0])](), *node.ops[1:]]
        return f"({ast.unparse(ast.Compare(node.left, operators, node.comparators))})"
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        return f"({ast.unparse(ast.BinOp(node.left, OPERATORS[type(node.op)](), node.right))})"
    if isinstance(node, ast.BoolOp):
        return f"({ast.unparse(ast.BoolOp(CONJUNCTIONS[type(node.op)](), node.values))})"
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
        return f"({ast.unparse(node.operand)})"
    if isinstance(node, ast.Constant) and isinstance(node.value, bool):
        return str(not node.value)
    if isinstance(node, ast.Constant) and isinstance(node.value, int):
        return str(node.value + 1)
    if isinstance(node, ast.Constant) and isinstance(node.value, float):
        return repr(2.0 * node.value if node.value else 1.0)
    if isinstance(node, ast.AugAssign | ast.Raise | ast.Continue | ast.Break):
        return "pass"
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        return "pass"
    return None


def run(root: Path, mutant: Mutant, work: Path) -> Ran:
    """Run the tests of a room in a copy that has the mutant; the copies of one thread lie at one place."""
    place = work / threading.current_thread().name / "copy"
    copy(root, place)
    path = place / "apo_bench" / mutant.file
    source = path.read_bytes()
    end = mutant.begin + len(mutant.before.encode())
    try:
        path.write_bytes(source[: mutant.begin] + mutant.after.encode() + source[end:])
        ran = tested(place, mutant.room, LONGEST_S)
    except RuntimeError:  # the tests could not even be collected
        ran = Ran(False, "nothing could be imported", 0.0)
    finally:
        path.write_bytes(source)
    if ran.seconds == LONGEST_S:
        ran = ran._replace(passed=False)
    if ran.passed:
        print(f"NOT NOTICED {mutant.file}:{mutant.line}: {mutant.before!r} -> {mutant.after!r}", flush=True)
    return ran


if __name__ == "__main__":
    main()

"""Random changes of the code, drawn with a seed over all packages, each as likely as any other.

A mutant is one operator, number, condition or statement of a function or a constant that is another one.
"""

import ast
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

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


class Mutant(NamedTuple):
    """One change of one file."""

    file: str
    """Under `apo_bench`; its first folder is the package whose tests are run."""
    line: int
    before: str
    after: str
    begin: int
    """Offset of `before` in the file, in bytes."""

    @property
    def package(self) -> str:
        return self.file.split("/")[0]


def drawn(root: Path, count: int, rng: np.random.Generator, only: Sequence[str] = ()) -> list[Mutant]:
    """Different mutants, each as likely as any other."""
    source = root / "apo_bench"
    packages = packages_of(root)
    files = [path for path in sorted(source.rglob("*.py")) if path.relative_to(source).parts[0] in packages]
    every = [mutant for path in files for mutant in mutants_of(path.read_bytes(), path.relative_to(source).as_posix())]
    every = [mutant for mutant in every if not only or mutant.package in only]
    numbers = rng.choice(len(every), min(count, len(every)), replace=False)
    return [every[int(number)] for number in numbers]


def packages_of(root: Path) -> list[str]:
    """Packages that have tests."""
    return sorted(path.name for path in (root / "apo_bench").iterdir() if (root / "tests" / path.name).is_dir())


def mutants_of(source: bytes, file: str) -> Iterator[Mutant]:
    """All mutants of a file that differ from it."""
    starts = starts_of(source)
    tree = ast.parse(source)
    left_out = {id(inner) for node in ast.walk(tree) for part in not_code(node) for inner in ast.walk(part)}
    for node in ast.walk(tree):
        if id(node) in left_out or (after := changed(node)) is None:
            continue
        assert isinstance(node, ast.expr | ast.stmt)
        begin, before = placed(node, source, starts)
        yield Mutant(file, node.lineno, before, after, begin)


def starts_of(source: bytes) -> list[int]:
    """Offsets of the lines."""
    starts = [0]
    for text in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(text))
    return starts


def placed(node: ast.expr | ast.stmt, source: bytes, starts: Sequence[int]) -> tuple[int, str]:
    """Where a node begins, in bytes, and what stands there."""
    begin = starts[node.lineno - 1] + node.col_offset
    end = starts[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0)
    return begin, source[begin:end].decode()


def not_code(node: ast.AST) -> Iterator[ast.AST]:
    """What of a node says nothing about what happens: annotations, words of messages, what a package exports."""
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

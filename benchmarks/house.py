"""The plan of the package in numbers, of the working tree and of commits: `python benchmarks/house.py [COMMIT ...]`.

Prints a table. A room is a folder or a loose file directly in `apo_bench`; an arrow leads from a
room to another one from which it imports anything; floors are the rooms on the longest chain of arrows. A name is
public if it is defined at the top of a module without an underscore; it has several meanings if several modules define
it. What a thing touches are the files of the package that name it: the setting `fidelity`, the noise model
`heavy-tailed`, the baseline `snap`, the command `power`.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import statistics
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = "apo_bench"
TOUCHED = {
    "files that name the setting `fidelity`": r"\bfidelity\b",
    "files that name the noise model `heavy-tailed`": r"heavy[-_]tailed|HeavyTailed",
    "files that name the baseline `snap`": r"\"snap\"|\bsnap\.py\b|baselines\.snap|import snap\b|def snap\b",
    "files that name the command `power`": r"cli_power|cli import power|\"power\"|def power\b|power_app",
}


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("commit", nargs="*", help="commits to stand before today's column, such as 41db562")
    asked.add_argument("--tree", type=Path, help="print the numbers of this folder as JSON, and nothing else")
    given = asked.parse_args()
    if given.tree:
        print(json.dumps(numbers(given.tree)))
        return
    columns = {commit: of_commit(commit) for commit in given.commit} | {"today": of_tree(ROOT)}
    print("| | " + " | ".join(columns) + " |")
    print("|---|" + "---|" * len(columns))
    for name in columns["today"]:
        print(f"| {name} | " + " | ".join(f"{column[name]:,}" for column in columns.values()) + " |")


def of_commit(commit: str) -> Mapping[str, int]:
    with tempfile.TemporaryDirectory() as folder:
        packed = subprocess.run(["git", "archive", commit, PACKAGE], cwd=ROOT, check=True, capture_output=True).stdout
        subprocess.run(["tar", "-x", "-C", folder], input=packed, check=True)
        return of_tree(Path(folder))


def of_tree(tree: Path) -> Mapping[str, int]:
    """The numbers, by a process of its own: a package is imported once in a process."""
    command = [sys.executable, __file__, "--tree", str(tree)]
    found: Mapping[str, int] = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    return found


def numbers(tree: Path) -> Mapping[str, int]:
    texts = {path: path.read_text(encoding="utf-8") for path in sorted((tree / PACKAGE).rglob("*.py"))}
    lines = [text.count("\n") for text in texts.values()]
    inside = [len(list(folder.glob("*.py"))) for folder in {path.parent for path in texts}]
    defined = Counter(name for path, text in texts.items() for name in set(public(text, path)))
    arrows = arrows_of(tree)
    return {
        "rooms": len({path.relative_to(tree / PACKAGE).parts[0] for path in texts} - {"__init__.py"}),
        "loose files at the top": len(list((tree / PACKAGE).glob("*.py"))),
        "arrows between rooms": sum(map(len, arrows.values())),
        "rooms in cycles": len(in_cycles(arrows)),
        "floors": floors(arrows),
        "files": len(texts),
        "files in the largest folder": max(inside),
        "lines": sum(lines),
        "lines of the longest file": max(lines),
        "lines of a file, median": round(statistics.median(lines)),
        "public names": len(defined),
        "public names with several meanings": sum(count > 1 for count in defined.values()),
        **{name: named(word, texts) for name, word in TOUCHED.items()},
    }


def named(word: str, texts: Mapping[Path, str]) -> int:
    return sum(re.search(word, text) is not None for text in texts.values())


def public(text: str, path: Path) -> Iterator[str]:
    """What a module defines at its top, without what it imports."""
    for node in ast.parse(text, str(path)).body:
        names: list[ast.expr] = []
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
            names = [ast.Name(node.name)]
        elif isinstance(node, ast.Assign):
            names = [each for target in node.targets for each in getattr(target, "elts", [target])]
        elif isinstance(node, ast.AnnAssign):
            names = [node.target]
        yield from (n.id for n in names if isinstance(n, ast.Name) and not n.id.startswith("_"))


def arrows_of(tree: Path) -> Mapping[str, set[str]]:
    """Room -> rooms that it imports from, imports inside functions too."""
    sys.path.insert(0, str(tree))
    import grimp

    graph = grimp.build_graph(PACKAGE, cache_dir=None)
    arrows: dict[str, set[str]] = {room.split(".")[1]: set() for room in graph.find_children(PACKAGE)}
    for module in graph.modules:
        for imported in graph.find_modules_directly_imported_by(module):
            a = (*module.split("."), "")[1]
            b = (*imported.split("."), "")[1]
            if a and b and a != b:
                arrows[a].add(b)
    return arrows


def reached(arrows: Mapping[str, set[str]], room: str) -> set[str]:
    found: set[str] = set()
    waiting = [*arrows[room]]
    while waiting:
        if (next_one := waiting.pop()) not in found:
            found.add(next_one)
            waiting += arrows[next_one]
    return found


def in_cycles(arrows: Mapping[str, set[str]]) -> set[str]:
    return {room for room in arrows if room in reached(arrows, room)}


def floors(arrows: Mapping[str, set[str]]) -> int:
    """Rooms on the longest chain; rooms of one cycle stand on one floor."""
    below = {room: reached(arrows, room) for room in arrows}
    height: dict[str, int] = {}
    for room in sorted(arrows, key=lambda each: len(below[each] - {each})):
        lower = [other for other in below[room] if room not in below[other]]
        height[room] = 1 + max((height[other] for other in lower), default=0)
    return max(height.values())


if __name__ == "__main__":
    main()

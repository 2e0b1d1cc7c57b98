"""What becomes of assemblies that others drew: `python benchmarks/foreign.py FOLDER [--out OUT] [--seeds 5]`.

Imports every pair `NAME_plug` and `NAME_socket` (STL, OBJ or 3MF, or STEP where that is installed, in one frame) and
every other CAD file of the folder as an assembly, writes scenarios, checks them, runs `oracle`, `none` and `contact`
at 1 mm and 1 degree, and prints a table; every refusal with its sentence. It ships no foreign file.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from apo_bench.assembly import contact_kind
from apo_bench.drafting.checking import check_file
from apo_bench.drafting.draft import draft
from apo_bench.drafting.posed import PosedPart, import_assembly, on_the_table, read_posed
from apo_bench.drafting.writing import scenario_text
from apo_bench.errors import InputError
from apo_bench.scenario.file import load_scenario
from benchmarks.generated import rate

_ENDINGS = (".stl", ".obj", ".3mf", ".step", ".stp")
_PAIR = re.compile(r"(.+)_(plug|socket)", re.IGNORECASE)
_METHODS = ("none", "contact")


class Foreign(NamedTuple):
    """One assembly in a folder."""

    name: str
    files: tuple[Path, ...]


class Became(NamedTuple):
    """What became of it: cells of the table, and sentences of what was refused or found wrong."""

    cells: tuple[str, ...]
    said: tuple[str, ...]


def assemblies(folder: Path) -> Iterator[Foreign]:
    """Pairs, and files on their own, in the order of their names."""
    files = sorted(path for path in folder.rglob("*") if path.suffix.lower() in _ENDINGS)
    pairs: dict[str, dict[str, Path]] = {}
    for path in files:
        if found := _PAIR.fullmatch(path.stem):
            pairs.setdefault(str(path.with_name(found[1])), {})[found[2].lower()] = path
    paired = {path for pair in pairs.values() if len(pair) == 2 for path in pair.values()}
    for pair in pairs.values():
        if len(pair) == 2:
            yield Foreign(pair["plug"].stem[: -len("_plug")], (pair["socket"], pair["plug"]))
    yield from (Foreign(path.stem, (path,)) for path in files if path not in paired)


def posed(each: Foreign, folder: Path, unit: str | None) -> tuple[PosedPart, ...]:
    """Its parts, imported, where the files have them."""
    found: list[PosedPart] = []
    for path in each.files:
        poses, _ = import_assembly(path, folder / path.stem, unit, fewest=3 - len(each.files))
        found += read_posed(poses, fewest=3 - len(each.files))
    return tuple(found)


def tried(each: Foreign, folder: Path, unit: str | None, up: str, seeds: int, fidelity: str) -> Became:
    """Import, write, check and run one assembly; where it ends, the other cells stay empty."""
    cells = list[str]()
    try:
        parts = posed(each, folder, unit)
        cells.append(f"{len(parts)} parts")
        path = folder / f"{re.sub(r'[^A-Za-z0-9_]', '_', each.name)}.toml"
        made = draft(on_the_table(parts, up))
        path.write_text(scenario_text(made, each.name, each.files[0].name, folder), encoding="utf-8")
        scenario = load_scenario(path)
    except (InputError, RuntimeError) as error:
        return Became((*cells, *("-",) * (6 - len(cells))), (str(error),))
    kinds = Counter(
        str(contact_kind(*map(scenario.assembly.face_of, contact)))
        for operation in scenario.assembly.operations
        for contact in operation.contacts
    )
    cells.append(", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items())))
    found = tuple(check_file(path, 0, fidelity))
    wrong = tuple(finding.sentence for finding in found if not finding.ok)
    cells.append("no" if wrong else "yes")
    if any(finding.what in ("file", "gripper") and not finding.ok for finding in found):
        return Became((*cells, "-", "-", "-"), (*made.notes, *wrong))
    for method in ("oracle", *_METHODS):
        right, counted = rate(path, method, seeds, fidelity)
        cells.append(f"{right} of {counted}")
    return Became(tuple(cells), (*made.notes, *wrong))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, default=Path("foreign"), help="for part files and scenarios")
    parser.add_argument("--unit", help="of files that state none")
    parser.add_argument("--up", default="z", help="the axis of the files that looks up")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--fidelity", default="full")
    asked = parser.parse_args()
    print("| assembly | imported | contacts | checked | oracle | none | contact |\n|" + "---|" * 7, flush=True)
    said = list[str]()
    for each in assemblies(asked.folder):
        folder = asked.out / each.name
        folder.mkdir(parents=True, exist_ok=True)
        became = tried(each, folder, asked.unit, asked.up, asked.seeds, asked.fidelity)
        print("| " + " | ".join((each.name, *became.cells)) + " |", flush=True)
        said += [f"- {each.name}: {sentence}" for sentence in became.said]
    print("\n" + "\n".join(said))


if __name__ == "__main__":
    main()

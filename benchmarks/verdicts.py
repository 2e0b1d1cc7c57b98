"""Old verdicts against new ones: `python benchmarks/verdicts.py runs/headline_contact [--trials N] [--pictures N]`.

Reads the sweep of a headline, finished or not, and the verdicts of the headline before `success` came to mean the
finished assembly (results/headline/before.jsonl.xz: of each row its key, verdict, stage and code). Writes
docs/results/verdicts.md and results/headline/verdicts.csv: per cell the old success, the new one, and what is
as demonstrated; seed by seed where the last two rules part, and where a success was lost because a corner of a part lay
more than 1 mm from where it was put. `--pictures N` draws how the first N of those ended, `--draw
stick_in_tower,paper,4,1,17` the trial of that scenario, method, level, carelessness and seed.
"""

from __future__ import annotations

import argparse
import csv
import json
import lzma
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from apo_bench.records.run.replay_command import replay_command
from apo_bench.records.run.run_folder import read_rows
from apo_bench.show.failure_pictures import failure_pictures
from apo_bench.statistics.rates import rank

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "benchmarks" / "results" / "headline"
BEFORE, TABLE = KEPT / "before.jsonl.xz", KEPT / "verdicts.csv"
PAGE = ROOT / "docs" / "results" / "verdicts.md"
KEY = ("scenario", "method", "level", "careless", "seed")
CELL = KEY[:-1]
COLUMNS = (*CELL, "trials", "before", "as_demonstrated", "success", "differ", "lost_at_corners")

Row = Mapping[str, Any]


class Counts(NamedTuple):
    """Of the trials of a cell, how many were right; None where there was no such cell before."""

    trials: int
    before: int | None
    as_demonstrated: int
    success: int
    differ: int
    """Trials whose old success is not what `as_demonstrated` says."""
    lost_at_corners: int


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("folder", type=Path, help="a sweep of benchmarks/headline.toml, or a part of one")
    asked.add_argument("--trials", type=int, help="how many seeds to take")
    asked.add_argument("--pictures", type=int, default=0, help="how many successes lost at corners to draw")
    asked.add_argument("--draw", action="append", default=[], help="SCENARIO,METHOD,LEVEL,CARELESS,SEED")
    asked.add_argument("--page", type=Path, default=PAGE)
    asked.add_argument("--table", type=Path, default=TABLE)
    given = asked.parse_args()
    rows = sorted(read_rows(given.folder), key=place)
    if given.trials is not None:
        rows = [row for row in rows if row["seed"] < rows[0]["seed"] + given.trials]
    before = old_verdicts()
    chosen = [row for row in rows if spelled(row) in given.draw]
    missing = sorted(set(given.draw) - {spelled(row) for row in chosen})
    if missing:
        asked.error(
            f"there is no trial {' nor '.join(missing)} in {given.folder}; such as {spelled(rows[0])} is needed"
        )
    drawn = draw([*lost(rows)[: given.pictures], *chosen], given.folder, given.page.parent / "pictures")
    given.page.write_text("\n".join([*page(rows, before), *drawn]) + "\n", encoding="utf-8")
    with given.table.open("w", newline="", encoding="utf-8") as file:
        told = csv.writer(file)
        told.writerow(COLUMNS)
        told.writerows((*cell, *counts) for cell, counts in cells(rows, before).items())
    print(f"Wrote {given.page} and {given.table}")


def old_verdicts() -> dict[tuple[Any, ...], Row]:
    lines = lzma.decompress(BEFORE.read_bytes()).splitlines()
    return {key(row): row for row in map(json.loads, lines)}


def key(row: Row) -> tuple[Any, ...]:
    return tuple(row[name] for name in KEY)


def spelled(row: Row) -> str:
    """`stick_in_tower,paper,4,1,17`, for names of files too."""
    return f"{row['scenario']},{row['method']},{row['level']:g},{row['careless']:g},{row['seed']}"


def place(row: Row) -> tuple[Any, ...]:
    return row["seed"], row["scenario"], row["careless"], row["level"], rank(row["method"]), row["method"]


def at_corners(row: Row) -> bool:
    """Whether nothing but the displacement of corners is wrong, and that of centres is not known to be."""
    found = [fault for fault, there in (row["conditions"] or {}).items() if there]
    return not row["success"] and found == ["pushed"] and row["as_demonstrated_code"] != "pushed"


def lost(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if at_corners(row)]


def differing(rows: Iterable[Row], before: Mapping[tuple[Any, ...], Row]) -> list[tuple[Row, Row]]:
    """Trials whose old success is not what `as_demonstrated` says, with their old rows."""
    both = [(row, before[key(row)]) for row in rows if key(row) in before]
    return [(new, old) for new, old in both if new["as_demonstrated"] != old["success"]]


def why(new: Row, old: Row) -> str:
    """Which of the rules decides, else that the replay ended otherwise."""
    if at_corners(new) and new["as_demonstrated_code"] == "ok":
        return f"corners: {new['pushed_mm']:.2f} mm"
    if not new["success"] and new["as_demonstrated_code"] == "ok":
        return f"only the finished assembly is wrong: {new['failure_code']}"
    ended = [
        f"{row['failure_stage']}, {row['failure_code']}" if not right else "right"
        for row, right in ((old, old["success"]), (new, new["as_demonstrated"]))
    ]
    return f"the replay ended otherwise: {ended[0]} before, {ended[1]} now ({new['as_demonstrated_code']})"


def cells(rows: Iterable[Row], before: Mapping[tuple[Any, ...], Row]) -> dict[tuple[Any, ...], Counts]:
    """The counts of every cell, of trials whose demonstration was right."""
    found: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        if row["success"] is not None:
            found.setdefault(tuple(row[name] for name in CELL), []).append(row)
    return {cell: counted(found[cell], before) for cell in sorted(found, key=by_cell)}


def by_cell(cell: tuple[Any, ...]) -> tuple[Any, ...]:
    scenario, method, level, careless = cell
    return scenario, careless, level, rank(method), method


def counted(rows: Sequence[Row], before: Mapping[tuple[Any, ...], Row]) -> Counts:
    known = [before[key(row)] for row in rows if key(row) in before]
    return Counts(
        trials=len(rows),
        before=sum(bool(row["success"]) for row in known) if len(known) == len(rows) else None,
        as_demonstrated=sum(row["as_demonstrated"] for row in rows),
        success=sum(row["success"] for row in rows),
        differ=len(differing(rows, before)),
        lost_at_corners=len(lost(rows)),
    )


def page(rows: Sequence[Row], before: Mapping[tuple[Any, ...], Row]) -> list[str]:
    every = cells(rows, before)
    apart = {cell: n for cell, n in every.items() if len({n.before, n.as_demonstrated, n.success}) > 1}
    known = {cell: n for cell, n in apart.items() if n.before is not None}
    paired = sum(key(row) in before for row in rows)
    differ, gone, seeds = differing(rows, before), lost(rows), [row["seed"] for row in rows]
    return [
        "<!-- Written by `python benchmarks/verdicts.py`; change that, not this page. -->",
        "",
        "# Old verdicts and new ones",
        "",
        f"Of {len(rows)} trials of the headline, seeds {min(seeds)} to {max(seeds)}; {paired} of them were in the "
        "headline before. *Before* is the success of then, which asked for every contact "
        "also when it was made. *As demonstrated* asks for that and for the finished assembly, *success* for the "
        "finished assembly alone ([the rules](../how/judge.md)). All cells are in "
        "`benchmarks/results/headline/verdicts.csv`.",
        "",
        f"## Cells in which the verdicts differ ({len(known)} of {sum(n.before is not None for n in every.values())})",
        "",
        "| scenario | careless | level | method | trials | before | as demonstrated | success | gained |",
        "|---|---|---|---|---|---|---|---|---|",
        *(
            f"| {scenario} | {careless:g} | {level:g} | `{method}` | {n.trials} | {n.before} | {n.as_demonstrated} "
            f"| {n.success} | {n.success - (n.before or 0):+d} |"
            for (scenario, method, level, careless), n in known.items()
        ),
        "",
        f"## As demonstrated, and the success of before: {len(differ)} of {paired} trials differ",
        "",
        *listed((new, why(new, old)) for new, old in differ),
        "",
        f"## Successes lost at the corners: {len(gone)} of {len(rows)} trials",
        "",
        "Nothing is wrong with the finished assembly but that a corner of a part lies more than 1 mm from where the "
        "part was put.",
        "",
        *listed((row, f"{row['pushed_mm']:.2f} mm; at the centres: {row['as_demonstrated_code']}") for row in gone),
    ]


def listed(found: Iterable[tuple[Row, str]]) -> list[str]:
    lines = [
        f"| {row['scenario']} | {row['careless']:g} | {row['level']:g} | `{row['method']}` | {row['seed']} | {what} |"
        for row, what in found
    ]
    head = ["| scenario | careless | level | method | seed | why |", "|---|---|---|---|---|---|"]
    return [*head, *lines] if lines else ["None."]


def draw(rows: Sequence[Row], folder: Path, pictures: Path) -> list[str]:
    """Pictures of how trials ended, and the command that replays each."""
    made, missed = failure_pictures(rows, folder)
    lines = ["", *missed] if missed else []
    for found in made:
        name = f"verdict_{spelled(found.row).replace(',', '_')}.jpg"
        (pictures / name).write_bytes(found.jpeg)
        lines += ["", f"![{spelled(found.row)}](pictures/{name})", ""]
        lines += [f"`{replay_command(found.row)}`: {found.row['sentence']} ({found.words})."]
    return lines


if __name__ == "__main__":
    main()

"""The page of a comparison, and its tables beside it."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from apo_bench.errors import InputError
from apo_bench.io.csv_file import write_csv
from apo_bench.io.parquet import parquet_beside
from apo_bench.io.writing import check_folders, to_write
from apo_bench.report import compare_text as text
from apo_bench.report.compare import Comparison
from apo_bench.report.page.document import Section, document
from apo_bench.report.page.markup import Html, Table, joined, prose, tag

AGREEMENT = (
    "The same trials in both: how often success is the same, with Wilson's interval, and how often stage "
    "and code of a failure are as well. Trials of one seed share their random numbers, so those "
    "intervals are too narrow where disagreements come in bunches; *same in all* counts the seeds with which every "
    "trial has the same verdict in both, and these are independent. *Right in the first alone* are trials "
    "that the second lost. The difference of success is the second minus the first, with Tango's interval for pairs "
    "(95 %), over trials too. Trials whose demonstration was not right in either are left out here."
)
NUMBERS = "Of trials that have the number in both: in how many it is not exactly the same, and by how much at most."
CELLS = (
    "Rates over all trials of each side; alone and the difference, second minus first, over the trials that they share."
)


class Written(NamedTuple):
    """Where a comparison was written."""

    page: Path
    tables: tuple[Path, ...]


def write_comparison(found: Comparison, folder: Path) -> Written:
    """Write the page and its tables (CSV and Parquet).

    Raises:
        InputError: The folder cannot be written.
    """
    tables = {
        "agreement": text.agreement_table(found),
        "numbers": text.number_table(found),
        "cells": text.cell_table(found),
        "changed": text.changed_table(found),
        "differences": text.difference_table(found),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        check_folders([folder])
        paths = [_write(table, folder / f"{name}.csv") for name, table in tables.items()]
        page = folder / "compare.html"
        with to_write(page, "w") as file:
            file.write(comparison_page(found, tables))
    except OSError as error:
        raise InputError(f"--out {folder} cannot be written ({error.strerror}); choose another place.") from error
    return Written(page, tuple(paths))


def comparison_page(found: Comparison, tables: dict[str, Table]) -> str:
    """The page, as HTML."""
    sides = tag("ol", *(tag("li", tag("code", str(side.folder))) for side in (found.first, found.second)))
    names = [side.folder.resolve().name for side in (found.first, found.second)]
    lead = joined([prose(text.in_words(found), "lead"), sides])
    sections = [
        Section("verdicts", "Verdicts", joined([prose(AGREEMENT), tables["agreement"].html()])),
        Section("changed", "Trials whose verdicts differ", _changed(found, tables["changed"])),
        Section("numbers", "Numbers", joined([prose(NUMBERS), tables["numbers"].html()])),
        Section("rates", "Rates", joined([prose(CELLS), tables["cells"].html()])),
        Section(
            "differences", "What is not the same", tables["differences"].html("Nothing that is said of them differs.")
        ),
    ]
    return document(f"{names[0]} against {names[1]}", lead, sections, ())


def _changed(found: Comparison, table: Table) -> Html:
    count = len(found.changed)
    words = f"{count:,} of {found.shared:,} trials" + (
        f"; the first {text.MOST:,} are listed" if count > text.MOST else ""
    )
    return joined([prose(words + "."), table.html("No verdict differs.")])


def _write(table: Table, path: Path) -> Path:
    write_csv(path, _names(table.head), table.rows)
    parquet_beside(path)
    return path


def _names(head: tuple[str, ...]) -> list[str]:
    """Names of columns that are all different."""
    return [f"{name} {head[:i].count(name) + 1}" if head.count(name) > 1 else name for i, name in enumerate(head)]

"""The page of a comparison, and its tables beside it."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from apo_bench.errors import InputError
from apo_bench.io.writing import check_folders, to_write
from apo_bench.report.comparison import text
from apo_bench.report.comparison.compare import Comparison
from apo_bench.report.page.document import page
from apo_bench.report.tables.table import Table

_SECTIONS = {
    "verdicts": "Verdicts",
    "changed": "Trials whose verdicts differ",
    "numbers": "Numbers",
    "rates": "Rates",
    "differences": "What is not the same",
}
_AGREEMENT = (
    "The same trials in both: how often success is the same, with Wilson's interval, and how often stage "
    "and code of a failure are as well. Trials of one seed share their random numbers, so those "
    "intervals are too narrow where disagreements come in bunches; *same in all* counts the seeds with which every "
    "trial has the same verdict in both, and these are independent. *Right in the first alone* are trials "
    "that the second lost. The difference of success is the second minus the first, with Tango's interval for pairs "
    "(95 %), over trials too. Trials whose demonstration was not right in either are left out here."
)
_NUMBERS = "Of trials that have the number in both: in how many it is not exactly the same, and by how much at most."
_CELLS = (
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
        "cells": text.rate_pair_table(found),
        "changed": text.changed_table(found),
        "differences": text.difference_table(found),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        check_folders([folder])
        paths = [table.write(folder / f"{name}.csv") for name, table in tables.items()]
        for name, table in tables.items():
            table.write(folder / f"{name}.parquet")
        with to_write(folder / "compare.html", "w") as file:
            file.write(_page(found, tables))
    except OSError as error:
        raise InputError(f"--out {folder} cannot be written ({error.strerror}); choose another place.") from error
    return Written(folder / "compare.html", tuple(paths))


def _page(found: Comparison, tables: Mapping[str, Table]) -> str:
    folders = [side.folder for side in (found.first, found.second)]
    count = len(found.changed)
    listed = f"; the first {text.MOST:,} are listed" if count > text.MOST else ""
    return page(
        "compare.html",
        title=f"{folders[0].resolve().name} against {folders[1].resolve().name}",
        sections=_SECTIONS,
        answer=text.in_words(found),
        folders=folders,
        tables=tables,
        words={
            "agreement": _AGREEMENT,
            "changed": f"{count:,} of {found.shared:,} trials{listed}.",
            "numbers": _NUMBERS,
            "cells": _CELLS,
        },
    )

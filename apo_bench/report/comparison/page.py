"""The page of a comparison, and its tables beside it."""

from collections.abc import Mapping
from pathlib import Path

from apo_bench.errors import InputError
from apo_bench.io.ordinary_files import check_folders, to_write
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


def write_comparison(comparison: Comparison, folder: Path) -> Path:
    """Write the page and its tables (CSV and Parquet); returns the page.

    Raises:
        InputError: The folder cannot be written.
    """
    tables = {
        "agreement": text.agreement_table(comparison),
        "numbers": text.number_table(comparison),
        "cells": text.rate_pair_table(comparison),
        "changed": text.changed_table(comparison),
        "differences": text.difference_table(comparison),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        check_folders([folder])
        for name, table in tables.items():
            table.write(folder / f"{name}.csv")
            table.write(folder / f"{name}.parquet")
        with to_write(folder / "compare.html", "w") as file:
            file.write(_page(comparison, tables))
    except OSError as error:
        raise InputError(f"--out {folder} cannot be written ({error.strerror}); choose another place.") from error
    return folder / "compare.html"


def _page(comparison: Comparison, tables: Mapping[str, Table]) -> str:
    folders = [side.folder for side in (comparison.first, comparison.second)]
    count = len(comparison.changed)
    listed = f"; the first {text.MOST_LISTED:,} are listed" if count > text.MOST_LISTED else ""
    return page(
        "compare.html",
        title=f"{folders[0].resolve().name} against {folders[1].resolve().name}",
        sections=_SECTIONS,
        answer=text.in_words(comparison),
        folders=folders,
        tables=tables,
        changed=f"{count:,} of {comparison.shared:,} trials{listed}.",
    )

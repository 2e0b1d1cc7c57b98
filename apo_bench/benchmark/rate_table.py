"""The table that `evaluate` returns: success rates by condition, with exports and plots."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any, final

from apo_bench.errors import missing_package, require
from apo_bench.io import align_columns, format_count
from apo_bench.records import TrialRecord

RUN_FILES = ("run.json", "trials.jsonl", "timing.jsonl")
"""Files of a sweep's folder that `save` copies."""


@final
@dataclass(frozen=True, eq=False)
class RateTable:
    """Success rates of an evaluation, one row for each condition, with 95 % Wilson intervals.

    `print(table)` shows the settings that differ, the rate and its interval.
    """

    records: tuple[TrialRecord, ...]
    """The record of each trial; methods have the labels that the caller gave."""
    folder: Path
    """The folder with the records, as `apo-bench sweep` writes them."""
    methods: tuple[str, ...] = ()
    """Labels of the methods in the order of the caller, which the rows have."""
    _temporary: TemporaryDirectory[str] | None = None  # keeps a temporary folder as long as the table exists

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One dict for each condition: settings, `trials`, `successes`, `rate`, `low_95`, `high_95` (from 0 to 1)."""
        table = self._table()
        named = [column for column in table.columns if column.name]
        return [{column.name: column.of(item) for column in named} for item in table.items]

    def __str__(self) -> str:
        """The table as text with aligned columns, and the error of each method that raised one."""
        table = self._table()
        numbers = [i for i, column in enumerate(table.shown) if not column.words]
        lines = align_columns([[column.head for column in table.shown], *table.lines], numbers)
        return "\n".join((*lines, *self._describe_errors()))

    def to_pandas(self) -> Any:
        """Return the rows as a `pandas.DataFrame`.

        Raises:
            InputError: The package pandas is not installed.
        """
        try:
            import pandas
        except ImportError as error:
            raise missing_package("to_pandas", "pandas") from error
        return pandas.DataFrame(self.rows)

    def to_polars(self) -> Any:
        """Return the rows as a `polars.DataFrame`.

        Raises:
            InputError: The package polars is not installed.
        """
        try:
            import polars
        except ImportError as error:
            raise missing_package("to_polars", "polars") from error
        return polars.DataFrame(self.rows)

    def plot(self, path: str | Path) -> Path:
        """Draw success over the noise level, a curve for each method, and write it as SVG or PNG by the ending.

        Raises:
            InputError: Another ending, or the file cannot be written.
        """
        from apo_bench.benchmark.analysis import list_settings, tally
        from apo_bench.benchmark.report.figures.figures import draw_figures

        target = Path(path)
        require(target.suffix in (".svg", ".png"), f"'{path}' was given; use a file name that ends in .svg or .png.")
        cells = tally(self.records)
        drawn = draw_figures(cells, (), list_settings(cells), (), (), (), ())
        return drawn["success_over_noise_level"].write(target)

    def save(self, folder: str | Path) -> Path:
        """Copy the records and the description of the run to a folder, for `apo-bench report` and `compare`.

        Raises:
            InputError: The folder holds a run already.
        """
        target = Path(folder)
        require(not (target / RUN_FILES[1]).exists(), f"'{folder}' holds a run already; save to another folder.")
        target.mkdir(parents=True, exist_ok=True)
        for name in RUN_FILES:
            if (self.folder / name).exists():
                copyfile(self.folder / name, target / name)
        return target

    def _describe_errors(self) -> Iterable[str]:
        """Yield a sentence for each method that raised an error, or returned what is no correction."""
        raised = [record for record in self.records if record["failure_code"] == "raised"]
        first = {record["method"]: record["sentence"] for record in reversed(raised)}
        counts = Counter(record["method"] for record in raised)
        for method, sentence in first.items():
            yield f"{method} has an error in {format_count(counts[method], 'trial')}, the first: {sentence}"

    def _table(self) -> Any:
        """Return the table of conditions that a report has, too, with methods in the order of the caller."""
        from apo_bench.benchmark.analysis import make_settings_key, tally
        from apo_bench.benchmark.report.tables.conditions import make_condition_table

        ranks = {method: rank for rank, method in enumerate(self.methods)}
        by_method = sorted(tally(self.records), key=lambda cell: ranks.get(cell.method, len(ranks)))
        return make_condition_table(sorted(by_method, key=make_settings_key))

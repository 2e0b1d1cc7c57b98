"""Files, tables, streams and processes; nothing here knows of assemblies."""

from apo_bench.io.csv_tables import Columns, CsvRow, check_separator, read_csv, write_csv
from apo_bench.io.documents import (
    Finite,
    NotNegative,
    Positive,
    Quadruple,
    Table,
    Text,
    Triple,
    check_quaternion,
    convert_typed,
    parse_plain,
    read_plain,
    read_typed,
)
from apo_bench.io.figures import default_looks, save_figure
from apo_bench.io.grouping import grouped
from apo_bench.io.named_files import named_files
from apo_bench.io.parquet import has_parquet, write_columns
from apo_bench.io.processes import SAFE_PATH, environment
from apo_bench.io.result_files import check_target, open_to_append, replace_file, write_file
from apo_bench.io.safe_io import decoded, each_line, opened, read_bytes, read_text
from apo_bench.io.safe_text import CONTROL, UNSHOWN, brief, clean, markdown
from apo_bench.io.streams import redirect_output
from apo_bench.io.text import columns, direction, listed_words, with_article
from apo_bench.io.toml_text import toml_text

__all__ = (
    "CONTROL",
    "SAFE_PATH",
    "UNSHOWN",
    "Columns",
    "CsvRow",
    "Finite",
    "NotNegative",
    "Positive",
    "Quadruple",
    "Table",
    "Text",
    "Triple",
    "brief",
    "check_quaternion",
    "check_separator",
    "check_target",
    "clean",
    "columns",
    "convert_typed",
    "decoded",
    "default_looks",
    "direction",
    "each_line",
    "environment",
    "grouped",
    "has_parquet",
    "listed_words",
    "markdown",
    "named_files",
    "open_to_append",
    "opened",
    "parse_plain",
    "read_bytes",
    "read_csv",
    "read_plain",
    "read_text",
    "read_typed",
    "redirect_output",
    "replace_file",
    "save_figure",
    "toml_text",
    "with_article",
    "write_columns",
    "write_csv",
    "write_file",
)

"""Safe reading and writing of files, tables, streams and processes."""

from apo_bench.io.csv_tables import Columns, CsvRow, read_csv, write_csv
from apo_bench.io.documents import (
    FileTable,
    Finite,
    NotNegative,
    Positive,
    Quadruple,
    Text,
    Triple,
    check_quaternion,
    convert_typed,
    parse_plain,
    read_plain,
    read_typed,
)
from apo_bench.io.figures import save_figure, use_figure_style
from apo_bench.io.grouping import group_by
from apo_bench.io.named_files import list_named_files
from apo_bench.io.parquet import has_parquet, write_columns, write_parts
from apo_bench.io.processes import SAFE_PATH, set_environment
from apo_bench.io.result_files import check_target, open_to_append, replace_file, write_file
from apo_bench.io.safe_io import decode_text, open_file, read_bytes, read_lines, read_text
from apo_bench.io.safe_text import CONTROL, UNSHOWN, clean, escape_markdown, shorten_text
from apo_bench.io.streams import redirect_output
from apo_bench.io.text import add_the, align_columns, format_count, format_direction, join_words
from apo_bench.io.toml_text import format_toml

__all__ = (
    "CONTROL",
    "SAFE_PATH",
    "UNSHOWN",
    "Columns",
    "CsvRow",
    "FileTable",
    "Finite",
    "NotNegative",
    "Positive",
    "Quadruple",
    "Text",
    "Triple",
    "add_the",
    "align_columns",
    "check_quaternion",
    "check_target",
    "clean",
    "convert_typed",
    "decode_text",
    "escape_markdown",
    "format_count",
    "format_direction",
    "format_toml",
    "group_by",
    "has_parquet",
    "join_words",
    "list_named_files",
    "open_file",
    "open_to_append",
    "parse_plain",
    "read_bytes",
    "read_csv",
    "read_lines",
    "read_plain",
    "read_text",
    "read_typed",
    "redirect_output",
    "replace_file",
    "save_figure",
    "set_environment",
    "shorten_text",
    "use_figure_style",
    "write_columns",
    "write_csv",
    "write_file",
    "write_parts",
)

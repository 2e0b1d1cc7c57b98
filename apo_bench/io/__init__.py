"""Files are read and written here, strictly and within limits, and processes started; knows nothing of assemblies."""

from apo_bench.io.documents import JsonNode, parse_json, read_json, read_toml
from apo_bench.io.figures import default_looks, load_matplotlib, save_figure
from apo_bench.io.grouping import grouped
from apo_bench.io.lossless_json import HALF_BUT_OF_FILES, HALF_LETTER, WHOLE_LETTERS, half_letter, is_whole, read_whole
from apo_bench.io.ordinary_files import (
    check_folders,
    check_target,
    decoded,
    each_line,
    is_there,
    opened,
    put_back,
    read_bytes,
    read_text,
    to_write,
    write_whole,
)
from apo_bench.io.plain_text import CONTROL, UNSHOWN, brief, clean
from apo_bench.io.processes import SAFE_PATH, descendants, end_descendants, environment, flush, redirect_output
from apo_bench.io.strict_csv import Columns, CsvRow, check_separator, read_csv, write_columns, write_csv
from apo_bench.io.words import columns, direction, listed_words, with_article

__all__ = (
    "CONTROL",
    "HALF_BUT_OF_FILES",
    "HALF_LETTER",
    "SAFE_PATH",
    "UNSHOWN",
    "WHOLE_LETTERS",
    "Columns",
    "CsvRow",
    "JsonNode",
    "brief",
    "check_folders",
    "check_separator",
    "check_target",
    "clean",
    "columns",
    "decoded",
    "default_looks",
    "descendants",
    "direction",
    "each_line",
    "end_descendants",
    "environment",
    "flush",
    "grouped",
    "half_letter",
    "is_there",
    "is_whole",
    "listed_words",
    "load_matplotlib",
    "opened",
    "parse_json",
    "put_back",
    "read_bytes",
    "read_csv",
    "read_json",
    "read_text",
    "read_toml",
    "read_whole",
    "redirect_output",
    "save_figure",
    "to_write",
    "with_article",
    "write_columns",
    "write_csv",
    "write_whole",
)

"""Result files are written by `apo_bench.io.replace_file`: no other call in the package can write one."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "apo_bench"
EXCEPTIONS = {
    "io/safe_io.py": {"open": 1},  # reads
    "io/streams.py": {"os.open": 1},  # /dev/null
    "io/result_files.py": {"open": 2, "os.replace": 1},  # the function
    "records/secret_seed.py": {"open": 1, "os.open": 1},  # a file that only its owner can read
    "records/run/run_folder.py": {"open": 1, "os.write": 1},  # records are appended; half of a last line is cut off
    "benchmark/scoring/program.py": {"TemporaryFile": 2},  # request and answer of a program; no result
    "benchmark/rate_table.py": {"copyfile": 1},  # a copy of a run, to a folder without one
    "scenario/saving.py": {"copyfile": 1},  # copies of parts, to a new scenario
    "benchmark/sweeps/cluster.py": {"copyfile": 1, "touch": 1},  # a temporary folder
}
"""File -> calls that open or write something else than a result file, and how many."""
WRITES = re.compile(
    r"(?P<os>\bos\.(?:open|fdopen|write|replace|rename|link|symlink|sendfile|mkfifo))\("
    r"|\b(?P<path>open|write_text|write_bytes|savetxt|tofile|to_csv|to_parquet|rename|symlink_to|hardlink_to|mkstemp"
    r"|NamedTemporaryFile|TemporaryFile|copy2|copyfile|copytree)\("
    r"|\.(?P<touch>touch)\(\)"
    r"|\b(?P<file>savefig|savez\w*|imsave|mimsave|ParquetWriter|tostream|h5py\.File)\((?!file\b|out\b|\w+\.enter_context\(replace_file\()"
    r"|\b(?P<table>write_table|dump)\((?!.*, (?:file|out)\b)(?!pa\.table\()"
    r"|\b(?P<image>imwrite)\((?!\"<bytes>\")"
)
"""Calls that open or write a path, but none that write into `file` or `out`, which `replace_file` opens."""


def found_in(text: str) -> dict[str, int]:
    """Name of a call -> how many there are."""
    return dict(Counter(match[match.lastgroup] for match in WRITES.finditer(text) if match.lastgroup))


def test_nothing_else_writes_files() -> None:
    found = {path.relative_to(PACKAGE).as_posix(): path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")}
    assert {name: calls for name, text in found.items() if (calls := found_in(text))} == EXCEPTIONS
    into = [name for name, text in found.items() if re.search(r"\b(savefig|savez|dump|write_table)\(", text)]
    assert [name for name in into if not re.search(r"replace_file|BytesIO|StringIO", found[name])] == []


@pytest.mark.parametrize(
    "breach",
    [
        "open(path, 'w')",
        "os.open(path, os.O_WRONLY)",
        "path.write_text(text)",
        "figure.savefig(path)",
        "h5py.File(path, 'w')",
        "pickle.dump(form, open(path, 'wb'))",
        "tempfile.NamedTemporaryFile()",
    ],
)
def test_every_other_way_to_write_is_noticed(breach: str) -> None:
    assert found_in(breach)

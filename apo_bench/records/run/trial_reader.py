"""Read the trial records of a sweep as columns; large files by several processes."""

from __future__ import annotations

import gc
import math
import multiprocessing
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from operator import attrgetter
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
import numpy as np

from apo_bench.io import CONTROL, open_file
from apo_bench.records.run.run_folder import TRIALS_KIND, find_trials, iterate_records
from apo_bench.records.run.trials import STATED, Trials, iterate_batches, join_trials, make_columns, make_trials
from apo_bench.records.run.validation import CHECKED, NAMES, decode_kept, find_contradiction
from apo_bench.records.settings import RECORD_SCHEMA

_GET = attrgetter(*STATED)
_LEAST_SHARE = 32 * 2**20
"""Fewest bytes for which a process is worthwhile."""


def read_trials(folder: str | Path) -> Trials:
    """Read the trials of a sweep; large files are read by several processes where processes can be forked.

    Raises:
        InputError: There is no such folder, it holds no trials, or a line is no complete record.
    """
    path = find_trials(folder)
    size = path.stat().st_size
    many = min(os.cpu_count() or 1, size // _LEAST_SHARE) if sys.platform == "linux" else 1
    ends = [size * i // max(1, many) for i in range(max(1, many) + 1)]
    if many <= 1:
        parts = [_read_share(path, 0, size)]
    else:
        with ProcessPoolExecutor(many, multiprocessing.get_context("fork"), gc.disable) as pool:
            parts = list(pool.map(_read_share, [path] * many, ends, ends[1:]))
    right = [part for part in parts if part is not None]
    # the message names the line
    return join_trials(right) if len(right) == len(parts) else make_trials(iterate_records(folder))


def _read_share(path: Path, start: int, end: int) -> Trials | None:
    """Read the records of the lines that begin from `start` to before `end` bytes; None if one is wrong."""
    parts = []
    with open_file(path, TRIALS_KIND) as file:
        for lines in iterate_batches(_lines_between(file, start, end)):
            records: list[Any]
            try:
                records = list(map(decode_kept, lines))
            except (msgspec.DecodeError, RecursionError, ValueError):
                return None
            values = dict(zip(STATED, zip(*map(_GET, records), strict=True), strict=True))
            part = make_columns(values, [record.failure_prediction or {} for record in records])
            if not _is_consistent(part):
                return None
            parts.append(part)
    return join_trials(parts)


def _is_consistent(trials: Trials) -> bool:
    """Return whether all records pass the checks of `decode_record`, given that they could be decoded."""
    null = np.column_stack([trials.is_null(name) for name in CHECKED])
    success, as_demonstrated = trials.number("success"), trials.number("as_demonstrated") == 1.0
    # few combinations are distinct
    kinds = null @ (1 << np.arange(len(CHECKED))) * 8 + np.nan_to_num(success, nan=2.0).astype(int) * 2
    for i in np.unique(kinds + as_demonstrated, return_index=True)[1].tolist():
        right = None if math.isnan(success[i]) else bool(success[i])
        if find_contradiction(null[i].tolist(), right, bool(as_demonstrated[i])):
            return False
    names = [name for column in NAMES for name in trials.coded(column).names if name]
    return trials.coded("schema").names == [RECORD_SCHEMA] and not any(map(CONTROL.search, names))


def _lines_between(file: BinaryIO, start: int, end: int) -> Iterator[bytes]:
    """Yield the lines that begin from `start` to before `end` bytes, without an incomplete last line."""
    position = max(0, start - 1)
    file.seek(position)
    position += len(file.readline()) if start else 0  # the line that begins before, or its end
    for line in file:
        if position >= end or not line.endswith(b"\n"):
            return
        yield line
        position += len(line)

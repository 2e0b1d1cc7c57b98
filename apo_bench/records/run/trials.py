"""Trial records as columns, so that a million records fit into memory and are grouped in seconds."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any, NamedTuple, final

import msgspec
import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array
from apo_bench.io import clean
from apo_bench.records.record import RECORD_FIELDS
from apo_bench.records.secret_seed import find_common_secret_seed
from apo_bench.records.settings import SETTINGS

Mask = NDArray[np.bool_]
"""(n,): which trials."""
Numbers = NDArray[np.floating[Any]]
"""(n,): a column of numbers, in single precision where that keeps them exactly."""
Index = NDArray[np.integer[Any]]
"""(n,): indices of trials, or numbers of values or groups."""
_NOT_KEPT = (
    *("env_id", "thresholds", "as_demonstrated_code", "conditions", "tried_corrections", "fit_adjustments"),
    *("grasp_slip", "final_poses", "failure_prediction"),  # the last has its own columns
)
# column -> default of its setting
_USUAL = {info.name: info.default for name, info in SETTINGS.items() if name != "scenario"}


def _column_kind(annotation: Any) -> type | None:
    """Return float, int or bool if a column has such values; None for all other types."""
    info = msgspec.inspect.type_info(annotation)
    kinds = {type(part).__name__ for part in getattr(info, "types", (info,))}
    return next((kind for kind in (float, int, bool) if f"{kind.__name__.title()}Type" in kinds), None)


COLUMNS: Mapping[str, type | None] = {
    **{name: _column_kind(annotation) for name, annotation in RECORD_FIELDS.items() if name not in _NOT_KEPT},
    "predicted_fails": bool,
    "predicted_operation": int,
    "predicted_code": None,
}
"""Column that is kept -> type of its numbers; None for a column of other values."""
_PREDICTED = {"predicted_fails": "fails", "predicted_operation": "operation", "predicted_code": "code"}
"""Column -> key of the failure prediction."""
STATED = tuple(name for name in COLUMNS if name not in _PREDICTED)
"""Columns that a record states itself."""
_LISTS = tuple(name for name, kind in RECORD_FIELDS.items() if "list" in str(kind))
"""Columns of lists, which are kept as tuples."""
_CHUNK = 4_000
"""Records that are made columns at once."""


class CodedColumn(NamedTuple):
    """A column of texts or tuples, each distinct value kept once."""

    codes: Index
    """(n,): the index in `names` of the value of each trial."""
    names: Sequence[Any]
    """The distinct values."""


class TrialGroups(NamedTuple):
    """Trials, grouped by their values in some columns."""

    keys: list[tuple[Any, ...]]
    """The values of each group in these columns."""
    of: Index
    """(n,): the index in `keys` of the group of each trial."""


@final
@dataclass(frozen=True, eq=False)
class Trials:
    """Trial records as columns; a part of them shares the columns, so that it needs little memory."""

    columns: Mapping[str, Numbers | CodedColumn]
    """Column -> its m numbers, with 1 for true, and NaN where a record has no value; or its texts or tuples. A column
    with the same number everywhere has it once, (1,)."""
    count: int
    """Number m of trials in the columns."""
    index: Index | None = None
    """(n,): the chosen ones of them; None for all."""

    def __len__(self) -> int:
        return self.count if self.index is None else len(self.index)

    def find_secret_seed(self) -> str | None:
        """Return the hash of the secret seed that all trials were drawn with; None if there is none.

        Raises:
            InputError: The trials have several secret seeds, so that equal seeds are different trials.
        """
        return find_common_secret_seed({"secret_seed": secret_seed} for secret_seed in self.distinct("secret_seed"))

    def number(self, name: str) -> Array:
        """Return a column of numbers, (n,)."""
        column = self.columns[name]
        assert isinstance(column, np.ndarray)
        if len(column) != self.count:
            return np.full(len(self), column[0], dtype=float)
        return np.asarray(column if self.index is None else column[self.index], dtype=float)

    def coded(self, name: str) -> CodedColumn:
        """Return a column of texts or tuples."""
        column = self.columns[name]
        assert isinstance(column, CodedColumn)
        return column if self.index is None else column._replace(codes=column.codes[self.index])

    def is_null(self, name: str) -> Mask:
        """Return a mask, (n,), of the trials without a value in a column."""
        if COLUMNS[name] is not None:
            return np.isnan(self.number(name))
        codes, names = self.coded(name)
        return codes == (names.index(None) if None in names else -1)

    def equals(self, other: Trials, name: str) -> Mask:
        """Return a mask, (n,): whether a column has the same value in two lists of n trials, or in neither."""
        first, second = _pair_codes(self, other, name)
        return np.asarray(first == second)

    def values(self, name: str) -> list[Any]:
        """Return a column as plain values, with None where a record has no value."""
        if isinstance(self.columns[name], CodedColumn):
            codes, names = self.coded(name)
            return [names[code] for code in codes.tolist()]
        kind = COLUMNS[name] or float
        return [None if math.isnan(x) else kind(x) for x in self.number(name).tolist()]

    def distinct(self, name: str) -> list[Any]:
        """Return the distinct values of a column, in the order of their first occurrence."""
        return self.where(np.sort(np.unique(self._codes(name), return_index=True)[1])).values(name)

    def holds(self, name: str, condition: Callable[[Any], object]) -> Mask:
        """Return a mask, (n,): whether a condition holds for the value of a coded column."""
        codes, names = self.coded(name)
        # evaluated once per distinct value
        return np.array([bool(condition(each)) for each in names], dtype=bool)[codes]

    def rows(self, names: Collection[str] = tuple(COLUMNS)) -> list[dict[str, Any]]:
        """Return the trials as records, with the columns that are kept, or some of them."""
        columns = [self.values(name) for name in names]
        return [dict(zip(names, values, strict=True)) for values in zip(*columns, strict=True)]

    def where(self, which: Mask | Index | slice) -> Trials:
        """Return some of the trials: by a mask, by indices in their order, or by a slice."""
        index = np.arange(self.count, dtype=np.int32) if self.index is None else self.index
        return Trials(self.columns, self.count, index[which])

    def groups(self, names: Iterable[str]) -> TrialGroups:
        """Group trials by their values in some columns; the order of the groups has no meaning."""
        names = list(names)
        of = np.zeros(len(self), dtype=np.int64)
        for name in names:
            own = self._codes(name)
            if own.max(initial=0) > 0:  # a column with one value distinguishes nothing
                # combine both numberings into one, renumbered without gaps
                of = np.unique(of * (int(own.max()) + 1) + own, return_inverse=True)[1]
        first = self.where(np.unique(of, return_index=True)[1])  # the first trial of each group
        return TrialGroups(list(zip(*(first.values(name) for name in names), strict=True)), of)

    def parts(self, names: Iterable[str]) -> dict[tuple[Any, ...], Trials]:
        """Return values in some columns -> the trials with these values, sorted by seed."""
        keys, of = self.groups(names)
        order = np.lexsort((self.number("seed"), of)).astype(np.int32)  # by group, then by seed
        ends = np.cumsum(np.bincount(of, minlength=len(keys))).tolist()
        together = self.where(order)
        return {key: together.where(slice(a, b)) for key, a, b in zip(keys, [0, *ends], ends, strict=False)}

    def _codes(self, name: str) -> Index:
        """Return a number for the value of each trial in a column, (n,), from 0."""
        column = self.columns[name]
        if isinstance(column, CodedColumn):
            return self.coded(name).codes
        if len(column) != self.count:
            return np.zeros(len(self), dtype=np.int32)
        return np.unique(self.number(name), return_inverse=True)[1]


def pair_groups(first: Trials, second: Trials, names: Iterable[str]) -> tuple[Index, Index]:
    """Return a number for the values of each trial in some columns, (n,) and (m,); equal values have equal numbers."""
    of = np.zeros(len(first) + len(second), dtype=np.int64)
    for name in names:
        own = np.concatenate(_pair_codes(first, second, name))
        if np.ptp(own) > 0:
            own = np.unique(own, return_inverse=True)[1]
            of = np.unique(of * (int(own.max()) + 1) + own, return_inverse=True)[1]
    return of[: len(first)], of[len(first) :]


def _pair_codes(first: Trials, second: Trials, name: str) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return a number for the value of each trial of both in a column, (n,) and (m,); equal values have equal ones."""
    if COLUMNS[name] is not None:
        # no number of a record is infinite
        return np.nan_to_num(first.number(name), nan=np.inf), np.nan_to_num(second.number(name), nan=np.inf)
    known = _Codes()
    coded = (first.coded(name), second.coded(name))
    of, other = (np.array([known[value] for value in each.names], dtype=np.int32)[each.codes] for each in coded)
    return of, other


class _Codes(dict[Any, int]):
    """Value -> its number; a new value gets the next number."""

    def __missing__(self, value: Any) -> int:
        self[value] = number = len(self)
        return number


def make_trials(records: Trials | Iterable[Mapping[str, Any]]) -> Trials:
    """Return records as columns; missing settings have their defaults."""
    if isinstance(records, Trials):
        return records
    parts = []
    for chunk in iterate_batches(records):
        values = {name: [record.get(name, _USUAL.get(name)) for record in chunk] for name in STATED}
        parts.append(make_columns(values, [record.get("failure_prediction") or {} for record in chunk]))
    return join_trials(parts)


def iterate_batches(items: Iterable[Any]) -> Iterator[list[Any]]:
    """Yield lists of at most `_CHUNK` items."""
    left = iter(items)
    while batch := list(islice(left, _CHUNK)):
        yield batch


def make_columns(values: Mapping[str, Sequence[Any]], predicted: Sequence[Mapping[str, Any]]) -> Trials:
    """Return columns of values, with None where a record has no value, and of failure predictions."""
    every = {**values, **{name: [each.get(key) for each in predicted] for name, key in _PREDICTED.items()}}
    columns: dict[str, Numbers | CodedColumn] = {}
    for name, kind in COLUMNS.items():
        own = every.get(name, ())
        if kind is not None:
            columns[name] = _shorten(np.array(own, dtype=float))
            continue
        known = _Codes()
        plain = [tuple(value) if isinstance(value, list) else value for value in own] if name in _LISTS else own
        codes = np.fromiter(map(known.__getitem__, plain), np.int32, len(own))
        names = list(known)
        columns[name] = CodedColumn(codes, [text and clean(text) for text in names] if name == "sentence" else names)
    return Trials(columns, len(predicted))


def _shorten(column: Array) -> Numbers:
    """Return numbers, (n,), in less memory: one for equal ones, (1,), and half of it where that keeps them exactly."""
    if len(column) and _is_equal(column):
        return column[:1]
    half = column.astype(np.float32)
    return half if np.array_equal(half, column, equal_nan=True) else column


def join_trials(parts: Sequence[Trials]) -> Trials:
    """Return all trials of several parts, in their order."""
    if len(parts) == 1:
        return parts[0]
    columns: dict[str, Numbers | CodedColumn] = {}
    for name, kind in COLUMNS.items():
        own: list[Any] = [part.columns[name] for part in parts]
        if kind is None:
            known = _Codes()
            numbers = [np.array([known[value] for value in each.names], dtype=np.int32) for each in own]
            codes = [to[each.codes] for to, each in zip(numbers, own, strict=True)]
            columns[name] = CodedColumn(np.concatenate([np.zeros(0, dtype=np.int32), *codes]), list(known))
        elif own and all(len(each) == 1 for each in own) and _is_equal(np.concatenate(own)):
            columns[name] = own[0]
        else:
            whole = [np.broadcast_to(each, part.count) for each, part in zip(own, parts, strict=True)]
            columns[name] = np.concatenate([np.zeros(0, dtype=np.float32), *whole])
    return Trials(columns, sum(part.count for part in parts))


def _is_equal(column: Numbers) -> bool:
    """Return whether all numbers, (n,), at least one, are equal, or all are NaN."""
    return bool(np.isnan(column).all() or (column == column[0]).all())

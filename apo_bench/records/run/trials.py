"""Trial records as columns, so that a million records fit into memory and are grouped in seconds."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

import msgspec
import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array
from apo_bench.records.record import RECORD_FIELDS
from apo_bench.records.run.run_folder import each_record
from apo_bench.records.secret_seed import find_common_secret_seed
from apo_bench.records.settings import SETTINGS

Mask = NDArray[np.bool_]
"""(n,): which trials."""
Index = NDArray[np.integer[Any]]
"""(n,): indices of trials, or numbers of values or groups."""
_NOT_KEPT = (
    *("env_id", "thresholds", "as_demonstrated_code", "conditions", "tried_corrections", "fit_adjustments"),
    *("grasp_slip", "reached", "failure_prediction"),  # the last has its own columns
)
# column -> default of its setting
_USUAL = {info.name: info.default for name, info in SETTINGS.items() if name != "scenario"}


def _kind(annotation: Any) -> type | None:
    """Return float, int or bool if a column has such values; None for all other types."""
    info = msgspec.inspect.type_info(annotation)
    kinds = {type(part).__name__ for part in getattr(info, "types", (info,))}
    return next((kind for kind in (float, int, bool) if f"{kind.__name__.title()}Type" in kinds), None)


COLUMNS: Mapping[str, type | None] = {
    **{name: _kind(annotation) for name, annotation in RECORD_FIELDS.items() if name not in _NOT_KEPT},
    "predicted_fails": bool,
    "predicted_operation": int,
    "predicted_code": None,
}
"""Column that is kept -> type of its numbers; None for a column of other values."""


class Coded(NamedTuple):
    """A column of texts or tuples, each distinct value kept once."""

    codes: Index
    """(n,): the index in `names` of the value of each trial."""
    names: Sequence[Any]
    """The distinct values."""


class Groups(NamedTuple):
    """Trials, grouped by their values in some columns."""

    keys: list[tuple[Any, ...]]
    """The values of each group in these columns."""
    of: Index
    """(n,): the index in `keys` of the group of each trial."""


@final
@dataclass(frozen=True, eq=False)
class Trials:
    """Trial records as columns.

    Attributes:
        numbers: Column -> (n,), with 1 for true, and NaN where a record has no value.
        coded: Column of texts or tuples -> its values.
    """

    numbers: Mapping[str, Array]
    coded: Mapping[str, Coded]

    def __len__(self) -> int:
        return len(self.numbers["seed"])

    def find_secret_seed(self) -> str | None:
        """Return the hash of the secret seed that all trials were drawn with; None if there is none.

        Raises:
            InputError: The trials have several secret seeds, so that equal seeds are different trials.
        """
        return find_common_secret_seed({"secret_seed": secret_seed} for secret_seed in self.distinct("secret_seed"))

    def number(self, name: str) -> Array:
        """Return a column of numbers, (n,)."""
        return self.numbers[name]

    def values(self, name: str) -> list[Any]:
        """Return a column as plain values, with None where a record has no value."""
        if name in self.coded:
            codes, names = self.coded[name]
            return [names[code] for code in codes.tolist()]
        kind = COLUMNS[name] or float
        return [None if math.isnan(x) else kind(x) for x in self.numbers[name].tolist()]

    def distinct(self, name: str) -> list[Any]:
        """Return the distinct values of a column, in the order of their first occurrence."""
        return list(dict.fromkeys(self.values(name)))

    def holds(self, name: str, condition: Callable[[Any], object]) -> Mask:
        """Return a mask, (n,): whether a condition holds for the value of a coded column."""
        codes, names = self.coded[name]
        # evaluated once per distinct value
        return np.array([bool(condition(each)) for each in names], dtype=bool)[codes]

    def rows(self) -> list[dict[str, Any]]:
        """Return the trials as records, with the columns that are kept."""
        columns = [self.values(name) for name in COLUMNS]
        return [dict(zip(COLUMNS, values, strict=True)) for values in zip(*columns, strict=True)]

    def where(self, which: Mask | Index | slice) -> Trials:
        """Return some of the trials: by a mask, by indices in their order, or by a slice."""
        return Trials(
            {name: column[which] for name, column in self.numbers.items()},
            {name: Coded(column.codes[which], column.names) for name, column in self.coded.items()},
        )

    def groups(self, names: Iterable[str]) -> Groups:
        """Group trials by their values in some columns; the order of the groups has no meaning."""
        names = list(names)
        of = np.zeros(len(self), dtype=np.int64)
        for name in names:
            own = (
                self.coded[name].codes if name in self.coded else np.unique(self.numbers[name], return_inverse=True)[1]
            )
            # combine both numberings into one, renumbered without gaps
            of = np.unique(of * (int(own.max(initial=0)) + 1) + own, return_inverse=True)[1]
        first = self.where(np.unique(of, return_index=True)[1])  # the first trial of each group
        return Groups(list(zip(*(first.values(name) for name in names), strict=True)), of)

    def parts(self, names: Iterable[str]) -> dict[tuple[Any, ...], Trials]:
        """Return values in some columns -> the trials with these values, sorted by seed."""
        keys, of = self.groups(names)
        order = np.lexsort((self.numbers["seed"], of))  # by group, then by seed
        ends = np.cumsum(np.bincount(of, minlength=len(keys))).tolist()
        together = self.where(order)
        return {key: together.where(slice(a, b)) for key, a, b in zip(keys, [0, *ends], ends, strict=False)}


def trials_of(records: Trials | Iterable[Mapping[str, Any]]) -> Trials:
    """Return records as columns; missing settings have their defaults."""
    if isinstance(records, Trials):
        return records
    numbers: dict[str, array[float]] = {name: array("d") for name, kind in COLUMNS.items() if kind is not None}
    codes: dict[str, array[int]] = {name: array("i") for name, kind in COLUMNS.items() if kind is None}
    names: dict[str, dict[Any, int]] = {name: {} for name in codes}
    for record in records:
        prediction = record.get("failure_prediction") or {}
        said = _USUAL | dict(record) | {f"predicted_{key}": x for key, x in prediction.items()}
        for name, numbered in numbers.items():
            number = said.get(name)
            numbered.append(math.nan if number is None else number)
        for name, coded in codes.items():
            value = said.get(name)
            known = names[name]
            coded.append(known.setdefault(tuple(value) if isinstance(value, list) else value, len(known)))
    return Trials(
        {name: np.array(column, dtype=float) for name, column in numbers.items()},
        {name: Coded(np.array(column, dtype=np.int32), list(names[name])) for name, column in codes.items()},
    )


def read_trials(folder: str | Path) -> Trials:
    """Read the trials of a sweep.

    Raises:
        InputError: There is no such folder, it holds no trials, or a line is no complete record.
    """
    return trials_of(each_record(folder))

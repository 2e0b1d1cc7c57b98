"""A value of a TOML or JSON document with its place in it, read key by key."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn, final

import numpy as np

from apo_bench.errors import InputError, one_line, require
from apo_bench.geometry import Array
from apo_bench.io.documents import read_plain, show_value
from apo_bench.io.safe_io import LARGEST_BYTES
from apo_bench.io.safe_text import UNSHOWN


@final
@dataclass(frozen=True)
class JsonNode:
    """A value of a JSON document and where it stands in it."""

    value: Any
    file: str
    key: str = ""
    """From the root, such as `operation 2, position_mm`; empty for the document itself."""

    @property
    def place(self) -> str:
        """File and key, for messages."""
        return f"{self.file}, {self.key}" if self.key else self.file

    def fail(self, allowed: str, remedy: str = "") -> NoReturn:
        """Raise the `InputError` that says what stands here and what is allowed instead."""
        raise InputError(
            f"{self.place}: {allowed}, {show_value(self.value)} was given{f'; {remedy}' if remedy else ''}."
        )

    def require(self, holds: object, allowed: str, remedy: str = "") -> None:
        """Raise that error unless something holds."""
        if not holds:
            self.fail(allowed, remedy)

    def child(self, value: Any, key: str) -> JsonNode:
        name = one_line(key, 60)
        return JsonNode(value, self.file, f"{self.key}, {name}" if self.key else name)

    def fields(self, required: Iterable[str], optional: Iterable[str] = ()) -> Mapping[str, JsonNode]:
        """The members of an object: every required key, no unknown one."""
        required = tuple(required)
        known = (*required, *optional)
        self.require(
            isinstance(self.value, dict), "an object with named keys is needed", f"its keys are {', '.join(known)}"
        )
        for key in self.value:
            if key not in known:
                near = get_close_matches(key, known, n=1, cutoff=0.5)
                hint = f"; did you mean '{near[0]}'? Allowed" if near else "; allowed"
                raise InputError(f"{self.place}: unknown key '{one_line(key, 60)}'{hint}: {', '.join(known)}.")
        for key in required:
            require(key in self.value, f"{self.place}: the key '{key}' is missing; needed are {', '.join(required)}.")
        return {key: self.child(value, key) for key, value in self.value.items()}

    def fields_of(self, schema: str, required: Iterable[str], optional: Iterable[str] = ()) -> Mapping[str, JsonNode]:
        """The members of an object whose key `schema` names its format; another format is refused before its keys."""
        if isinstance(self.value, dict) and self.value.get("schema", schema) != schema:
            self.child(self.value["schema"], "schema").fail(f'"{schema}" is needed')
        return self.fields(("schema", *required), optional)

    def items(self, name: str, count: int | None = None) -> Sequence[JsonNode]:
        """The entries of a list, called `name 1`, `name 2`, ...; `count` of them if that is given.

        A text in place of a list is its one entry.
        """
        values = [self.value] if isinstance(self.value, str) else self.value
        self.require(isinstance(values, list), "a list is needed")
        require(
            count is None or len(values) == count,
            f"{self.file}, {self.key}: {count} entries are needed, {len(values)} were given.",
        )
        return [JsonNode(value, self.file, f"{name} {i}") for i, value in enumerate(values, start=1)]

    def numbers(self, *shape: int) -> Array:
        """Finite numbers in nested lists of this shape."""
        array = np.array(self.value if _fits(self.value, shape) else math.nan, dtype=np.float64)
        self.require(np.isfinite(array).all(), f"{' x '.join(map(str, shape))} finite numbers are needed")
        return array

    def quaternion(self) -> Array:
        """Four numbers of length 1, w first."""
        q = self.numbers(4)
        self.require(
            abs(np.linalg.norm(q) - 1.0) <= 1e-3,
            "a quaternion of length 1 (within 0.001) is needed",
            "divide it by its length",
        )
        return q

    def number(self, low: float, high: float = math.inf, *, above: bool = False) -> float:
        """A finite number that is at least `low`, or above it, and at most `high`."""
        most = f" to {high:g}" if math.isfinite(high) else ""
        x = float(self.value) if _fits(self.value, ()) else math.nan
        self.require(
            math.isfinite(x) and (low < x if above else low <= x) and x <= high,
            f"a finite number {'above' if above else 'from'} {low:g}{most} is needed",
        )
        return x

    def integer(self) -> int:
        self.require(isinstance(self.value, int) and not isinstance(self.value, bool), "a whole number is needed")
        return self.value

    def text(self) -> str:
        self.require(isinstance(self.value, str), "a text in quotes is needed")
        self.require(
            not UNSHOWN.search(self.value.replace("\n", " ").replace("\t", " ")),
            "a text without control characters is needed",
        )
        return self.value

    def flag(self) -> bool:
        self.require(isinstance(self.value, bool), "true or false is needed")
        return self.value


def read_toml(path: str | Path, kind: str, limit: int = LARGEST_BYTES) -> JsonNode:
    """The document in a file; see `read_typed`."""
    return JsonNode(read_plain(path, kind, limit=limit), str(path))


def _fits(value: Any, shape: tuple[int, ...]) -> bool:
    if not shape:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300
    return isinstance(value, list) and len(value) == shape[0] and all(_fits(entry, shape[1:]) for entry in value)

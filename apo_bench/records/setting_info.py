"""Facts about a setting of a trial besides its name, type and default."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, final

from apo_bench.errors import InputError, require, shown, unknown


@final
@dataclass(frozen=True)
class SettingInfo:
    """One setting, as the command line, files and rows know it; a number there, times `scale`, is that in Python."""

    help: str = ""
    """Of its option, without default and full stop; empty if it has none."""
    called: str = ""
    """In words, for complaints; empty if what it may be is checked where it is used."""
    meaning: str = ""
    """How a complaint about a number ends."""
    choices: tuple[str, ...] = ()
    spelled: Callable[[str], str] | None = None
    """Checks a name and returns its canonical form."""
    option: str = ""
    """Command-line option without leading dashes; default: the name of the setting."""
    scale: float = 1.0
    usual: str = ""
    """What help says of the default; the default itself if empty."""
    key: bool = False
    """Whether it distinguishes the trials of one sweep."""
    axis: bool = False
    """Whether a sweep may have several values of it."""
    swept: tuple[Any, ...] = ()
    """Default values of a sweep; default: the default of a trial."""
    shared: bool = False
    """Whether all trials of a sweep have the same."""
    scene: bool = False
    """Whether the compiled scene depends on it."""
    drawn: bool = False
    """Whether it is of a random draw: null in the record of an observation from a file."""
    name: str = ""
    kind: Any = None
    """The type of the setting, with the range that it may have."""
    default: Any = None

    @property
    def range(self) -> tuple[Any, Any]:
        """The smallest and the largest number."""
        (limits,) = self.kind.__metadata__
        return limits.ge, limits.le

    @property
    def words(self) -> str:
        """The name in prose."""
        return self.name.replace("_", " ")

    @property
    def keyword(self) -> str:
        """The option as an argument, or as a key of a file."""
        return self.option.replace("-", "_")

    @property
    def is_text(self) -> bool:
        return getattr(self.kind, "__origin__", self.kind) is str

    @property
    def is_whole(self) -> bool:
        return getattr(self.kind, "__origin__", self.kind) is int


def about(help: str = "", **more: Any) -> Mapping[str, Any]:
    """The metadata of a field that is a setting; `more` as in `SettingInfo`."""
    return {"info": SettingInfo(help, **more)}


def check_value(info: SettingInfo, value: object, called: str = "", meaning: str = "") -> None:
    """Raise an `InputError` unless a setting may be this; nothing is asked of one that is not `called` anything.

    Args:
        called, meaning: In place of those of the setting.
    """
    if info.choices:
        if not isinstance(value, str) or value not in info.choices:
            raise InputError(unknown(info.called, value if isinstance(value, str) else shown(value), info.choices))
    elif info.called:
        low, high = info.range
        name = called or info.called
        number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else math.nan
        require(
            not info.is_whole or (isinstance(value, Integral) and low <= number <= high),
            f"a {name} of {shown(value)} was given; whole numbers from {low} to {high} are allowed.",
        )
        if not low <= number <= high:
            text = shown(value) if math.isnan(number) else f"{number:g}"
            why = meaning or info.meaning
            raise InputError(f"a {name} of {text} was given; a number from {low:g} to {high:g} is allowed, {why}.")

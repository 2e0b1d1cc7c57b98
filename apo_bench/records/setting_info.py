"""Properties of one setting of a trial, and the check of its values."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, final

from apo_bench.errors import require, require_known, require_text, shown
from apo_bench.io import UNSHOWN


@final
@dataclass(frozen=True)
class SettingInfo:
    """One setting on the command line, in files, in records and in Python; `scale` converts option values to Python."""

    help: str = ""
    """Help text of its option, without default and full stop; empty if the setting has no option."""
    choices: tuple[str, ...] = ()
    spelled: Callable[[str], str] | None = None
    """Checks a name and returns its canonical form."""
    option: str = ""
    """Command-line option without leading dashes; default: the name of the setting."""
    heading: str = ""
    """Heading of its option on the help pages of `run` and `sweep`."""
    scale: float = 1.0
    usual: str = ""
    """Text about the default in the help; empty for the default itself."""
    key: bool = False
    """Whether it belongs to the key that distinguishes the trials of one sweep."""
    axis: bool = False
    """Whether it may have several values in a sweep."""
    swept: tuple[Any, ...] = ()
    """Default values in a sweep; empty: the default of a trial."""
    shared: bool = False
    """Whether all trials of a sweep have the same value."""
    scene: bool = False
    """Whether the compiled scene depends on it."""
    drawn: bool = False
    """Whether it determines a random draw, so that it is null in the record of an observation from a file."""
    name: str = ""
    kind: Any = None
    """Type of the setting, with its range."""
    default: Any = None

    @property
    def words(self) -> str:
        """The name in prose."""
        return self.name.replace("_", " ")

    @property
    def keyword(self) -> str:
        """The name of the option as an argument of a function, or as a key of a file."""
        return self.option.replace("-", "_")

    @property
    def is_text(self) -> bool:
        return getattr(self.kind, "__origin__", self.kind) is str

    @property
    def is_whole(self) -> bool:
        return getattr(self.kind, "__origin__", self.kind) is int

    def check(self, value: object, called: str = "") -> None:
        """Raise an `InputError` unless the setting may have this value, whatever the other settings are.

        Args:
            called: Name of the setting in the message; default: its own.
        """
        name = called or self.words
        limits = getattr(self.kind, "__metadata__", (None,))[0]  # range of a number
        if self.choices:
            require_known(name, value if isinstance(value, str) else shown(value), self.choices)
        elif self.is_text:
            require_text(name, value)
            # scenario names are checked when they are loaded
            is_shown = self.name == "scenario" or not UNSHOWN.search(str(value))
            require(is_shown, f"{name} must not have control characters or half letters, got {value!r}.")
        elif limits is not None and limits.ge is not None:
            number = value if isinstance(value, Integral if self.is_whole else Real) else math.nan
            kind = "a whole number" if self.is_whole else "a number"
            fits = not isinstance(value, bool) and limits.ge <= number <= limits.le
            require(fits, f"{name} must be {kind} from {limits.ge:.16g} to {limits.le:.16g}, got {shown(value)}.")


def about(help: str = "", **more: Any) -> Mapping[str, Any]:
    """Return the metadata of a dataclass field that is a setting; `more` are fields of `SettingInfo`."""
    return {"info": SettingInfo(help, **more)}

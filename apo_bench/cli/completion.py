"""What a shell is offered when Tab is pressed: names out of short lists and folders, without anything being read.

Where none begins like what was typed, the shell offers files, as scenarios, noises and arms may be.
"""

from collections.abc import Callable, Iterable

from apo_bench.records.relations import RECOGNISED
from apo_bench.records.setting_info import SettingInfo
from apo_bench.records.settings import SETTINGS
from apo_bench.records.short_names import FOREIGN_ARMS, METHODS, RELATIONS
from apo_bench.resources import folder

Completion = Callable[[str], list[str]]
"""What was typed of a word -> the words that it may become."""


def scenarios() -> list[str]:
    """The scenarios that come with the package."""
    return _stems("scenarios", "*.toml")


def methods() -> list[str]:
    """What a robot can be told to do."""
    return [*METHODS, "search"]


def noises() -> list[str]:
    """Noise models, those with a formula first."""
    from apo_bench.observation.noise import NOISES

    return [*NOISES, *_stems("assets", "noise/*.toml")]


def arms() -> list[str]:
    """Arms that come with the package, and how those of other collections begin."""
    return [SETTINGS["arm"].default, *_stems("assets", "arms/*.toml"), *FOREIGN_ARMS]


def relations() -> list[str]:
    """What correctors can be told of the contacts."""
    return [SETTINGS["relations"].default, *RECOGNISED, *RELATIONS]


_NAMES: dict[str, Callable[[], list[str]]] = {"noise": noises, "arm": arms, "relations": relations, "method": methods}
"""Setting -> its names."""


def completion_of(info: SettingInfo) -> Completion | None:
    """How the value of a setting is completed; None where it is a number."""
    if info.choices:
        return beginning(lambda: info.choices)
    return beginning(_NAMES[info.name]) if info.name in _NAMES else None


def beginning(names: Callable[[], Iterable[str]]) -> Completion:
    """Names that begin like what was typed, after its last comma."""

    def complete(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        chosen = before.split(",")
        return [f"{before}{comma}{name}" for name in names() if name.startswith(last) and name not in chosen]

    return complete


def _stems(where: str, pattern: str) -> list[str]:
    return sorted(path.stem for path in folder(where).glob(pattern))

"""What a shell is offered when Tab is pressed: names out of short lists and folders, without anything being read.

Where none begins like what was typed, a shell offers files, as scenarios, noises and arms may be.
"""

from collections.abc import Callable

from apo_bench.records import DETECTED, FOREIGN_ARMS, METHODS, SETTINGS, WRONG_CONTACTS
from apo_bench.resources import folder

Completion = Callable[[str], list[str]]
"""What was typed of a word -> the words that it may become."""


def offered_names(what: str) -> list[str]:
    """Names that a shell is offered for a setting, or `scenario`: what comes with the package, and how others begin."""
    if what == "scenario":
        return _stems("scenarios", "*.toml")
    if what == "noise":
        from apo_bench.perception.observation.noise import NOISES

        return [*NOISES, *_stems("assets", "noise/*.toml")]
    if what == "arm":
        return [SETTINGS["arm"].default, *_stems("assets", "arms/*.toml"), *FOREIGN_ARMS]
    if what == "contact_source":
        return [SETTINGS["contact_source"].default, *DETECTED, *WRONG_CONTACTS]
    return [*METHODS, "spiral-search"] if what == "method" else [*SETTINGS[what].choices]


def completion(what: str) -> Completion:
    """Names that begin like what was typed, after its last comma."""

    def complete(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        names = [name for name in offered_names(what) if name.startswith(last) and name not in before.split(",")]
        return [f"{before}{comma}{name}" for name in names]

    return complete


def _stems(where: str, pattern: str) -> list[str]:
    return sorted(path.stem for path in folder(where).glob(pattern))

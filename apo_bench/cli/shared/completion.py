"""Complete names when Tab is pressed in a shell.

If no name begins with the typed text, a shell offers files, since scenarios, noise models and arms may be files.
"""

from collections.abc import Callable

from apo_bench.records import DETECTED, FOREIGN_ARMS, METHODS, SETTINGS, WRONG_CONTACTS
from apo_bench.resources import folder

Completion = Callable[[str], list[str]]
"""The typed part of a word -> the words that it may become."""


def list_offered_names(setting: str) -> list[str]:
    """Return the names that the package has for a setting or a `scenario`, and prefixes such as `menagerie:`."""
    if setting == "scenario":
        return _list_file_names("scenarios", "*.toml")
    if setting == "noise":
        from apo_bench.perception.observation.noise import NOISES

        return [*NOISES, *_list_file_names("assets", "noise/*.toml")]
    if setting == "arm":
        return [SETTINGS["arm"].default, *_list_file_names("assets", "arms/*.toml"), *FOREIGN_ARMS]
    if setting == "contact_source":
        return [SETTINGS["contact_source"].default, *DETECTED, *WRONG_CONTACTS]
    return [*METHODS, "spiral-search"] if setting == "method" else [*SETTINGS[setting].choices]


def complete_last_word(setting: str) -> Completion:
    """Return a completion of the text after the last comma, without names that precede it."""

    def complete(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        names = [
            name for name in list_offered_names(setting) if name.startswith(last) and name not in before.split(",")
        ]
        return [f"{before}{comma}{name}" for name in names]

    return complete


def _list_file_names(where: str, pattern: str) -> list[str]:
    return sorted(path.stem for path in folder(where).glob(pattern))

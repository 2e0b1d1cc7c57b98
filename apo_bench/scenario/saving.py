"""Save a scenario: copy its file and its part files to a folder."""

from pathlib import Path
from shutil import copyfile

from apo_bench.arguments import check_arguments
from apo_bench.errors import require
from apo_bench.io import read_text, write_file
from apo_bench.scenario.scenario import Scenario

_LARGEST_BYTES = 1 << 22
"""Largest size of a scenario file."""


@check_arguments
def save_scenario(scenario: Scenario, folder: str | Path) -> Path:
    """Copy a scenario file and its own part files to a folder, from which they run anywhere.

    Parts of the package are named, not copied.

    Args:
        scenario: A scenario that was read from a file.
        folder: The folder, made if it does not exist.

    Returns:
        The scenario file.

    Raises:
        InputError: The scenario was not read from a file, or the folder has a scenario of this name.
    """
    source = scenario.source
    require(source is not None, f"the scenario '{scenario.name}' was not read from a file; copy its file instead.")
    assert source is not None
    target = Path(folder) / source.name
    require(not target.exists(), f"'{target}' exists already; save to another folder.")
    target.parent.mkdir(parents=True, exist_ok=True)
    text = read_text(source, "scenario file", _LARGEST_BYTES)
    for part in {path for path in scenario.part_files.values() if path.is_relative_to(source.parent)}:
        for file in part.parent.glob(f"{part.stem}.*"):
            copy = target.parent / file.relative_to(source.parent)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copyfile(file, copy)
    write_file(target, text)
    return target

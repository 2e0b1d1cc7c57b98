"""Find the user's own files that every node of a cluster needs."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from apo_bench.formats.bop_images import list_image_files
from apo_bench.perception.observation.noise_file import list_noise_files
from apo_bench.records import ESTIMATES
from apo_bench.scenario import Scenario, is_named
from apo_bench.scenario.parts import read_part
from apo_bench.trial.input_files import list_user_files


def list_user_files_for_nodes(
    loaded: Mapping[str, Scenario], arm_files: Iterable[Path], names: Iterable[str]
) -> dict[str, Path]:
    """Return the needed files below the current folder: relative path -> file. Files elsewhere are not copied.

    The files are those of scenarios, their parts, the arm and noise models, trials and cameras of the images of pose
    results, and modules named as `module:name`, with the modules that they import from the same folder.

    Args:
        loaded: Name or path of a scenario -> scenario.
        arm_files: Files of the arm.
        names: Methods, noise models, contact sources and the arm.
    """
    files = [*arm_files]
    for source, scenario in loaded.items():
        if not is_named(source):
            files.append(Path(source))
            for part in scenario.part_files.values():
                files.extend(read_part(part).files)
    for name in names:
        files.extend(list_noise_files(name) or list_user_files(name))
        if name.startswith(ESTIMATES):
            files.extend(list_image_files(list_noise_files(name)[0]))
    here = Path.cwd()
    whole = [Path(os.path.normpath(here / path)) for path in files]
    return {path.relative_to(here).as_posix(): path for path in whole if path.is_relative_to(here)}

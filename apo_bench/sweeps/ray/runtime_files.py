"""What a sweep needs besides the package, to be sent to other machines: files below the current folder."""

import os
import re
import site
import sys
import sysconfig
from pathlib import Path

from apo_bench.observation.presets import noise_path
from apo_bench.scenario.file import load_scenario, scenario_names
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.sweeps.work.environment_lock import Names

_NAMED_FILE = re.compile(r"""\bfile\s*=\s*["']([^"']+)["']""")
"""In MJCF: meshes, textures and what is included."""
_NAMED_FOLDER = re.compile(r"""\b(?:mesh|texture|asset)dir\s*=\s*["']([^"']+)["']""")


def runtime_files(names: Names) -> dict[str, Path]:
    """The user's files below the current folder: path from there -> file. What lies elsewhere does not travel.

    Scenario files and their parts, noise files, arms, and every Python module that importing what is named brought in.
    """
    brought = names.check()
    files = [Path(name) for name in names.scenarios if name not in scenario_names()]
    files += [part for name in names.scenarios for part in load_scenario(name).part_files.values()]
    files += [path for name in names.noises if (path := noise_path(name)) is not None]
    arm = find_arm(names.arm)
    files += _with_named(arm.mjcf) if arm.model is None else arm.files
    files += [Path(path) for module in list(sys.modules.values()) if (path := getattr(module, "__file__", None))]
    files += [path for name in brought if (path := Path(name)).is_file()]
    here = Path.cwd()
    own = [Path(path) for path in _installed()]
    found = {}
    for path in files:
        whole = Path(os.path.normpath(here / path))
        if whole.is_relative_to(here) and not any(map(whole.is_relative_to, own)):
            found[whole.relative_to(here).as_posix()] = whole
    return dict(sorted(found.items()))


def _installed() -> set[str]:
    """Where Python, its packages and this one are: every machine has its own."""
    import apo_bench
    from apo_bench.resources import folder

    main = getattr(sys.modules.get("__main__"), "__file__", None)
    return {
        *(path for key, path in sysconfig.get_paths().items() if key != "data"),
        *(*site.getsitepackages(), site.getusersitepackages()),
        *(str(Path(str(apo_bench.__file__)).parent), str(folder("assets")), str(folder("scenarios"))),
        *([] if main is None else [str(Path(main).absolute())]),
    }


def _with_named(mjcf: Path) -> list[Path]:
    """An arm's file, and the files that it names, beside it or in a folder that it names for them."""
    text = mjcf.read_text(encoding="utf-8", errors="replace")
    folders = [mjcf.parent, *(mjcf.parent / name for name in _NAMED_FOLDER.findall(text))]
    named = (folder / name for folder in folders for name in _NAMED_FILE.findall(text))
    return [mjcf, *(path for path in named if path.is_file())]

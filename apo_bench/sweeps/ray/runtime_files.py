"""What a sweep needs besides the package, to be sent to other machines: files below the current folder."""

from __future__ import annotations

import os
import re
import site
import sys
import sysconfig
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import final

from apo_bench.correction.own_code.own import check_correctors
from apo_bench.errors import InputError
from apo_bench.observation.noise import Level, make_noise
from apo_bench.observation.noise_file import noise_path
from apo_bench.observation.relations import make_relations
from apo_bench.records.method import parsed
from apo_bench.records.relations import RECOGNISED
from apo_bench.records.settings import RANGE
from apo_bench.scenario.file import load_scenario, scenario_names
from apo_bench.simulation.scene.arm import find_arm
from apo_bench.sweeps.grid import Unit
from apo_bench.trial.fingerprint import noise_content, own_content
from apo_bench.trial.methods import with_simulated

NAMED_FILE = re.compile(r"""\bfile\s*=\s*["']([^"']+)["']""")
"""In MJCF: meshes, textures and what is included."""
NAMED_FOLDER = re.compile(r"""\b(?:mesh|texture|asset)dir\s*=\s*["']([^"']+)["']""")


@final
@dataclass(frozen=True)
class Named:
    """All that the trials of a sweep name."""

    scenarios: tuple[str, ...]
    arms: tuple[str, ...]
    methods: tuple[str, ...]
    relations: tuple[str, ...]
    noises: tuple[str, ...]
    content: Mapping[str, str]
    """Hashes of noise files and of the user's own modules, where the sweep was started."""


def names(work: Sequence[Unit]) -> Named:
    """What the units of a sweep name, each once."""
    trials = [trial for unit in work for trial in unit.trials]

    def each(given: Iterable[str]) -> tuple[str, ...]:
        return tuple(sorted(set(given)))

    named = Named(
        scenarios=each(trial.scenario for trial in trials),
        arms=each(trial.arm for trial in trials),
        methods=each(trial.method for trial in trials),
        relations=each(trial.relations for trial in trials),
        noises=each(trial.noise for trial in trials if trial.eye != RANGE),
        content={},
    )
    return replace(named, content=_content(named))


def _content(named: Named) -> dict[str, str]:
    return {
        **noise_content(*named.noises),
        **own_content("relations", *named.relations),
        **own_content("method", *named.methods),
        **own_content("arm", *named.arms),
    }


def check_here(named: Named) -> set[str]:
    """Raise an `InputError` unless everything that is named can be had on this machine, from the same files.

    Returns:
        The files of the modules that correctors of one's own bring in.
    """
    for scenario in named.scenarios:
        load_scenario(scenario)
    for arm in named.arms:
        find_arm(arm)
    brought = check_correctors(with_simulated(parsed(method).plan) for method in named.methods)
    for relations in named.relations:
        if relations not in RECOGNISED:
            make_relations(relations)
    for noise in named.noises:
        make_noise(noise, Level(1.0, 1.0))
    here = _content(named)
    for name, content in named.content.items():
        if here.get(name) != content:
            raise InputError(f"the file behind the {name} is another one there; use the same everywhere.")
    return brought


def runtime_files(named: Named) -> dict[str, Path]:
    """The user's files below the current folder: path from there -> file. What lies elsewhere does not travel.

    Scenario files and their parts, noise files, arms, and every Python module that importing what is named brought in.
    """
    brought = check_here(named)
    files = [Path(name) for name in named.scenarios if name not in scenario_names()]
    files += [part for name in named.scenarios for part in load_scenario(name).part_files.values()]
    files += [path for name in named.noises if (path := noise_path(name)) is not None]
    for name in named.arms:
        files += _with_named(find_arm(name).mjcf)
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
    folders = [mjcf.parent, *(mjcf.parent / name for name in NAMED_FOLDER.findall(text))]
    named = (folder / name for folder in folders for name in NAMED_FILE.findall(text))
    return [mjcf, *(path for path in named if path.is_file())]

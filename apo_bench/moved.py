"""Old module paths: in this version they still lead to the new place, with a warning that names it."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Mapping, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any, final

_MODELS = (
    "anisotropic",
    "bias",
    "camera",
    "correlated",
    "empirical",
    "fitted",
    "heavy_tailed",
    "isotropic",
    "level",
    "outliers",
    "per_part",
    "plain",
    "residuals",
    "symmetric",
    "tails",
)
MODULES = MappingProxyType(
    {
        "benchmark": "",
        "benchmark.grid": "sweeps.grid",
        "benchmark.spec": "records.settings",
        "benchmark.sweep": "sweeps.sweep",
        "corrected": "envs.corrected",
        "correction.correct": "correction.correctors",
        "correction.equations": "assembly.equations",
        "correction.explain": "correction.explanation",
        "env": "envs.apo_replay",
        "observation.bop": "files.bop",
        "observation.bop_truth": "files.bop_truth",
        "observation.fit": "observation.fitting.fit",
        "observation.observe": "observation.observing",
        "observation.quantiles": "observation.fitting.quantiles",
        **{f"observation.{name}": f"observation.models.{name}" for name in _MODELS},
        "observation.bias_view": "observation.models.bias",
        "observation.facts": "observation.models.level",
        "observation.sighted": "observation.models.anisotropic",
        "outcomes": "records.outcomes",
        "program": "assembly.goals",
        "scenario_file": "scenario.file",
        "simulation.render": "simulation.scene.render",
    }
)
"""Old path -> new path, both within `apo_bench`; empty for a package that is gone."""
NAMES = MappingProxyType(
    {
        "benchmark.grid": {"SweepSpec": "SweepSettings"},
        "benchmark.spec": {"TrialSpec": "TrialSettings"},
        "benchmark.sweep": {"sweep": "run_sweep"},
        "correction.equations": {"gap": "largest_gap"},
        "observation.bop": {"Located": "PoseRows", "checked": "check_rows"},
        "observation.fit": {"fit": "fit_noise", "compared": "goodness_of_fit"},
        "observation.fitted": {"Measured": "MeasuredNoise"},
        "observation.isotropic": {"FLOOR": "COVARIANCE_FLOOR", "seen_at": "observe_displaced"},
        "observation.outliers": {"UNKNOWN": "UNSEEN_DEVIATION"},
        "observation.residuals": {"compare": "match_residuals"},
        "program": {
            **{name: f"assembly.correction_record.{name}" for name in ("Consistency", "Correction", "Iterate")},
            **{name: f"assembly.correction_record.{name}" for name in ("Suspect", "Try")},
            **{name: f"assembly.reached.{name}" for name in ("Outcome", "Reached", "ReplayResult", "Snapshot")},
        },
    }
)
"""Old path -> names in it that are called otherwise now, with the module that has them if it is another one."""


@final
class MovedModules(MetaPathFinder, Loader):
    """Finds what no other finder found, if it stood at an old path."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        package, _, old = name.partition(".")
        if package != "apo_bench" or old not in MODULES:
            return None
        if not MODULES[old]:
            return ModuleSpec(name, self, is_package=True)
        file = Path(__file__).parent.joinpath(*MODULES[old].split(".")).with_suffix(".py")
        return spec_from_file_location(name, file, loader=self)

    def exec_module(self, module: ModuleType) -> None:
        old = module.__name__.partition(".")[2]
        if MODULES[old]:
            now = f"apo_bench.{MODULES[old]}"
            _warn(module.__name__, now, stacklevel=3)
            found = vars(importlib.import_module(now))
            vars(module).update({name: value for name, value in found.items() if not name.startswith("__")})
            for before, after in NAMES.get(old, {}).items():
                place, _, name = after.rpartition(".")
                there = importlib.import_module(f"apo_bench.{place}" if place else now)
                setattr(module, before, getattr(there, name))


def moved_names(package: str, places: Mapping[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a package that was a module, for the names that were in it.

    Args:
        package: Its `__name__`.
        places: Name -> the module of the package that has it, and its name there: `topology.Assembly`.
    """

    def moved(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, _, now = f"{package}.{places[name]}".rpartition(".")
        _warn(f"{package}.{name}", f"{module}.{now}", stacklevel=3)
        return getattr(importlib.import_module(module), now)

    return moved


def _warn(before: str, now: str, stacklevel: int) -> None:
    warnings.warn(f"{before} is {now} now; the old path works in this version only.", DeprecationWarning, stacklevel)

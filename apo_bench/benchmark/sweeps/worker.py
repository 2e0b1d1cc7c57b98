"""Run batches of trials in a worker process."""

import platform
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, final

from apo_bench.benchmark.sweeps.grid import Batch
from apo_bench.errors import require
from apo_bench.records import KEY, TrialConfig, TrialRecord, get_record_key
from apo_bench.simulation.execution import ReplayCache
from apo_bench.simulation.scene import Scene
from apo_bench.trial.fingerprint import compute_content_hash, list_versions
from apo_bench.trial.run import record_trial
from apo_bench.trial.trial_stages import demonstration_of, scene_key, scene_of

Timing = dict[str, Any]
"""A line of `timing.jsonl`: wall times, host and worker, which settings and seed do not determine."""
Ended = tuple[TrialRecord, Timing]  # record and timing of a finished trial


@final
@dataclass(frozen=True)
class SweepInputs:
    """Hashes and versions that the records of a sweep state, as found by the process that started it."""

    content: Mapping[str, str]
    """Name or path of a scenario -> its `compute_content_hash`."""
    versions: Mapping[str, str]
    """Package -> version."""


@final
class Worker:
    """Runs batches of trials; compiles each scene once."""

    def __init__(self, inputs: SweepInputs, name: Mapping[str, Any]) -> None:
        """Check the installed packages.

        Args:
            inputs: Hashes and versions that must also be found here.
            name: Columns of `timing.jsonl` that identify the worker.

        Raises:
            InputError: Other versions of packages are installed here.
        """
        here = list_versions()
        for package, version in inputs.versions.items():
            require(
                here.get(package) == version,
                f"a worker on '{platform.node()}' has {package} {here.get(package)}, the process that started the "
                f"sweep {version}; install the same everywhere.",
            )
        self._inputs = inputs
        self._name = name
        self._scenes: dict[tuple[Any, ...], Scene] = {}  # key of a scene -> compiled scene

    def run(self, batch: Batch) -> Iterator[Ended]:
        """Run the trials of a batch in order; they share the demonstration and the common beginnings of replays.

        Raises:
            InputError: A trial is not allowed, or files differ from those of the process that started the sweep.
        """
        cache = ReplayCache()  # states of replays, for later ones that begin alike
        simulated = None
        for spec in batch:
            start = time.perf_counter()
            scene = self._get_scene(spec)
            compiled = time.perf_counter()
            simulated = simulated or demonstration_of(spec, scene)
            shown = time.perf_counter()
            record = record_trial(spec, scene, simulated, self._inputs.content[spec.scenario], cache=cache)
            ended = time.perf_counter()
            yield record, make_timing(record, compiled - start, shown - compiled, ended - shown, self._name)

    def _get_scene(self, spec: TrialConfig) -> Scene:
        """Return the compiled scene of a trial; its files must be those of the process that started the sweep."""
        key = scene_key(spec)
        if key not in self._scenes:
            scene = scene_of(spec)
            require(
                compute_content_hash(scene.scenario, spec.scenario, scene.arm.files)
                == self._inputs.content[spec.scenario],
                f"a worker on '{platform.node()}' has other files for '{spec.scenario}' than the process "
                "that started the sweep; install the same everywhere, or start the same command again if a file was "
                "changed.",
            )
            self._scenes[key] = scene
        return self._scenes[key]


def make_timing(
    record: TrialRecord,
    compile_s: float | None,
    demonstrate_s: float | None,
    trial_s: float | None,
    worker: Mapping[str, Any],
) -> Timing:
    """Return the line of `timing.jsonl` for a trial.

    Compilation and demonstration are counted for the first trial that needs them; None is unknown.
    """
    return {
        **dict(zip(KEY, get_record_key(record), strict=True)),
        "compile_s": compile_s,
        "demonstrate_s": demonstrate_s,
        "trial_s": trial_s,
        "host": platform.node(),
        **worker,
    }

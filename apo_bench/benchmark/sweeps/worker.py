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
from apo_bench.trial.fingerprint import content_hash, versions
from apo_bench.trial.run import record_trial
from apo_bench.trial.stages import demonstration_of, scene_key, scene_of

Timing = dict[str, Any]
"""One line of `timing.jsonl`: what no specification determines."""
Ended = tuple[TrialRecord, Timing]


@final
@dataclass(frozen=True)
class SweepInputs:
    """Inputs of all records of a sweep, from the process that started it."""

    content: Mapping[str, str]
    """Name or path of a scenario -> its `content_hash`."""
    versions: Mapping[str, str]
    """Package -> version."""


@final
class Worker:
    """Runs batches; compiles each scene once."""

    def __init__(self, inputs: SweepInputs, name: Mapping[str, Any]) -> None:
        """Args:
            name: Tells workers apart in `timing.jsonl`.

        Raises:
            InputError: Packages of other versions are installed here.
        """
        here = versions()
        for package, version in inputs.versions.items():
            require(
                here.get(package) == version,
                f"a worker on '{platform.node()}' has {package} {here.get(package)}, the process that started the "
                f"sweep {version}; install the same everywhere.",
            )
        self._inputs = inputs
        self._name = name
        self._scenes: dict[tuple[Any, ...], Scene] = {}

    def run(self, batch: Batch) -> Iterator[Ended]:
        """Run the trials of a batch in their order; the demonstration and the beginnings of replays are shared.

        Raises:
            InputError: The request cannot be honoured, or there are other files here than where the sweep was started.
        """
        cache = ReplayCache()
        simulated = None
        for spec in batch:
            start = time.perf_counter()
            scene = self._scene(spec)
            compiled = time.perf_counter()
            simulated = simulated or demonstration_of(spec, scene)
            shown = time.perf_counter()
            record = record_trial(spec, scene, simulated, self._inputs.content[spec.scenario], cache=cache)
            ended = time.perf_counter()
            yield record, timing(record, compiled - start, shown - compiled, ended - shown, self._name)

    def _scene(self, spec: TrialConfig) -> Scene:
        key = scene_key(spec)
        if key not in self._scenes:
            scene = scene_of(spec)
            require(
                content_hash(scene.scenario, spec.scenario, scene.arm.files) == self._inputs.content[spec.scenario],
                f"a worker on '{platform.node()}' has other files for '{spec.scenario}' than the process "
                "that started the sweep; install the same everywhere, or start the same command again if a file was "
                "changed.",
            )
            self._scenes[key] = scene
        return self._scenes[key]


def timing(
    record: TrialRecord,
    compile_s: float | None,
    demonstrate_s: float | None,
    trial_s: float | None,
    worker: Mapping[str, Any],
) -> Timing:
    """Wall times of a trial; compiling and demonstrating are paid by the first trial that needs them."""
    return {
        **dict(zip(KEY, get_record_key(record), strict=True)),
        "compile_s": compile_s,
        "demonstrate_s": demonstrate_s,
        "trial_s": trial_s,
        "host": platform.node(),
        **worker,
    }

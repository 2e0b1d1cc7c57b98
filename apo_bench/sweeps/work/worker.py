"""What a worker does, in whatever process on whatever machine: units of work become rows."""

import platform
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, final

from apo_bench.assembly import Outcome
from apo_bench.records import KEY, Row, TrialSettings, row_key, sentence
from apo_bench.simulation.execution import ReplayCache
from apo_bench.simulation.scene import Scene
from apo_bench.sweeps.work.environment_lock import EnvironmentLock, Message, Unit
from apo_bench.trial.fingerprint import content_hash
from apo_bench.trial.outcome_columns import result
from apo_bench.trial.stages import SimulatedDemonstration, demonstration_of, scene_key, scene_of
from apo_bench.trial.trial import trial_row

Timing = dict[str, Any]
"""One line of `timing.jsonl`: what no specification determines."""
Emit = Callable[[Row, Timing], None]
"""Takes the row of a trial that has ended; every trial of a sweep yields exactly one."""


@final
class Worker:
    """Runs units of work; compiles each scene once."""

    def __init__(self, number: int, lock: EnvironmentLock) -> None:
        """Args:
        number: Tells workers apart in `timing.jsonl`.

        Raises:
            InputError: Packages of other versions are installed here.
        """
        lock.check_versions()
        self._number = number
        self._lock = lock
        self._scenes: dict[tuple[Any, ...], tuple[Scene, str]] = {}

    def run(self, unit: Unit, stopped: Callable[[], bool] = lambda: False) -> Iterator[Message]:
        """Run the trials of a unit in their order: `began` and `row` for each, as in `messages`.

        Demonstrations and the beginnings of replays are shared.

        Args:
            stopped: Asked between trials; what is not begun then is left.

        Raises:
            InputError: The request cannot be honoured, or there is other code here than where the sweep was started.
        """
        demonstrations: dict[tuple[float, str], SimulatedDemonstration] = {}
        cache = ReplayCache()
        for spec in unit.trials:
            if stopped():
                return
            start = time.perf_counter()
            scene, content = self._scene(spec)
            compile_s = time.perf_counter() - start
            yield ("began",)
            start = time.perf_counter()
            key = (spec.careless, spec.eye)
            if key not in demonstrations:
                demonstrations[key] = demonstration_of(spec, scene)
            demonstrate_s = time.perf_counter() - start
            start = time.perf_counter()
            row = trial_row(spec, scene, demonstrations[key], content, cache=cache)
            yield (
                "row",
                row,
                timing(row, compile_s, demonstrate_s, time.perf_counter() - start, {"worker": self._number}),
            )

    def _scene(self, spec: TrialSettings) -> tuple[Scene, str]:
        key = scene_key(spec)
        if key not in self._scenes:
            scene = scene_of(spec)
            content = content_hash(scene.scenario, spec.scenario, scene.arm.files)
            self._lock.check_content(spec.scenario, content)
            self._scenes[key] = (scene, content)
        return self._scenes[key]


def row_within_limit(row: Row, timing: Timing, limit_s: float) -> Row:
    """The row, or the failed row of a trial that took longer than the limit and ended before anyone looked."""
    took_s = (timing["demonstrate_s"] or 0.0) + (timing["trial_s"] or 0.0)
    if took_s <= limit_s or row["failure_stage"] == "worker":
        return row
    return (
        row
        | {"demonstration": None}
        | result(Outcome("worker", "time_limit", None, sentence("time_limit")), success=False)
    )


def timing(
    row: Row, compile_s: float | None, demonstrate_s: float | None, trial_s: float | None, worker: Mapping[str, Any]
) -> Timing:
    """Wall times of a trial; compiling and demonstrating are paid by the first trial that needs them.

    Args:
        worker: The number of the worker, and where it is, if that is not here.
    """
    return {
        **dict(zip(KEY, row_key(row), strict=True)),
        "compile_s": compile_s,
        "demonstrate_s": demonstrate_s,
        "trial_s": trial_s,
        "host": platform.node(),
        **worker,
    }

"""Success rates of methods: `evaluate`."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from apo_bench.benchmark.rate_table import RateTable
from apo_bench.benchmark.session import name_functions
from apo_bench.benchmark.sweeps.grid import AXES, SHARED, SweepConfig, convert_to_tuple
from apo_bench.benchmark.sweeps.sweep import run_sweep
from apo_bench.errors import require, require_known, shown
from apo_bench.names import SESSION
from apo_bench.records import METHODS, TrialConfig, TrialRecord
from apo_bench.scenario import Scenario, find_scenario_path, is_named

Method = str | Callable[..., Any]
"""A method by name, or a corrector: a callable `Observation -> Correction`, or `Observation -> (n, 4, 4)` poses."""

# settings that may have several values, except methods
_AXES = tuple(info.name for info in AXES if info.name != "method")


def evaluate(
    method: Method | Sequence[Method] | Mapping[str, Method],
    *,
    seeds: int = 20,
    workers: int = 1,
    save: str | Path | None = None,
    **settings: Any,
) -> RateTable:
    """Measure how often the robot's replay succeeds with each method.

    Every combination of the settings runs with the same seeds, and shows its progress on the terminal.

    Args:
        method: Methods by name or as functions; a mapping gives them labels. A function takes an `Observation` and
            returns a `Correction`, or poses (n, 4, 4) in the world frame, [m].
        seeds: Trials of each combination.
        workers: Processes; 1 runs the trials in this process, as functions of a notebook and lambdas need. A script
            with more of them calls `evaluate` under `if __name__ == "__main__":`.
        save: Folder of the records, as `apo-bench sweep` writes it; the same call continues an interrupted run.
            Default: a temporary folder.
        settings: Settings of `TrialConfig` and `noise_level`, one value or several: `scenario`, `noise_level`, ... A
            pair of mm and degrees is `[(1, 0.5)]`. The defaults are those of one trial; `seed` is the first seed. A
            scenario may be a `Scenario`, and `noise` a function.

    Returns:
        A table with the success rate and its 95 % interval in each condition.

    Raises:
        InputError: An unknown setting, a value that is not allowed, or a function with more than one worker that cannot
            be imported.

    Examples:
        >>> import apo_bench, numpy as np
        >>> def replay_as_observed(observation):
        ...     return np.array(observation.poses)  # (n, 4, 4), world frame, [m]
        >>> table = apo_bench.evaluate(
        ...     {"mine": replay_as_observed, "contact": "contact"},
        ...     scenario="block_on_block",
        ...     seeds=1,
        ...     fidelity="near-contact",
        ... )
        >>> [(row["method"], row["trials"]) for row in table.rows]
        [('mine', 1), ('contact', 1)]
    """
    for name in settings:
        require_known("setting", name, (*_AXES, *SHARED, "noise_mm", "noise_deg", "seed"))
    settings = {"noise_level": 1.0, "human_error_scale": TrialConfig.human_error_scale} | settings
    require(
        isinstance(seeds, int) and not isinstance(seeds, bool) and seeds >= 1,
        f"seeds must be a whole number of at least 1, got {shown(seeds)}.",
    )
    labelled = dict(_label_values(method, "method"))
    noises = dict(_label_values(settings.pop("noise", ()), "noise"))
    functions = {label: each for label, each in (labelled | noises).items() if callable(each)}
    settings["scenario"] = tuple(map(_scenario_source, convert_to_tuple(settings.get("scenario", ()))))
    with name_functions(functions) as names:
        local = [label for label, name in names.items() if name.startswith(f"{SESSION}:")]
        require(
            workers == 1 or not local,
            f"{', '.join(local)} cannot be imported by other processes; use workers=1, or put the function into a "
            "module.",
        )
        require(
            save is None or not local or not Path(save).exists(),
            f"'{save}' holds a run, and {', '.join(local)} cannot be recognized again; save to another folder, or put "
            "the function into a module.",
        )
        called = {label: names.get(label, each) for label, each in (labelled | noises).items()}
        if noises:
            settings["noise"] = tuple(called[label] for label in noises)
        grid = SweepConfig(method=tuple(called[label] for label in labelled), trials=seeds, **settings)
        temporary = TemporaryDirectory(prefix="apo-bench-") if save is None else None
        folder = Path(temporary.name if temporary else save or "")
        records = run_sweep(grid, folder, workers=None if workers == 1 else workers)
    labels = {called[label]: label for label in called}
    return RateTable(tuple(_relabel_record(record, labels) for record in records), folder, tuple(labelled), temporary)


def _scenario_source(scenario: str | Path | Scenario) -> str:
    """Return the name or the file of a scenario, from which a worker loads it."""
    if not isinstance(scenario, Scenario):
        return str(scenario)
    require(
        scenario.source is not None,
        f"the scenario '{scenario.name}' was given, which was not read from a file; give its file.",
    )
    shipped = is_named(scenario.name) and find_scenario_path(scenario.name) == scenario.source
    return scenario.name if shipped else str(scenario.source)


def _label_values(given: Any, kind: str) -> Iterable[tuple[str, Any]]:
    """Return pairs of label and value of methods or noise models; `kind` is `method` or `noise`."""
    if isinstance(given, Mapping):
        for label, each in given.items():
            require(isinstance(label, str), f"a label must be a text, got {shown(label)}.")
            require(label not in METHODS or each == label, f"'{label}' is a method of the package; use another label.")
        return given.items()
    several = [given] if isinstance(given, str) or callable(given) else given
    require(
        isinstance(several, Iterable) and all(isinstance(each, str) or callable(each) for each in several),
        f"{kind} must be a name, a function, or several of these, got {shown(given)}.",
    )
    pairs = [
        (each if isinstance(each, str) else getattr(each, "__name__", type(each).__name__), each) for each in several
    ]
    named = [(f"{kind}_{i}" if label == "<lambda>" else label, each) for i, (label, each) in enumerate(pairs, start=1)]
    for label, each in named:
        require(
            dict(named)[label] is each or dict(named)[label] == each,
            f"several functions are named '{label}'; give labels, as in {kind}={{'first': ..., 'second': ...}}.",
        )
    return named


def _relabel_record(record: TrialRecord, labels: Mapping[str, str]) -> TrialRecord:
    """Return a record with the labels that the caller gave."""
    method, noise = record["method"], record["noise"]
    return {**record, "method": labels.get(method, method), "noise": labels.get(noise, noise)}

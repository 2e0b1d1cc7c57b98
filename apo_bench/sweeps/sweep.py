"""Many trials: spread over processes or machines, each row written as its trial ends, resumed where it was left.

Sweep files: grids as TOML; every complaint names file, key and remedy.

    scenarios = ["stick_in_tower", "carried_bridge"]
    levels = [0.5, 1, 2]
    methods = ["none", "paper", "contact"]
    trials = 40

    [[also]]                  # a further grid: what it does not say is as above
    methods = ["oracle"]
    levels = [0]

Lengths in mm, angles in degrees; paths as on the command line, from the current folder.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from apo_bench.errors import InputError, require, require_known
from apo_bench.io import JsonNode, grouped, read_toml
from apo_bench.records import (
    CORRECTOR,
    LEVEL,
    SETTINGS,
    Limits,
    Row,
    in_python,
    level_pair,
    salt_of_sweep,
    trial_key,
)
from apo_bench.records.run.run_file import run_record
from apo_bench.records.run.run_folder import RunFolder
from apo_bench.scenario import Scenario, is_named
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.physics import physics
from apo_bench.sweeps.grid import AXES, LARGEST_TRIALS, SHARED, SweepSettings, check_grids, described, load_all, units
from apo_bench.sweeps.local.pool import run_locally
from apo_bench.sweeps.progress import progress
from apo_bench.sweeps.work.dispatch import Executor, check_limit
from apo_bench.sweeps.work.environment_lock import Check, EnvironmentLock, Names, Unit, environment_lock, listening
from apo_bench.sweeps.work.worker import Timing, row_within_limit
from apo_bench.trial.fingerprint import code_files, spec_hash
from apo_bench.trial.inputs import content_pieces

_LARGEST_WORKERS = 256
_BACKENDS = ("local", "ray")


def run_sweep(
    grids: SweepSettings | Sequence[SweepSettings],
    out: str | Path,
    *,
    workers: int | None = None,
    limit_s: float = 600.0,
    backend: str = "local",
    address: str | None = None,
    command: str = "",
    salt_file: str | Path | None = None,
) -> list[Row]:
    """Run every trial of a sweep that has no row yet.

    The rows depend on neither the number of workers, nor where they run, nor the order in which trials end.

    Args:
        grids: One, or several whose trials are united.
        out: The folder of the rows; made if it is not there, continued if it holds rows of the same sweep.
        workers: Processes; they are spawned, so a script that calls this needs the usual
            `if __name__ == "__main__":`. None stands for this process with `local`: then no trial has a limit. With
            `ray`, None stands for all that the cluster has.
        limit_s: Wall time that a trial may take in a worker; what takes longer is a failed row.
        backend: `local`, or `ray` for a cluster.
        address: Of a cluster that runs already.
        command: What to note in `run.json` as the command line.
        salt_file: Holds the salt of the trials, and is made if it is not there; None for trials that everybody can
            draw.

    Returns:
        All rows of the folder, in the order in which they ended.

    Raises:
        InputError: A setting that is not allowed, or a folder with trials of another sweep.
        RuntimeError: A trial could not be run, or a row could not be written.
        KeyboardInterrupt: After Ctrl-C or a signal, when the rows of the trials that had ended were written.
    """
    grids = (grids,) if isinstance(grids, SweepSettings) else tuple(grids)
    _check_executor(workers, limit_s, backend, address)
    here = workers is None and backend == "local"
    check_grids(grids)
    names = names_of(grids)
    # everything that has a name is found before a folder is made or a process started
    loaded = load_all(grids)
    names.check()
    physics(grids[0].timestep_s)
    arm = find_arm(names.arm)
    lock = environment_lock(names, loaded, arm.files)
    files = {loaded[source].name: source for source in loaded if not is_named(source)}
    salt = None if salt_file is None else salt_of_sweep(salt_file, out)
    limits = Limits(None if here else limit_s)
    run = run_record(
        described(grids, loaded), _content(lock, loaded, arm), code_files(), lock.versions, files, command, salt, limits
    )
    with listening() as check, RunFolder(Path(out), run) as store:
        work = _left(units(grids, loaded, salt), loaded, lock, store, check)
        with progress(sum(len(unit.trials) for unit in work)) as count:

            def emit(row: Row, timing: Timing) -> None:
                kept = row if here else row_within_limit(row, timing, limit_s)
                store.append(kept, timing)
                count(kept)

            execute: Executor = run_locally
            if backend == "ray":
                from apo_bench.sweeps.ray.backend import run_on_ray

                execute = partial(run_on_ray, address=address)
            execute(work, lock, workers=workers, limit_s=limit_s, emit=emit, check=check)
        return store.rows()


def names_of(grids: Sequence[SweepSettings]) -> Names:
    """What grids name; all have the same arm."""
    levels = grouped(
        (noise, max(level_pair(level))) for grid in grids for noise in grid.noises for level in grid.levels
    )
    return Names(
        arm=grids[0].arm,
        scenarios=tuple(dict.fromkeys(name for grid in grids for name in grid.scenarios)),
        methods=tuple(dict.fromkeys(name for grid in grids for name in grid.methods)),
        relations=tuple(dict.fromkeys(name for grid in grids for name in grid.relations)),
        noises={noise: max(highest) for noise, highest in levels.items()},
    )


def _left(
    work: Iterable[Unit], loaded: Mapping[str, Scenario], lock: EnvironmentLock, store: RunFolder, check: Check
) -> list[Unit]:
    """The trials that have no row yet; the rows that there are must be what those trials would give."""
    left = []
    hashes = {}
    for unit in work:
        check()
        row_hashes = {trial: store.finished.get(trial_key(trial, loaded[trial.scenario].name)) for trial in unit.trials}
        for trial, row_hash in row_hashes.items():
            cell = replace(trial, method=CORRECTOR, seed=0)
            if row_hash is not None and cell not in hashes:
                hashes[cell] = spec_hash(trial, lock.content[trial.scenario])
            require(
                row_hash is None or row_hash == hashes[cell],
                f"'{store.folder}' holds a row of {loaded[trial.scenario].name}, method {trial.method}, seed "
                f"{trial.seed}, that was made with other code or settings; choose another folder.",
            )
        left.append(Unit(tuple(trial for trial, row_hash in row_hashes.items() if row_hash is None)))
    return [unit for unit in left if unit.trials]


def _check_executor(workers: int | None, limit_s: float, backend: str, address: str | None) -> None:
    require(
        workers is None or 1 <= workers <= _LARGEST_WORKERS,
        f"{workers} workers were given; a whole number from 1 to {_LARGEST_WORKERS} is allowed.",
    )
    check_limit(limit_s)
    require_known("backend", backend, _BACKENDS)
    require(
        address is None or backend == "ray",
        f"the address '{address}' was given, but the backend {backend} has none; say --backend ray.",
    )
    if backend == "ray":
        from apo_bench.sweeps.ray.backend import check_ray

        check_ray(address)


def _content(lock: EnvironmentLock, loaded: Mapping[str, Scenario], arm: Arm) -> dict[str, str]:
    """What the trials are made of besides the package, piece by piece, so that a change can be named."""
    pieces = {
        f"{scenario.name}, {piece}": hashed
        for source, scenario in loaded.items()
        for piece, hashed in content_pieces(scenario, source, arm.files).items()
    }
    return {**pieces, **lock.hashes}


_SEVERAL = {info.axis: info for info in AXES}
"""Keys whose values are lists."""
_COUNTS = {"trials": (1, LARGEST_TRIALS), "seed": SETTINGS["seed"].range}
_ALONE = {SETTINGS[name].keyword: SETTINGS[name] for name in SHARED}
"""One for the whole sweep: they stand at the top of the file only."""
_MOST_ENTRIES = 1000
SWEEP_KEYS = (*_SEVERAL, *_COUNTS)


def is_sweep_file(text: str) -> bool:
    """Whether what was given in place of scenarios is a sweep file: TOML that is no scenario file.

    Raises:
        InputError: It is TOML that cannot be read.
    """
    if not text.lower().endswith(".toml"):
        return False
    keys = read_toml(text, "sweep or scenario file").value
    return "scenarios" in keys or not {"parts", "operations"} & set(keys)


def read_sweep(
    path: str | Path, overrides: Mapping[str, Any] | None = None, besides: Sequence[str] = ()
) -> tuple[SweepSettings, ...]:
    """The grids of a sweep file: the top one, and one for each `[[also]]`.

    Args:
        overrides: Key of the file -> what to take instead, in every grid.
        besides: Keys of the file that are read elsewhere.

    Raises:
        InputError: Anything in the file that is not as described.
    """
    top = read_toml(path, "sweep file").fields(("scenarios",), (*SWEEP_KEYS[1:], *_ALONE, *besides, "also"))
    tables = [entry.fields((), SWEEP_KEYS) for entry in _tables(top["also"])] if "also" in top else []
    first = {key: _value(key, node) for key, node in top.items() if key not in ("also", *besides)}
    grids = {str(path): first} | {
        f"{path}, also {i}": first | {key: _value(key, node) for key, node in table.items()}
        for i, table in enumerate(tables, start=1)
    }
    return tuple(_grid(name, {**values, **(overrides or {})}) for name, values in grids.items())


def _tables(node: JsonNode) -> Sequence[JsonNode]:
    require(
        isinstance(node.value, list) and all(isinstance(entry, dict) for entry in node.value),
        f"{node.file}, also: further grids are tables; write [[also]] above the keys of each.",
    )
    return _few(node.items("also"), node)


def _grid(name: str, values: Mapping[str, Any]) -> SweepSettings:
    try:
        return SweepSettings(**in_python(values))
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def _value(key: str, node: JsonNode) -> Any:
    if key in _COUNTS:
        return _count(node, *_COUNTS[key])
    if key in _ALONE:
        return node.text() if _ALONE[key].is_text else node.number(0.0, above=True)
    if _SEVERAL[key].is_text:
        return tuple(entry.text() for entry in _entries(node, key, "texts in quotes"))
    low, high = _SEVERAL[key].range
    if _SEVERAL[key].is_whole:
        return tuple(_count(entry, low, high) for entry in _entries(node, key, "whole numbers"))
    read = _level if key == LEVEL.axis else partial(JsonNode.number, low=low, high=high)
    return tuple(read(entry) for entry in _entries(node, key, "numbers"))


def _entries(node: JsonNode, key: str, of: str) -> Sequence[JsonNode]:
    if not isinstance(node.value, list) or not node.value:
        empty = "an empty grid has no trials, so name at least one or leave the key out"
        node.fail(f"a list of {of} is needed", empty if node.value == [] else f"write {key} = [...]")
    return _few(
        [JsonNode(entry, node.file, f"{node.key}, entry {i}") for i, entry in enumerate(node.value, start=1)], node
    )


def _few(entries: Sequence[JsonNode], node: JsonNode) -> Sequence[JsonNode]:
    require(
        len(entries) <= _MOST_ENTRIES,
        f"{node.file}, {node.key}: at most {_MOST_ENTRIES} entries are allowed, {len(entries)} were given.",
    )
    return entries


def _level(node: JsonNode) -> float | tuple[float, float]:
    """A number, or a pair of mm and degrees."""
    if not isinstance(node.value, list):
        return node.number(*LEVEL.range)
    mm, deg = map(float, node.numbers(2))
    return mm, deg


def _count(node: JsonNode, low: int, high: int) -> int:
    if not isinstance(node.value, int) or isinstance(node.value, bool) or not low <= node.value <= high:
        node.fail(f"a whole number from {low} to {high} is needed")
    return int(node.value)

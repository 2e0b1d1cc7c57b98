"""Many trials: spread over processes or machines, each row written as its trial ends, resumed where it was left."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from apo_bench.errors import require, require_known
from apo_bench.io import grouped
from apo_bench.records import CORRECTOR, CORRECTOR_LIMIT_S, Limits, Row, level_pair, salt_of_sweep, trial_key
from apo_bench.records.run.run_file import run_record
from apo_bench.records.run.run_folder import RunFolder
from apo_bench.scenario import Scenario, is_named
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.physics import physics
from apo_bench.sweeps.grid import SweepSettings, check_grids, described, load_all, units
from apo_bench.sweeps.local.pool import run_locally
from apo_bench.sweeps.progress import progress
from apo_bench.sweeps.work.dispatch import Executor, check_limit
from apo_bench.sweeps.work.environment_lock import Check, EnvironmentLock, Names, Unit, environment_lock, listening
from apo_bench.sweeps.work.worker import Timing, row_within_limit
from apo_bench.trial.fingerprint import code_files, content_pieces, spec_hash
from apo_bench.trial.kept_demonstrations import KeptDemonstrations

_LARGEST_WORKERS = 256
_BACKENDS = ("local", "ray")


def run_sweep(
    grids: SweepSettings | Sequence[SweepSettings],
    out: str | Path,
    *,
    workers: int | None = None,
    limit_s: float = 600.0,
    corrector_limit_s: float = CORRECTOR_LIMIT_S,
    backend: str = "local",
    address: str | None = None,
    command: str = "",
    salt_file: str | Path | None = None,
    cache: str | Path | None = None,
) -> list[Row]:
    """Run every trial of a sweep that has no row yet.

    The rows depend on neither the number of workers, nor where they run, nor the order in which trials end.

    Args:
        grids: One, or several whose trials are united.
        out: The folder of the rows; made if it is not there, continued if it holds rows of the same sweep.
        workers: Processes; they are spawned, so a script that calls this needs the usual
            `if __name__ == "__main__":`. None stands for this process with `local`: then no trial has a limit, but
            its corrector has. With `ray`, None stands for all that the cluster has.
        limit_s: Wall time that a trial may take in a worker; what takes longer is a failed row.
        corrector_limit_s: Of that, what a corrector named as `module:name` may take.
        backend: `local`, or `ray` for a cluster.
        address: Of a cluster that runs already.
        command: What to note in `run.json` as the command line.
        salt_file: Holds the salt of the trials, and is made if it is not there; None for trials that everybody can
            draw.
        cache: A folder where demonstrations are kept for other sweeps, made if it is not there. The rows are the same
            with and without it.

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
    names.check(corrector_limit_s)
    physics(grids[0].timestep_s)
    arm = find_arm(names.arm)
    # the whole path of the folder of demonstrations, as every worker finds it
    cache = None if cache is None else str(KeptDemonstrations(cache).folder.resolve())
    lock = replace(environment_lock(names, loaded, arm.files, corrector_limit_s), cache=cache)
    files = {loaded[source].name: source for source in loaded if not is_named(source)}
    salt = None if salt_file is None else salt_of_sweep(salt_file, out)
    limits = Limits(None if here else limit_s, corrector_limit_s)
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

"""Run sweeps, and continue interrupted ones."""

import multiprocessing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.sweeps.grid import Batch, SweepConfig, check_grids, describe_grids, list_work_units, load_all
from apo_bench.benchmark.sweeps.pool import check_limit, run_locally
from apo_bench.benchmark.sweeps.progress import show_progress
from apo_bench.benchmark.sweeps.stop_signals import stop_at_signals
from apo_bench.benchmark.sweeps.worker import SweepInputs, Timing, Worker
from apo_bench.correction.correctors import resolve_corrector
from apo_bench.errors import require, require_known
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.wrong_contacts import make_contacts
from apo_bench.records import (
    CORRECTOR,
    DETECTED,
    WITHOUT_CORRECTOR,
    Limits,
    TrialConfig,
    TrialRecord,
    make_trial_key,
    open_secret_seed,
    parse_method,
    parse_noise_level,
    resolve_simulated,
)
from apo_bench.records.run.run_file import make_run_record
from apo_bench.records.run.run_folder import RunFolder, read_records
from apo_bench.scenario import Scenario, is_named
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.physics import physics
from apo_bench.trial.fingerprint import compute_config_hash, compute_content_hash, find_git_revision, list_versions
from apo_bench.trial.input_files import hash_input_files, hash_noise_files, hash_user_code

_LARGEST_WORKERS = 256
_BACKENDS = ("local", "ray")
BATCH = 8
"""Most trials in a batch, which takes a worker some seconds."""


@check_arguments
def run_sweep(
    grids: SweepConfig | Sequence[SweepConfig],
    out: str | Path,
    *,
    workers: int | None = None,
    limit_s: float = 600.0,
    backend: str = "local",
    address: str | None = None,
    command: str = "",
    secret_seed_file: str | Path | None = None,
) -> list[TrialRecord]:
    """Run every trial of a sweep that has no record yet.

    The records depend on neither the number of workers, nor where they run, nor the order in which trials end.

    Args:
        grids: One grid, or several whose trials are united.
        out: The folder of the records; made if it does not exist, continued if it holds records of the same sweep.
        workers: Processes; they are spawned, so a script that calls this needs the usual
            `if __name__ == "__main__":`. None: with `local` this process, without a limit for trials; with `ray` all
            workers of the cluster.
        limit_s: Wall time of a trial in a worker; one that takes longer gets a failed record.
        backend: `local`, or `ray` for a cluster.
        address: Address of a running cluster, as in `check_ray`.
        command: The command line, for `run.json`.
        secret_seed_file: File of the secret seed, made if it does not exist; None for trials that anyone can draw.

    Returns:
        All records of the folder, in the order in which they were written.

    Raises:
        InputError: A setting is not allowed, or the folder has trials of another sweep.
        RuntimeError: A trial could not be run, or a record could not be written.
        KeyboardInterrupt: After Ctrl-C or a signal; records of finished batches are kept.

    Examples:
        >>> import apo_bench, tempfile
        >>> grid = apo_bench.SweepConfig(
        ...     "block_on_block",
        ...     noise_level=1,
        ...     human_error_scale=0,
        ...     method="contact",
        ...     trials=1,
        ...     fidelity="near-contact",
        ... )
        >>> [record["success"] for record in apo_bench.run_sweep(grid, tempfile.mkdtemp())]
        [True]
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):  # as multiprocessing asks itself
        raise SystemExit(1)  # a worker imports a script without `if __name__ == "__main__":`; the first process says so
    grids = (grids,) if isinstance(grids, SweepConfig) else tuple(grids)
    _check_executor(workers, limit_s, backend, address)
    check_grids(grids)
    # check every name and file before a folder is made or a process is started
    loaded = load_all(grids)
    _check_names(grids)
    physics(grids[0].timestep_s)  # raises if the time step is not allowed
    arm_name = grids[0].arm
    arm = find_arm(arm_name)
    content = {source: compute_content_hash(scenario, source, arm.files) for source, scenario in loaded.items()}
    inputs = SweepInputs(content, list_versions())
    secret_seed = None if secret_seed_file is None else open_secret_seed(secret_seed_file, out)
    here = workers is None and backend == "local"  # in this process
    run = make_run_record(
        describe_grids(grids, loaded),
        _hash_content(grids, loaded, arm.files),
        inputs.versions,
        {loaded[source].name: source for source in loaded if not is_named(source)},
        command,
        secret_seed,
        Limits(None if here else limit_s),
        find_git_revision(),
    )
    with stop_at_signals(), RunFolder(Path(out), run) as store:
        batches = list(_list_remaining_batches(list_work_units(grids, loaded, secret_seed), loaded, inputs, store))
        with show_progress(sum(map(len, batches))) as count:

            def emit(record: TrialRecord, timing: Timing) -> None:
                store.append(record, timing)
                count()

            if here:
                worker = Worker(inputs, {"worker": 0})
                for batch in batches:
                    for ended in worker.run(batch):
                        emit(*ended)
            elif backend == "local":
                run_locally(batches, inputs, workers or 1, limit_s, emit)
            else:
                from apo_bench.benchmark.sweeps.cluster import run_on_cluster
                from apo_bench.benchmark.sweeps.user_files import list_user_files_for_nodes

                names = (
                    *_list_names(grids, "method"),
                    *_list_names(grids, "noise"),
                    *_list_names(grids, "contact_source"),
                    arm_name,
                )
                files = list_user_files_for_nodes(loaded, arm.files, names)
                run_on_cluster(batches, inputs, workers, limit_s, emit, address, files)
        return read_records(out)


def _list_remaining_batches(
    work: Iterable[Batch], loaded: Mapping[str, Scenario], inputs: SweepInputs, store: RunFolder
) -> Iterator[Batch]:
    """Yield batches of the trials without a record.

    Raises:
        InputError: An existing record was made with other files, versions or settings.
    """
    hashes: dict[TrialConfig, str] = {}
    for unit in work:
        left = []
        for trial in unit:
            found = store.finished.get(make_trial_key(trial, loaded[trial.scenario].name))
            cell = replace(trial, method=CORRECTOR, seed=0)  # the hash depends on neither
            if found is None:
                left.append(trial)
            elif cell not in hashes:
                hashes[cell] = compute_config_hash(trial, inputs.content[trial.scenario])
            require(
                found is None or found == hashes[cell],
                f"'{store.folder}' holds a record of {loaded[trial.scenario].name}, method {trial.method}, seed "
                f"{trial.seed}, that was made with other files, versions or settings; choose another folder.",
            )
        for first in range(0, len(left), BATCH):
            yield tuple(left[first : first + BATCH])


def _check_executor(workers: int | None, limit_s: float, backend: str, address: str | None) -> None:
    """Raise an `InputError` unless these workers and this backend can run a sweep."""
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
        from apo_bench.benchmark.sweeps.cluster import check_ray

        check_ray(address)


def _check_names(grids: Sequence[SweepConfig]) -> None:
    """Raise an `InputError` unless noise models, contact sources and correctors can be imported here."""
    for grid in grids:
        # a model must allow the highest level
        highest = max(max(parse_noise_level(noise_level)) for noise_level in grid.noise_level)
        for noise in grid.noise:
            make_noise(noise, NoiseLevel(highest, highest))
        for contact_source in grid.contact_source:
            if contact_source not in DETECTED:
                make_contacts(contact_source)
        for method in grid.method:
            corrector = parse_method(method).corrector
            if corrector not in WITHOUT_CORRECTOR:
                resolve_corrector(resolve_simulated(corrector))


def _list_names(grids: Sequence[SweepConfig], axis: str) -> tuple[str, ...]:
    """Return the values of all grids for a setting, each once."""
    return tuple(dict.fromkeys(name for grid in grids for name in getattr(grid, axis)))


def _hash_content(
    grids: Sequence[SweepConfig], loaded: Mapping[str, Scenario], arm_files: tuple[Path, ...]
) -> dict[str, str]:
    """Return input -> hash for each file and plugin of the trials, so that a message can name what changed."""
    pieces = {
        f"{scenario.name}, {piece}": hashed
        for source, scenario in loaded.items()
        for piece, hashed in hash_input_files(scenario, source, arm_files).items()
    }
    return {
        **pieces,
        **hash_noise_files(*_list_names(grids, "noise")),
        **hash_user_code("contact_source", *_list_names(grids, "contact_source")),
        **hash_user_code("method", *_list_names(grids, "method")),
        **hash_user_code("arm", grids[0].arm),
    }

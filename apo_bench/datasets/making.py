"""What `apo-bench dataset make` makes: trials, in one of three formats."""

from collections.abc import Callable, Sequence
from pathlib import Path

from apo_bench.datasets.episodes import about_replays, replay_rollouts, replays, write_parquet
from apo_bench.datasets.insertions import insertions
from apo_bench.datasets.lerobot import write_lerobot
from apo_bench.datasets.minari import write_minari
from apo_bench.errors import require, require_known
from apo_bench.records import TrialSettings
from apo_bench.trial.stages import scene_of

_WRITERS = {"lerobot": write_lerobot, "minari": write_minari}
FORMATS = ("parquet", *_WRITERS)


def make_dataset(
    trials: Sequence[TrialSettings],
    out: Path,
    command: str,
    form: str = "parquet",
    policy: str | None = None,
    say: Callable[[str], None] = print,
) -> tuple[int, int]:
    """Run trials and write them, with a card `README.md` and `croissant.json`.

    The same trials give the same bytes on one machine.

    Args:
        trials: At least one.
        out: A folder that is not there yet, or is empty.
        command: What the card says it was made by.
        form: One of `FORMATS`.
        policy: Insertions by this policy; None: replays.
        say: Is told in a sentence of each trial that makes no episode.

    Returns:
        How many episodes there are, and how many of them are right.

    Raises:
        InputError: The folder holds something, a trial cannot be run, or a package is missing.
        OSError: Something cannot be written.
    """
    require_known("format", form, FORMATS)
    require(
        not out.exists() or (out.is_dir() and not any(out.iterdir())),
        f"'{out}' is there already and not an empty folder; name another.",
    )
    require(
        form in _WRITERS or policy is None,
        "insertions were asked for as parquet; lerobot and minari are allowed for them.",
    )
    if policy is not None:
        about, rollouts = insertions(trials, policy, command, say)
        return _WRITERS[form](rollouts, about, out)
    scenes = {each.scenario: scene_of(each) for each in trials}
    about = about_replays([*scenes.values()], command, trials[0].arm)
    found = replays(trials, scenes)
    if form == "parquet":
        return write_parquet(found, about, out)
    return _WRITERS[form](replay_rollouts(found, about, say), about, out)

"""Something to be looked at, in MuJoCo's window where there is a display, else in a browser; also a finished trial of a
sweep, which is run again for it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

from apo_bench.errors import InputError, require
from apo_bench.io import each_line
from apo_bench.records import Row, read_salt, settings_of
from apo_bench.records.run.replay_command import own_code
from apo_bench.records.run.run_file import read_run, scenario_files
from apo_bench.records.run.validation import row_of
from apo_bench.show.browser import PORT, no_browser, serve_story
from apo_bench.show.stepping import Cursor
from apo_bench.simulation.film.still import FilmTrack
from apo_bench.simulation.film.window import no_window, step_in_window
from apo_bench.trial.fingerprint import content_hash, spec_hash
from apo_bench.trial.stages import observe_demonstration, scene_of, simulate_demonstration
from apo_bench.trial.story import Story, trial_story
from apo_bench.trial.trial import noise_of, run_trial

Display = Literal["window", "browser"]


def choose_display(port: int | None) -> Display:
    """Where it can be shown; asked before anything is run.

    Args:
        port: A person who names one wants a browser.

    Raises:
        InputError: Neither is possible.
    """
    require(port is None or 1 <= port <= 65535, f"--port {port} was given; a whole number from 1 to 65535 is allowed.")
    if port is None and not no_window():
        return "window"
    missing = no_browser()
    if missing and port is not None:
        raise InputError(f"--port {port} was given, which is for a browser, but {missing}.")
    if missing:
        raise InputError(
            f"{no_window()}, and for a browser {missing}. `apo-bench replay .. --video FILE.mp4` "
            "and `apo-bench show` need neither."
        )
    return "browser"


def view(story: Story, display: Display, port: int | None, say: Callable[[str], None]) -> None:
    """Show it until a person closes the window, or Ctrl-C."""
    try:
        if display == "browser":
            serve_story(story, PORT if port is None else port, say)
        else:
            cursor = Cursor(story)
            step_in_window(story.scene, story.assembled, cursor.still, cursor.press, cursor.pass_time)
    except KeyboardInterrupt:
        say("")


def trial_again(folder: Path, number: int | None, salt_file: Path | None = None) -> tuple[Row, Story]:
    """A trial of a sweep and its row.

    Args:
        number: Of its line in `trials.jsonl`, from 1; None: the first failure, or the first trial.
        salt_file: Of a salted sweep.

    Raises:
        InputError: No such trial.
        RuntimeError: It cannot be run again, or had nothing to see.
    """
    number, row = _chosen(folder, number)
    if named := own_code(row):
        raise RuntimeError(
            f"trial {number} names code that does not come with the package ({', '.join(named)}), which no file makes "
            "run; give it to `apo-bench replay .. --view` yourself."
        )
    name = row["scenario"]
    salt = None if salt_file is None else read_salt(salt_file)
    spec = replace(settings_of(row, scenario_files(read_run(folder)).get(name, name)), salt=salt)
    scene = scene_of(spec)
    content = content_hash(scene.scenario, spec.scenario, scene.arm.files)
    if spec_hash(spec, content) != row["spec_hash"]:
        secret = row["salt"] is not None and salt is None
        why = "its salt was not given; name its file by --salt-file" if secret else "other code or assets made it"
        raise RuntimeError(f"trial {number} of {folder} cannot be run again: {why}.")
    simulated = simulate_demonstration(scene, spec.careless, spec.seed, spec.eye, spec.salt)
    track = FilmTrack()
    again = run_trial(spec, scene, simulated=simulated, content=content, watch=track.hooks)
    if again["sim_seconds"] is None:
        raise RuntimeError(f"in trial {number} nothing was replayed: {again['sentence']}.")
    seen = observe_demonstration(simulated, noise_of(spec, scene, simulated), spec.seed, spec.salt)
    return again, trial_story(spec, scene, seen, track, again, simulated)


def _chosen(folder: Path, number: int | None) -> tuple[int, Row]:
    path = folder / "trials.jsonl"
    first = None
    k = 0
    for k, line in each_line(path, "table of trials"):
        if number in (None, k):
            row = row_of(line, f"{path}, line {k}")
            if number is not None or (row["success"] is False and row["sim_seconds"] is not None):
                return k, row
            first = first or (k, row)
    if first is None:
        wanted = "there is no trial" if number is None else f"--trial {number} was given; 1 to {k} are there"
        raise InputError(f"{path}: {wanted}.")
    return first

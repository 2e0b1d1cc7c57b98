"""A story to be looked at: in MuJoCo's window where there is a display, else in a browser."""

from collections.abc import Callable
from typing import Literal

from apo_bench.errors import InputError, require
from apo_bench.simulation.film.window import no_window, step_in_window
from apo_bench.trial.rollout import Rollout
from apo_bench.viz.browser import PORT, no_browser, serve_story
from apo_bench.viz.stepping import Cursor

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
    require(not missing or port is None, f"--port {port} was given, which is for a browser, but {missing}.")
    if missing:
        raise InputError(
            f"{no_window()}, and for a browser {missing}. `apo-bench run .. --video FILE.mp4` "
            "and `apo-bench inspect poses` need neither."
        )
    return "browser"


def view(rollout: Rollout, display: Display, port: int | None, say: Callable[[str], None]) -> None:
    """Show it until a person closes the window, or Ctrl-C."""
    try:
        if display == "browser":
            serve_story(rollout, PORT if port is None else port, say)
        else:
            cursor = Cursor(rollout)
            step_in_window(rollout.scene, rollout.assembled, cursor.snapshot, cursor.press, cursor.pass_time)
    except KeyboardInterrupt:
        say("")

"""Choose between MuJoCo's window and a browser to step through a rollout."""

from collections.abc import Callable
from typing import Literal

from apo_bench.errors import InputError, require
from apo_bench.simulation.film.window import no_window, step_in_window
from apo_bench.trial.rollout import Rollout
from apo_bench.viz.browser import PORT, explain_missing_browser, serve_rollout
from apo_bench.viz.rollout_cursor import start_at_end

Display = Literal["window", "browser"]


def choose_display(port: int | None) -> Display:
    """Choose where a rollout is shown; commands call this before they run anything.

    Args:
        port: Port of the browser page; None prefers a window.

    Raises:
        InputError: Neither a window nor a browser can show it.
    """
    require(port is None or 1 <= port <= 65535, f"--port must be from 1 to 65535, got {port}.")
    if port is None and not no_window():
        return "window"
    missing = explain_missing_browser()
    require(not missing or port is None, f"--port {port} needs a browser, but {missing}.")
    if missing:
        raise InputError(
            f"{no_window()}, and for a browser {missing}. `apo-bench run .. --video FILE.mp4` and "
            "`apo-bench inspect poses` need neither."
        )
    return "browser"


def view(rollout: Rollout, display: Display, port: int | None, say: Callable[[str], None]) -> None:
    """Show a rollout until the user closes the window, or presses Ctrl-C.

    Args:
        port: Port of the browser page; None for the default.
        say: Prints a sentence.
    """
    try:
        if display == "browser":
            serve_rollout(rollout, PORT if port is None else port, say)
        else:
            cursor = start_at_end(rollout)
            step_in_window(rollout.scene, rollout.assembled, cursor.snapshot, cursor.press, cursor.pass_time)
    except KeyboardInterrupt:
        say("")

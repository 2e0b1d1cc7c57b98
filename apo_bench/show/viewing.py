"""Something to be looked at, in MuJoCo's window where there is a display, else in a browser."""

from collections.abc import Callable
from typing import Literal

from apo_bench.errors import InputError
from apo_bench.show.browser import PORT, no_browser, serve_story
from apo_bench.show.stepping import Cursor
from apo_bench.simulation.film.window import no_window, step_in_window
from apo_bench.trial.story import Story

Viewer = Literal["window", "browser"]


def choose_viewer(port: int | None) -> Viewer:
    """Where it can be shown; asked before anything is run.

    Args:
        port: A person who names one wants a browser.

    Raises:
        InputError: Neither is possible.
    """
    if port is not None and not 1 <= port <= 65535:
        raise InputError(f"--port {port} was given; a whole number from 1 to 65535 is allowed.")
    missing = "" if port is None else no_browser()
    if missing:
        raise InputError(f"--port {port} was given, which is for a browser, but {missing}.")
    if port is not None or no_window():
        missing = no_browser()
        if missing:
            raise InputError(
                f"{no_window()}, and for a browser {missing}. `apo-bench replay .. --video FILE.mp4` "
                "and `apo-bench show` need neither."
            )
        return "browser"
    return "window"


def view(story: Story, viewer: Viewer, port: int | None, say: Callable[[str], None]) -> None:
    """Show it until a person closes the window, or Ctrl-C."""
    try:
        if viewer == "browser":
            serve_story(story, PORT if port is None else port, say)
        else:
            cursor = Cursor(story)
            step_in_window(story.scene, story.assembled, cursor.still, cursor.press, cursor.pass_time)
    except KeyboardInterrupt:
        say("")

"""Step through a trial with keys in MuJoCo's window."""

import sys
import time
from collections.abc import Callable
from typing import Any

import mujoco

from apo_bench.assembly import Poses
from apo_bench.errors import InputError
from apo_bench.simulation.film.film import FILM_AZIMUTH_DEG, FILM_ELEVATION_DEG
from apo_bench.simulation.film.framing import frame_parts
from apo_bench.simulation.film.overlay import FilmSnapshot, draw_over
from apo_bench.simulation.film.track import show_moment
from apo_bench.simulation.graphics import need_window
from apo_bench.simulation.scene import Scene, make_initial_state

WINDOW_KEYS = {
    32: "play",
    262: "next",
    263: "previous",
    264: "next operation",
    265: "previous operation",
    267: "next segment",
    266: "previous segment",
    268: "faces",
    269: "goals",
}
"""GLFW code of a key -> its meaning; letters and digits are used by MuJoCo's window already."""
# Help text in the window: keys, and their meanings line by line.
_KEYS = "space\nleft, right\nup, down\npage up, page down\nhome\nend"
_MEANINGS = "play, stop\na moment\nan operation\ndemonstration, replay\nnames of faces\ngoals"
PICTURE_S = 1.0 / 30.0  # pause between pictures


def no_window() -> str:
    """The reason why no window can be opened here; empty if one can."""
    try:
        need_window()
    except InputError as error:
        return str(error).partition(";")[0]
    import mujoco.viewer

    if sys.platform == "darwin" and getattr(mujoco.viewer, "_MJPYTHON", None) is None:
        return "no window can be opened here (on macOS that needs `mjpython`)"
    return ""


def step_in_window(
    scene: Scene,
    assembled: Poses,
    now: Callable[[], FilmSnapshot],
    press: Callable[[str], None],
    pass_time: Callable[[float], None],
) -> None:
    """Open the window and show snapshots until it is closed.

    Args:
        assembled: Final poses of the parts, for the framing of the camera.
        now: Returns the snapshot to show.
        press: Called with the meaning of a pressed key, one of the values of `WINDOW_KEYS`.
        pass_time: Called with the seconds that have passed.
    """
    import mujoco.viewer

    data = make_initial_state(scene.work, now().segment.start)
    pressed: list[str] = []

    def on_key(code: int) -> None:
        pressed.extend(filter(None, (WINDOW_KEYS.get(code),)))

    with mujoco.viewer.launch_passive(
        scene.work.model, data, key_callback=on_key, show_left_ui=False, show_right_ui=False
    ) as window:
        with window.lock():
            window.cam.lookat[:], window.cam.distance = frame_parts(scene.scenario.assembly, [assembled])
            window.cam.azimuth = FILM_AZIMUTH_DEG
            window.cam.elevation = FILM_ELEVATION_DEG
        before = time.monotonic()
        while window.is_running():
            while pressed:
                press(pressed.pop(0))
            with window.lock():
                _draw(scene, data, now(), window)
            window.sync()
            time.sleep(PICTURE_S)
            now_s = time.monotonic()
            pass_time(now_s - before)
            before = now_s


def _draw(scene: Scene, data: Any, snapshot: FilmSnapshot, window: Any) -> None:
    """Show a snapshot with its overlays and texts."""
    show_moment(scene, data, snapshot.segment, snapshot.moment)
    window.user_scn.ngeom = 0
    draw_over(scene, snapshot, window.user_scn)
    font = mujoco.mjtFontScale.mjFONTSCALE_150
    place = mujoco.mjtGridPos
    words = "\n".join((snapshot.segment.title, *snapshot.words))
    window.set_texts([(font, place.mjGRID_TOPLEFT, words, ""), (font, place.mjGRID_BOTTOMLEFT, _KEYS, _MEANINGS)])

"""Serve a rollout to a browser by viser, with a slider and buttons; only this machine can connect."""

import io
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import redirect_stdout
from importlib.util import find_spec
from typing import Any

import numpy as np

from apo_bench.errors import InputError
from apo_bench.simulation.film.film import FILM_AZIMUTH_DEG, FILM_ELEVATION_DEG
from apo_bench.simulation.film.framing import frame_parts
from apo_bench.simulation.film.shapes import ShapeKind, shapes_of, surface
from apo_bench.simulation.film.window import PICTURE_S
from apo_bench.simulation.scene import make_initial_state
from apo_bench.trial.rollout import Rollout
from apo_bench.viz.rollout_cursor import start_at_end

HOST = "127.0.0.1"
PORT = 8080
_FOV_RAD = np.radians(45.0)  # as in films
# the camera aims this share of its distance to the right of the assembly, since the panel hides the right side
_BESIDE_PANEL = 0.12
_NEARER = 0.8  # distance of the camera over that in films, which also show the gripper above the assembly
_BUTTONS = (
    {"play / stop": "play", "moment back": "previous", "moment on": "next"},
    {"operation back": "previous operation", "operation on": "next operation"},
    {"demonstration": "previous segment", "replay": "next segment"},
    {"names of faces": "faces", "target poses": "goals"},
)
"""One dictionary per group of buttons: label -> key of `Cursor.press`."""


def explain_missing_browser() -> str:
    """Return why no browser can be used; empty if one can."""
    if find_spec("viser") is None:
        return 'viser is not installed; install it with: pip install "apo_bench[view]"'
    return ""


def serve_rollout(rollout: Rollout, port: int, say: Callable[[str], None]) -> None:
    """Serve a rollout until Ctrl-C.

    Args:
        port: TCP port on this machine.
        say: Called once with a sentence that states the address.

    Raises:
        InputError: The port is taken or not allowed.
    """
    page = Page(rollout, port)
    try:
        say(f"Open {page.address} in a browser on this machine; Ctrl-C ends it.")
        before = time.monotonic()
        while True:
            page.draw()
            time.sleep(PICTURE_S)
            now = time.monotonic()
            page.cursor.pass_time(now - before)
            before = now
    finally:
        page.close()


class Page:
    """The page that browsers show; all browsers share one position in the rollout."""

    def __init__(self, rollout: Rollout, port: int) -> None:
        self.cursor = start_at_end(rollout)
        self._requests = deque[str | int]()  # keys to press, or numbers of moments to go to
        self._data = make_initial_state(rollout.scene.work, rollout.segments[0].start)
        self._server = _start_server(port)
        self._drawn: object = None  # the state that the page shows now
        self._shown: dict[tuple[ShapeKind, int], Any] = {}
        self.address = f"http://{HOST}:{self._server.get_port()}"
        self._aim_camera(rollout)
        self._add_controls()

    def close(self) -> None:
        with redirect_stdout(io.StringIO()):
            self._server.stop()

    def draw(self) -> None:
        """Process the requests of the browser, and update the page if anything changed."""
        while self._requests:
            request = self._requests.popleft()
            if isinstance(request, str):
                self.cursor.press(request)
            elif not self.cursor.playing:  # while playing, the slider is moved by the page itself
                self.cursor.go(request)
        state = (self.cursor.place, self.cursor.faces, self.cursor.shows_goals)
        if state == self._drawn:
            return
        snapshot = self.cursor.snapshot()
        count = Counter[ShapeKind]()
        with self._server.atomic():
            for kind, at in shapes_of(self.cursor.rollout.scene, self._data, snapshot):
                handle = self._get_handle(kind, count[kind])
                count[kind] += 1
                # viser orders position and quaternion as (x, y, z), (w, x, y, z)
                if not np.array_equal(at, (*handle.position, *handle.wxyz)):
                    handle.position = at[:3]
                    handle.wxyz = at[3:]
            # hide the shapes that this moment does not have
            for (kind, number), handle in self._shown.items():
                if handle.visible != (number < count[kind]):
                    handle.visible = number < count[kind]
            self._words.content = "\n\n".join((f"**{snapshot.segment.title}**", *snapshot.words))
            self._slider.value = state[0]
        self._drawn = state

    def _get_handle(self, kind: ShapeKind, number: int) -> Any:
        """Return the viser object of the shape of this kind with this number; make it when it first appears."""
        if (kind, number) not in self._shown:
            name = f"/{len(self._shown)}"
            if kind.label:
                handle = self._server.scene.add_label(name, kind.label, anchor="center-center")
            else:
                mesh = surface(self.cursor.rollout.scene.work.model, kind)
                handle = self._server.scene.add_mesh_simple(
                    name,
                    mesh.vertices.astype(np.float32),
                    mesh.faces.astype(np.uint32),
                    color=kind.rgba[:3],
                    opacity=None if kind.rgba[3] == 1.0 else kind.rgba[3],
                    flat_shading=True,
                )
            self._shown[kind, number] = handle
        return self._shown[kind, number]

    def _aim_camera(self, rollout: Rollout) -> None:
        """Aim the initial camera as in films, but nearer, and with the assembly left of the panel."""
        self._server.scene.set_up_direction("+z")
        self._server.scene.configure_default_lights(cast_shadow=False)
        at, far = frame_parts(rollout.scene.scenario.assembly, [rollout.assembled])
        azimuth, elevation = np.radians([FILM_AZIMUTH_DEG, FILM_ELEVATION_DEG])
        # unit vectors: where the camera looks, and to its right
        ahead = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        view = self._server.initial_camera
        view.look_at = at + _BESIDE_PANEL * far * right
        view.position = view.look_at - _NEARER * far * ahead
        view.fov = _FOV_RAD

    def _add_controls(self) -> None:
        """Add text, slider and buttons; their events are requests that `draw` processes."""
        gui = self._server.gui
        gui.configure_theme(show_share_button=False, show_logo=False, control_width="large")
        gui.set_panel_label("apo-bench view")
        self._words = gui.add_markdown("")
        self._slider = gui.add_slider("moment", 0, len(self.cursor.places) - 1, 1, 0)
        self._slider.on_update(lambda event: self._requests.append(int(event.target.value)))
        for keys in _BUTTONS:
            group = gui.add_button_group("", tuple(keys))
            group.on_click(lambda event, keys=keys: self._requests.append(keys[event.target.value]))


def _start_server(port: int) -> Any:
    """Start the viser server of a page at a port of this machine."""
    import viser

    try:
        with redirect_stdout(io.StringIO()):  # viser prints its address in a box
            return viser.ViserServer(host=HOST, port=port, label="apo-bench view", verbose=False)
    except OSError as error:
        raise InputError(f"--port {port} cannot be served ({error.strerror or error}); choose another one.") from error

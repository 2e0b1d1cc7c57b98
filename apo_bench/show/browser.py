"""A trial in a browser, by viser: stepped through with a slider and buttons; served on this machine only."""

import io
import threading
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from typing import Any

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.show.stepping import COLOR_NAMES, COLORS, FACES, Cursor
from apo_bench.simulation.film.film import FILM_AZIMUTH_DEG, FILM_ELEVATION_DEG, framing
from apo_bench.simulation.film.still import (
    GHOST_OPACITY,
    HAND_COLOR,
    HAND_M,
    BodyMesh,
    Ghost,
    body_meshes,
    body_poses,
    label_place,
    part_meshes,
    show_moment,
)
from apo_bench.simulation.scene import initial_state
from apo_bench.trial.story import Story

HOST = "127.0.0.1"
PORT = 8080
_PICTURE_S = 1.0 / 30.0
_FOV_RAD = np.radians(45.0)
"""As in films."""
_GHOST_SCALE = 1.004
"""A little larger than the part itself, whose surfaces would flicker through."""
_BUTTONS = {"play / stop": "play", "moment back": "previous", "moment on": "next"}
_JUMPS = {"operation back": "previous operation", "operation on": "next operation"}


def no_browser() -> str:
    """Why nothing can be shown in a browser, empty where it can."""
    try:
        import viser  # noqa: F401
    except ImportError:
        return 'viser is not installed; install it with: pip install "apo_bench[view]"'
    return ""


def serve_story(story: Story, port: int, say: Callable[[str], None], ends: Callable[[], bool] = lambda: False) -> None:
    """Serve a story until `ends` says so, or Ctrl-C.

    Args:
        say: Told where it is to be seen.

    Raises:
        InputError: The port is taken or not allowed.
    """
    page = Page(story, port)
    try:
        say(f"Open {page.address} in a browser on this machine; Ctrl-C ends it.")
        before = time.monotonic()
        while not ends():
            page.draw()
            time.sleep(_PICTURE_S)
            now = time.monotonic()
            with page.lock:
                page.cursor.pass_time(now - before)
            before = now
    finally:
        page.close()


class Page:
    """What one browser, or several, see: they share one place in the story."""

    def __init__(self, story: Story, port: int) -> None:
        self.cursor = Cursor(story)
        self.lock = threading.Lock()
        self._scene = story.scene
        self._data = initial_state(story.scene.work, story.chapters[0].start)
        self._server = _server(port)
        self._drawn = ""
        self.address = f"http://{HOST}:{self._server.get_port()}"
        self._set_up(story)

    def close(self) -> None:
        with redirect_stdout(io.StringIO()):
            self._server.stop()

    def draw(self) -> None:
        """Bring the page up to date, if anything has changed."""
        with self.lock:
            still = self.cursor.still()
            chapter = self.cursor.chapter
            moment = self.cursor.moment
            state = repr((chapter, moment, self.cursor.faces, sorted(self.cursor.goals), self._arm_shown.value))
        if state == self._drawn:
            return
        show_moment(self._scene, self._data, still.chapter, still.moment)
        with self._server.atomic():
            for body, at in zip(self._bodies, body_poses(self._data), strict=True):
                body.position = at[:3]
                body.wxyz = at[3:]
            for mesh in self._arm:
                mesh.visible = self._arm_shown.value and not len(still.moment.hands)
            for i, hand in enumerate(self._hands):
                hand.visible = i < len(still.moment.hands)
                if hand.visible:
                    hand.position = still.moment.hands[i]
            for face, label in self._labels.items():
                label.visible = face in still.faces
            self._draw_ghosts(still.ghosts)
            self._words.content = "\n\n".join((f"**{still.chapter.title}**", *still.words))
            for i, slider in enumerate(self._sliders):
                slider.visible = i == chapter
            self._sliders[chapter].value = moment
        self._drawn = state

    def _draw_ghosts(self, ghosts: tuple[Ghost, ...]) -> None:
        placed = {(ghost.name, part): pose.pack(T) for ghost in ghosts for part, T in ghost.poses.items()}
        for key, mesh in ((key, mesh) for key, meshes in self._ghosts.items() for mesh in meshes):
            mesh.visible = key in placed
            if mesh.visible:
                mesh.position = placed[key][:3]
                mesh.wxyz = placed[key][3:]

    def _set_up(self, story: Story) -> None:
        server = self._server
        world = story.scene.work
        server.gui.configure_theme(show_share_button=False, show_logo=False, control_width="large")
        server.gui.set_panel_label("apo-bench view")
        server.scene.set_up_direction("+z")
        server.scene.configure_default_lights(cast_shadow=False)
        look_at, far = framing(story.scene.scenario.assembly, [story.assembled])
        azimuth, elevation = np.radians([FILM_AZIMUTH_DEG, FILM_ELEVATION_DEG])
        # where the camera looks, as a unit vector
        forwards = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        view = server.initial_camera
        view.look_at = look_at
        view.position = look_at - far * np.array(forwards)
        view.fov = _FOV_RAD
        self._bodies = [server.scene.add_frame(f"/bodies/{i}", show_axes=False) for i in range(world.model.nbody)]
        meshes = [
            (shape.part, _add(server, f"/bodies/{shape.body}/{i}", shape, shape.rgba[:3], shape.rgba[3]))
            for i, shape in enumerate(body_meshes(world))
        ]
        self._arm = [mesh for part, mesh in meshes if part is None]
        self._hands = [
            server.scene.add_icosphere(f"/hands/{i}", HAND_M, tuple(int(255 * c) for c in HAND_COLOR), visible=False)
            for i in range(2)
        ]
        self._ghosts = {
            (name, part): [
                _add(server, f"/goals/{name}/{part}/{i}", shape, COLORS[name], GHOST_OPACITY, _GHOST_SCALE)
                for i, shape in enumerate(part_meshes(world, part))
            ]
            for name in story.goals
            for part in world.free
        }
        self._labels = {
            face: server.scene.add_label(
                f"/bodies/{world.body[face.part]}/{face.face}",
                str(face),
                position=label_place(story.scene, face),
                anchor="center-center",
                visible=False,
            )
            for face in Cursor(story, faces="all").still().faces
        }
        self._add_controls(story)

    def _add_controls(self, story: Story) -> None:
        gui = self._server.gui
        self._words = gui.add_markdown("")
        if len(story.chapters) > 1:
            titles = [chapter.title for chapter in story.chapters]
            chosen = gui.add_dropdown("show", titles, initial_value=titles[0])
            chosen.on_update(lambda _: self._choose(titles.index(chosen.value)))
        self._sliders = [
            gui.add_slider("moment", 0, len(chapter.moments) - 1, 1, 0, visible=i == 0)
            for i, chapter in enumerate(story.chapters)
        ]
        for i, slider in enumerate(self._sliders):
            slider.on_update(lambda event, i=i: self._slid(i, int(event.target.value)))
        for labels in (_BUTTONS, _JUMPS):
            group = gui.add_button_group("", tuple(labels))
            group.on_click(lambda event, keys=labels: self._do(lambda cursor: cursor.press(keys[event.target.value])))
        faces = gui.add_dropdown("names of faces", FACES, initial_value="this operation")
        faces.on_update(lambda _: self._do(lambda cursor: setattr(cursor, "faces", faces.value)))
        self._arm_shown = gui.add_checkbox("arm", True)
        for name in story.goals:
            box = gui.add_checkbox(f"{name} ({COLOR_NAMES[name]})", False)
            box.on_update(
                lambda event, name=name: self._do(
                    lambda cursor: (cursor.goals.add if event.target.value else cursor.goals.discard)(name)
                )
            )

    def _do(self, what: Callable[[Cursor], object]) -> None:
        with self.lock:
            what(self.cursor)

    def _choose(self, chapter: int) -> None:
        with self.lock:
            if chapter != self.cursor.chapter:
                self.cursor.turn_to(chapter)

    def _slid(self, chapter: int, moment: int) -> None:
        with self.lock:
            if chapter == self.cursor.chapter and moment != self.cursor.moment and not self.cursor.playing:
                self.cursor.go(moment)


def _server(port: int) -> Any:
    import viser

    try:
        with redirect_stdout(io.StringIO()):  # it says where it is in a box of its own
            return viser.ViserServer(host=HOST, port=port, label="apo-bench view", verbose=False)
    except OSError as error:
        raise InputError(
            f"--port {port} was given, which cannot be served ({error.strerror or error}); choose another one."
        ) from error


def _add(server: Any, name: str, shape: BodyMesh, color: tuple[float, ...], opacity: float, scale: float = 1.0) -> Any:
    return server.scene.add_mesh_simple(
        name,
        shape.vertices.astype(np.float32),
        shape.triangles.astype(np.uint32),
        color=tuple(int(255 * c) for c in color),
        opacity=None if opacity == 1.0 else opacity,
        flat_shading=True,
        scale=scale,
    )

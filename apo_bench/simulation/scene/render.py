"""Render pictures and films of a scene, and show a replay in a window."""

from collections.abc import Callable, Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Poses
from apo_bench.errors import InputError, missing_package, require, require_known
from apo_bench.geometry import Array
from apo_bench.io import write_file
from apo_bench.simulation.graphics import SHADOW_TEXELS, need_window, renderer
from apo_bench.simulation.scene.kept_renderer import KeptRenderer
from apo_bench.simulation.scene.scene import Scene
from apo_bench.simulation.scene.world import World, make_initial_state, set_part_pose

_Image = NDArray[np.uint8]
SceneCamera: TypeAlias = str | mujoco.MjvCamera
"""The name of a camera of the room, or a `mujoco.MjvCamera`."""
_VIDEO_ENDINGS = (".mp4", ".gif")


@check_arguments
def draw_picture(
    scene: Scene,
    poses: Poses,
    width: int = 640,
    height: int = 480,
    camera: SceneCamera = "overview",
    more: Callable[[Any], None] | None = None,
) -> _Image:
    """Return an image of the parts at given poses, without the arm, (height, width, 3), uint8.

    Args:
        scene: From `build_scene`.
        poses: Part -> its pose, (4, 4), world frame, [m]; a part that is not named is drawn at its start.
        width: [pixels].
        height: [pixels].
        camera: `overview`, `close`, `top`, or the result of `aim_camera`.
        more: A function that adds geoms to MuJoCo's abstract scene.
    """
    return _draw(scene.shown, build_data(scene.shown, scene, poses), width, height, camera, more)


def picture_with_arm(
    scene: Scene,
    poses: Poses,
    state: Array | None = None,
    width: int = 640,
    height: int = 480,
    camera: SceneCamera = "overview",
    more: Callable[[Any], None] | None = None,
) -> _Image:
    """Render the parts at given poses with the arm at home and its fingers open, (height, width, 3).

    Args:
        state: `qpos` of a replay to show as it is; then only the fixed parts' poses are taken from `poses`.
        more: Draws more into MuJoCo's abstract scene, such as `Marks`.
    """
    return _draw(scene.work, build_data_with_arm(scene, poses, state), width, height, camera, more)


def build_data_with_arm(scene: Scene, poses: Poses, state: Array | None = None) -> Any:
    """The `mujoco.MjData` of the replay world that `picture_with_arm` shows."""
    data = build_data(scene.work, scene, poses)
    move_arm_home(scene, data)
    if state is not None:
        data.qpos[:] = state
    mujoco.mj_forward(scene.work.model, data)
    return data


def copy_data(data: Any, into: Any) -> None:
    """Copy `mujoco.MjData` into another one, of the same model or a copy of it, and compute all frames and forces."""
    mujoco.mj_copyData(into, into.model, data)
    mujoco.mj_forward(into.model, into)


def place_for_picture(model: Any, data: Any) -> None:
    """Update what a picture shows from the positions of a state: frames, centres of mass, cameras, lights."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)


def move_arm_home(scene: Scene, data: Any) -> None:
    """Put the arm at home in a state of the replay world, with open fingers."""
    for joint, q in zip(scene.arm.joints, scene.arm.home, strict=True):
        data.joint(f"arm/{joint}").qpos = q
    for finger, at in zip(scene.arm.fingers, scene.arm.finger_joints(scene.arm.opening_m), strict=True):
        data.joint(f"arm/{finger}").qpos = at


@check_arguments
def aim_camera(
    look_at: Array, distance_m: float = 0.45, azimuth_deg: float = 130.0, elevation_deg: float = -22.0
) -> SceneCamera:
    """Return a camera for `draw_picture`, `show_scenario` or `Film`.

    Args:
        look_at: The point in the middle of the picture, (3,), world frame, [m].
        distance_m: Distance of the camera from that point.
        azimuth_deg: Direction of the view about the vertical; 0 is along x of the world.
        elevation_deg: Direction of the view against the horizontal; negative looks down.

    Examples:
        >>> import apo_bench, numpy as np
        >>> apo_bench.aim_camera(np.array([0, 0, 0.05]), distance_m=0.3).distance
        0.3
    """
    camera = mujoco.MjvCamera()
    camera.lookat[:] = look_at
    camera.distance = distance_m
    camera.azimuth = azimuth_deg
    camera.elevation = elevation_deg
    return camera


@check_arguments
class Film:
    """Film a replay: pass it as `watch` to `replay`, `demonstrate` or `run_trial`, then `save` it.

    The attribute `frames` is a list of images, (height, width, 3), uint8.
    """

    def __init__(
        self,
        scene: Scene,
        fps: float = 20.0,
        width: int = 640,
        height: int = 480,
        camera: SceneCamera | None = None,
        speed: float = 2.0,
        shadows: bool = False,
    ) -> None:
        """Make a film without frames.

        Args:
            scene: From `build_scene`.
            fps: Frames per second of the film.
            width: [pixels].
            height: [pixels].
            camera: As in `draw_picture`. Default: a camera that looks at the middle of the assembly.
            speed: Simulated seconds per second of film.
            shadows: Whether to draw shadows, which is several times slower without a graphics card.
        """
        middle = np.array([*scene.scenario.site.center_m, 0.08])
        self.fps = fps
        self.camera = camera or aim_camera(middle, 0.85, 128.0, -24.0)
        self.frames: list[_Image] = []
        _check_camera(scene.work, self.camera)
        self._renderer = KeptRenderer(scene.work.model, width, height, SHADOW_TEXELS if shadows else 0)
        self._every = speed / fps
        self._next = 0.0

    def __call__(self, data: Any) -> None:
        """Keep an image if its time has come; `data` is a `mujoco.MjData`."""
        if data.time >= self._next:
            self.frames.append(self.shot(data))
            self._next = data.time + self._every - 1e-9

    def shot(self, data: Any) -> _Image:
        """Return an image of a state (`mujoco.MjData`), (height, width, 3), uint8, without keeping it."""
        return self._renderer.draw(data, self.camera)

    @check_arguments
    def save(self, path: str | Path) -> None:
        """Write the film.

        Args:
            path: A file that ends in .gif, or in .mp4 (extra `film`).

        Raises:
            InputError: Another ending, or the extra is not installed.
        """
        save_film(self.frames, path, self.fps)

    def close(self) -> None:
        """Free the renderer; this also happens when the film is deleted."""
        self._renderer.close()


def check_film(path: Path) -> None:
    """Check that a film can be written; a GIF needs no further package.

    Raises:
        InputError: An ending other than .mp4 and .gif, or an MP4 without the package imageio-ffmpeg.
    """
    require(
        path.suffix.lower() in _VIDEO_ENDINGS,
        f"a film cannot be written as '{path}'; give a name that ends in .mp4 or .gif.",
    )
    if path.suffix.lower() == ".mp4" and find_spec("imageio_ffmpeg") is None:
        raise missing_package("an MP4 film", "imageio-ffmpeg", ", or give a name that ends in .gif.")


def save_film(frames: Iterable[_Image], path: str | Path, fps: float, **encoding: Any) -> None:
    """Write images as a film, MP4 or GIF by the ending.

    Args:
        encoding: For an MP4: arguments of `imageio_ffmpeg.write_frames`.

    Raises:
        InputError: As of `check_film`, or a path that cannot be written.
    """
    import imageio.v3 as imageio

    path = Path(path)
    check_film(path)
    ending = path.suffix.lower()
    how: dict[str, Any] = {"duration": 1000.0 / fps, "loop": 0}
    if ending == ".mp4":
        how = {"fps": fps, "macro_block_size": 8, **encoding}
    try:
        film = imageio.imwrite("<bytes>", np.array(list(frames)), extension=ending, **how)
    except OSError as error:
        raise InputError(f"the film '{path}' cannot be encoded: {error}.") from error
    write_file(path, film)


class ReplayWindow:
    """Shows a replay in MuJoCo's window, in real time: pass it as `watch`. On macOS run under `mjpython`."""

    def __init__(self, scene: Scene) -> None:
        """A viewer whose window opens when the replay begins.

        Raises:
            InputError: No window can be opened.
        """
        need_window()
        self._scene = scene
        self._window: Any = None

    def __call__(self, data: Any) -> None:
        """Show a state in real time; the first call opens the window."""
        import time

        import mujoco.viewer

        if self._window is None:
            self._window = mujoco.viewer.launch_passive(self._scene.work.model, data)
            self._behind = time.perf_counter() - data.time
        self._window.sync()
        time.sleep(max(0.0, data.time + self._behind - time.perf_counter()))

    def close(self) -> None:
        if self._window is not None:
            self._window.close()
            self._window = None


def _draw(
    world: World, data: Any, width: int, height: int, camera: SceneCamera, more: Callable[[Any], None] | None = None
) -> _Image:
    """Render one state of a world, (height, width, 3)."""
    _check_camera(world, camera)
    with renderer(world.model, width, height) as draws:
        draws.update_scene(data, camera=camera)
        if more is not None:
            more(draws.scene)
        return np.array(draws.render())


def _check_camera(world: World, camera: SceneCamera) -> None:
    """Raise an `InputError` if the scene has no camera of that name."""
    names = [world.model.camera(i).name for i in range(world.model.ncam)]
    if isinstance(camera, str):
        require_known("camera", camera, names, rest=" Or give the result of aim_camera.")


def build_data(world: World, scene: Scene, poses: Poses) -> Any:
    """A new state of a world with parts at `poses`, and parts that are not named at their starts."""
    data = make_initial_state(world, {**scene.scenario.start, **{p: T for p, T in poses.items() if p in world.fixed}})
    for part in world.free:
        set_part_pose(world, data, part, poses.get(part, scene.scenario.start[part]))
    data.mocap_pos[:, 2] = -1.0  # hands are hidden below the table
    mujoco.mj_forward(world.model, data)
    return data

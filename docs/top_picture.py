"""Draw the animated picture at the top, a jam and a fit: `python docs/top_picture.py` (three minutes).

The arm is the UR5e with the 2F-85 gripper of MuJoCo Menagerie, which the repository does not hold: name its folder in
APO_BENCH_MENAGERIE. The robot is simulated with it as with any other arm; its meshes are only drawn.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from apo_bench.assembly import Plan
from apo_bench.correction.correctors import correct
from apo_bench.geometry import Array
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.scenario.scenario_file import load_scenario
from apo_bench.simulation.graphics import renderer
from apo_bench.simulation.physics import Physics
from apo_bench.simulation.scene.composing import room_with_parts
from apo_bench.simulation.scene.render import aim_camera
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.trial.trial_stages import observe_demonstration, replay_and_judge, simulate_demonstration

PICTURE = Path(__file__).parent / "pictures" / "top.gif"
ARM = "menagerie:universal_robots_ur5e"
SEED = 7
NOISE_LEVEL = 1.0  # mm and degrees, 1 sigma per axis
PANEL = (440, 400)  # width and height of one half [px]
INSET = (150, 150)  # of the whole arm, in the upper right corner of a half [px]
BAR = 40  # height of the title [px]
OVERSAMPLING = 2  # rendered larger by this factor and reduced
COLOURS = 128  # of the palette; fewer make a smaller file
STEP_S = 0.08  # simulated time between two frames
FRAME_MS = 80  # time that a frame is shown
HOLD_MS = 2500  # time that the last frame is shown
JAMS_S = 1.5  # from the first frame: when the robot has stopped, and
FITS_S = 2.4  # when the stick is in
SIDE_M = 0.02  # how near to the line through the hole, and
ABOVE_M = 0.12  # how low above castle 1 the stick is when the insertion begins
BEFORE_S = 0.4  # shown before it begins
AFTER_S = 3.2  # shown after it
RED = (196, 30, 50)
GREEN = (30, 130, 65)


class Half(NamedTuple):
    """One half of the picture."""

    title: str
    ending: str
    color: tuple[int, int, int]
    ends_s: float
    """When the ending appears, from the first frame [s]."""
    frames: Sequence[Image.Image]


def main() -> None:
    scene = build_scene(load_scenario("stick_in_tower"), arm=ARM)
    demonstration = simulate_demonstration(scene, 0.0, SEED)
    observed = observe_demonstration(demonstration, make_noise("isotropic", NoiseLevel(NOISE_LEVEL, NOISE_LEVEL)), SEED)
    corrected = correct(observed, "contact").poses
    reference = demonstration.layout.poses
    plan = partial(Plan, observed.assembly, observed.start)
    model = model_with_meshes(scene)
    jam = list(draw_states(scene, model, insertion(scene, plan(observed.poses), reference), reference[0]))
    fit = list(draw_states(scene, model, insertion(scene, plan(corrected), reference), reference[0]))
    halves = (
        Half("Poses as observed", "jams: stopped by contact force", RED, JAMS_S, jam),
        Half("Poses corrected by contacts", "fits: 0.25 mm clearance per side", GREEN, FITS_S, fit),
    )
    frames = list(join_halves(halves))
    save_gif(frames, PICTURE)
    print(f"Wrote {PICTURE} ({len(frames)} frames, {PICTURE.stat().st_size / 1e6:.2f} MB)")


def model_with_meshes(scene: Scene) -> Any:
    """Return the scene as a model with all meshes of the arm, for drawing only."""
    folder = Path(os.environ["APO_BENCH_MENAGERIE"])
    spec = room_with_parts(scene.scenario, scene.scenario.clearance_mm, Physics())
    arm = mujoco.MjSpec.from_file(str(folder / "universal_robots_ur5e" / "ur5e.xml"))
    hand = mujoco.MjSpec.from_file(str(folder / "robotiq_2f85" / "2f85.xml"))
    arm.attach(hand, site=arm.site("attachment_site"), prefix="gripper/")
    for light in list(arm.lights):
        arm.delete(light)
    stand = spec.worldbody.add_body(name="arm/", pos=scene.arm.base, quat=scene.arm.turn)
    spec.attach(arm, frame=stand.add_frame(), prefix="arm/")
    model = spec.compile()
    model.vis.global_.offwidth, model.vis.global_.offheight = (OVERSAMPLING * size for size in PANEL)
    model.vis.headlight.ambient[:] = 0.38
    return model


def insertion(scene: Scene, plan: Plan, reference: Array) -> list[Array]:
    """Replay a plan; return the states around the moment in which the stick, held in front of the hole, goes down."""
    moments: list[tuple[float, Array]] = []
    replay_and_judge(plan, scene, reference, lambda data: moments.append((data.time, np.array(data.qpos))))
    times = np.array([time for time, _ in moments])
    stick = scene.work.model.joint("stick/").qposadr[0]
    off = np.array([state[stick : stick + 3] for _, state in moments]) - reference[0][:3, 3]
    begin = times[np.argmax((np.abs(off @ reference[0][:3, 1]) < SIDE_M) & (off[:, 2] < ABOVE_M))]
    wanted = np.searchsorted(times, np.arange(begin - BEFORE_S, begin + AFTER_S, STEP_S))
    return [moments[min(int(k), len(moments) - 1)][1] for k in wanted]


def draw_states(scene: Scene, model: Any, states: Sequence[Array], goal: Array) -> Iterator[Image.Image]:
    """Draw states of a replay: the hole close up, and the whole arm in a corner."""
    turn = float(np.degrees(np.arctan2(goal[1, 0], goal[0, 0])))
    close = aim_camera(goal[:3, 3] - 0.045 * goal[:3, 0] + [0.0, 0.0, 0.06], 0.37, turn + 47.0, -20.0)
    whole = aim_camera(np.array([-0.18, 0.0, 0.3]), 1.3, turn + 70.0, -14.0)
    data = mujoco.MjData(model)
    own = scene.work.model
    with renderer(model, *(OVERSAMPLING * size for size in PANEL)) as draws:
        for state in states:
            for k in range(own.njnt):
                joint = own.joint(k)
                data.joint(joint.name).qpos = state[joint.qposadr[0] :][: len(data.joint(joint.name).qpos)]
            mujoco.mj_forward(model, data)
            picture, inset = (shoot(draws, data, camera) for camera in (close, whole))
            picture = picture.resize(PANEL, Image.Resampling.LANCZOS)
            left = (inset.width - inset.height) // 2
            inset = inset.crop((left, 0, left + inset.height, inset.height)).resize(INSET, Image.Resampling.LANCZOS)
            corner = PANEL[0] - INSET[0] - 8, 8
            picture.paste(inset, corner)
            box = (corner[0] - 2, corner[1] - 2, corner[0] + INSET[0] + 1, corner[1] + INSET[1] + 1)
            ImageDraw.Draw(picture).rectangle(box, outline="white", width=2)
            yield picture


def shoot(draws: Any, data: Any, camera: Any) -> Image.Image:
    """Draw a state through a camera."""
    draws.update_scene(data, camera=camera)
    return Image.fromarray(np.array(draws.render()))


def join_halves(halves: Sequence[Half]) -> Iterator[Image.Image]:
    """Put the halves next to each other, each with its title, and from some frame on its ending."""
    for k in range(len(halves[0].frames)):
        frame = Image.new("RGB", (2 * PANEL[0] + 8, PANEL[1] + BAR), "white")
        draw = ImageDraw.Draw(frame)
        for x, half in zip((0, PANEL[0] + 8), halves, strict=True):
            frame.paste(half.frames[k], (x, BAR))
            middle = x + PANEL[0] / 2
            draw.text((middle, BAR / 2), half.title, half.color, font(21), "mm")
            if k * STEP_S > half.ends_s:
                draw.rectangle((x, BAR + PANEL[1] - 40, x + PANEL[0], BAR + PANEL[1]), half.color)
                draw.text((middle, BAR + PANEL[1] - 20), half.ending, "white", font(21), "mm")
        yield frame


def font(size: int) -> Any:
    """Return matplotlib's bold font."""
    return ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans-Bold.ttf", size)


def save_gif(frames: Sequence[Image.Image], path: Path) -> None:
    """Write frames with one palette, and without dithering, which would make every pixel change."""
    sample = np.concatenate([np.array(frame) for frame in frames[:: len(frames) // 3]])
    palette = Image.fromarray(sample).quantize(COLOURS, Image.Quantize.MEDIANCUT)
    indexed = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    times = [FRAME_MS] * (len(frames) - 1) + [HOLD_MS]
    indexed[0].save(path, save_all=True, append_images=indexed[1:], duration=times, loop=0, optimize=True)


if __name__ == "__main__":
    main()

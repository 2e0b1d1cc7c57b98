"""Make a data set of images in BOP format from trials: one scene a trial, one image after each operation and camera."""

import json
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from apo_bench import __version__
from apo_bench.benchmark.datasets.images.models import ImageObject, write_models
from apo_bench.benchmark.datasets.images.printed_marks import ObjectMarks, draw_marks
from apo_bench.benchmark.datasets.images.scene import DEPTH_SCALE, DETECTIONS, write_scene
from apo_bench.benchmark.datasets.images.video_frames import record_frames
from apo_bench.benchmark.datasets.images.views import make_view, number_images
from apo_bench.benchmark.sweeps.pool import make_process_pool
from apo_bench.benchmark.sweeps.stop_signals import stop_at_signals
from apo_bench.errors import require
from apo_bench.formats.bop_images import DESCRIPTION, ImageConfig, ImageDescription, ImageEntry, SceneEntry
from apo_bench.io import group_by, write_file
from apo_bench.records import TrialConfig
from apo_bench.scenario import Scenario, load_scenario
from apo_bench.scenario.parts import read_part
from apo_bench.simulation.scene.composing import movable_parts
from apo_bench.simulation.sensor.photographs import Photographer
from apo_bench.trial.trial_stages import IMAGES, demonstration_of, scene_of, stream

JOINED_DETECTIONS = "detections.json"
TARGETS = "test_targets_bop19.json"
_BATCH = 8
"""Most scenes that one process makes before it compiles the scenario again."""
Batch = Sequence[tuple[int, TrialConfig]]
"""Numbers of scenes and their trials, all of one scenario."""
_CARD = """# Images of assemblies in BOP format

Renderings of simulated demonstrations by apo_bench {version}, no photographs:

    {command}

`apo_trials.json` states which image shows which operation of which trial. Poses, models and depth are in mm.

Licence: Apache-2.0, as that of apo_bench.
"""


def make_images(
    trials: Sequence[TrialConfig],
    out: Path,
    config: ImageConfig,
    *,
    split: str = "test",
    command: str = "",
    workers: int = 1,
    say: Callable[[str], None] = print,
) -> int:
    """Simulate the demonstrations of trials and write their images; scenes that exist are kept.

    Args:
        trials: With one human error scale and one secret seed; pose settings and methods have no effect.
        out: Folder of the data set. If it exists, it must be one of the same trials and options.
        split: Name of the folder of the scenes.
        command: The command line that the card states.
        workers: Processes; 1 makes the images in this process.
        say: Called with a sentence about each trial whose demonstration failed, so that it has no images.

    Returns:
        The number of scenes.

    Raises:
        InputError: The folder holds something else, or no graphics driver can be used.
    """
    loaded = {trial.scenario: load_scenario(trial.scenario) for trial in trials}
    objects = list_objects(trials, loaded)
    description = describe_images(trials, loaded, objects, config, split)
    _open_folder(out, description)
    marks = {k: draw_marks(each.pieces, np.random.default_rng(k)) for each, k in objects.items() if config.marks}
    write_models({number: each for each, number in objects.items()}, marks, out)
    write_file(out / "camera.json", json.dumps(_describe_camera(config), indent=1))
    write_file(out / "README.md", _CARD.format(version=__version__, command=command))
    done = {int(path.parent.name) for path in (out / split).glob(f"*/{DETECTIONS}")}
    left = [(trial.scenario, (number, trial)) for number, trial in enumerate(trials, start=1) if number not in done]
    batches = [several[k : k + _BATCH] for several in group_by(left).values() for k in range(0, len(several), _BATCH)]
    for sentence in _run(batches, (description, marks, out / split), workers):
        say(sentence)
    return _join_scenes(out, split)


def list_objects(trials: Sequence[TrialConfig], loaded: dict[str, Scenario]) -> dict[ImageObject, int]:
    """The objects of all trials with their numbers, from 1; parts of one file, clearance and colour are one object."""
    objects: dict[ImageObject, int] = {}
    for trial in trials:
        for part in movable_parts(loaded[trial.scenario]):
            objects.setdefault(_find_object(loaded[trial.scenario], part, trial.clearance_mm), len(objects) + 1)
    return objects


def describe_images(
    trials: Sequence[TrialConfig],
    loaded: dict[str, Scenario],
    objects: dict[ImageObject, int],
    config: ImageConfig,
    split: str,
) -> ImageDescription:
    """The description of the data set; scene k is of trial k, from 1.

    Raises:
        InputError: The trials differ in human error scale or secret seed.
    """
    common = {(trial.human_error_scale, trial.secret_seed) for trial in trials}
    require(len(common) == 1, "the trials of a data set of images have one human error scale and one secret seed.")
    ((human_error_scale, secret_seed),) = common
    scenes = {}
    for number, trial in enumerate(trials, start=1):
        scenario = loaded[trial.scenario]
        parts = {part: objects[_find_object(scenario, part, trial.clearance_mm)] for part in movable_parts(scenario)}
        images = {
            str(image): ImageEntry(operation, camera)
            for image, operation, camera in number_images(len(scenario.assembly), config.cameras)
        }
        scenes[str(number)] = SceneEntry(trial.scenario, trial.seed, trial.clearance_mm, parts, images)
    return ImageDescription(
        schema="apo-bench/images/1",
        split=split,
        human_error_scale=human_error_scale,
        secret_seed=None if secret_seed is None else secret_seed.hash,
        options=config,
        centers_mm={str(number): tuple((1e3 * each.offset[:3, 3]).tolist()) for each, number in objects.items()},
        scenes=scenes,
    )


def _find_object(scenario: Scenario, part: str, clearance_mm: float) -> ImageObject:
    """The object of a part; its colour is that of the scenario, else of the first geom in its file."""
    path = scenario.part_files[part]
    color = scenario.colors.get(part) or read_part(path).model.geoms[0].rgba[:3]
    return ImageObject(str(path), clearance_mm, tuple(color), scenario.assembly.solids[part])


def _open_folder(out: Path, description: ImageDescription) -> None:
    """Write the description into a new folder; raise an `InputError` if the folder holds something else."""
    text = msgspec.json.format(msgspec.json.encode(description), indent=1).decode()
    path = out / DESCRIPTION
    if path.exists():
        require(
            path.read_text(encoding="utf-8") == text,
            f"'{out}' holds images of other trials or options; name another folder.",
        )
        return
    require(
        not out.exists() or (out.is_dir() and not any(out.iterdir())),
        f"'{out}' is there already and not an empty folder; name another.",
    )
    (out / description.split).mkdir(parents=True)
    write_file(path, text)


def _describe_camera(config: ImageConfig) -> dict[str, Any]:
    """The content of `camera.json`."""
    K = make_view(config, np.eye(4)).K
    size = {"width": config.width, "height": config.height, "depth_scale": DEPTH_SCALE}
    return {"fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2], "cy": K[1, 2], **size}


def _run(batches: Sequence[Batch], how: tuple[ImageDescription, ObjectMarks, Path], workers: int) -> list[str]:
    """Write all batches, in processes if there are several workers; returns sentences about failed demonstrations."""
    if workers == 1 or not batches:
        return [sentence for batch in batches for sentence in write_batch(batch, *how)]
    with stop_at_signals(), make_process_pool(min(workers, len(batches))) as pool:
        running = [pool.schedule(write_batch, [batch, *how]) for batch in batches]
        return [sentence for future in running for sentence in future.result()]


def write_batch(batch: Batch, description: ImageDescription, marks: ObjectMarks, folder: Path) -> list[str]:
    """Write scenes of one scenario; returns sentences about failed demonstrations."""
    scene = scene_of(batch[0][1])
    config = description.options
    failed = []
    with closing(Photographer(scene, make_view(config, np.eye(4)), not config.no_rgb)) as photographer:
        for number, trial in batch:
            simulated = demonstration_of(trial, scene)
            shown = simulated.demonstration
            if shown.code != "ok":
                failed.append(f"{trial.scenario}, seed {trial.seed}: the demonstration failed, so it has no images.")
                continue
            frames = record_frames(scene, trial, simulated, config.video_hz) if config.video_hz else {}
            rng = stream(trial.seed, IMAGES, trial.secret_seed)
            write_scene(photographer, shown, number, description, rng, marks, frames, folder / f"{number:06d}")
    return failed


def _join_scenes(out: Path, split: str) -> int:
    """Write the detections and targets of all scenes; returns the number of scenes."""
    files = sorted((out / split).glob(f"*/{DETECTIONS}"))
    detections = [each for file in files for each in json.loads(file.read_text(encoding="utf-8"))]
    counts = Counter((each["scene_id"], each["image_id"], each["category_id"]) for each in detections)
    targets = [
        {"scene_id": scene, "im_id": image, "obj_id": number, "inst_count": count}
        for (scene, image, number), count in sorted(counts.items())
    ]
    write_file(out / JOINED_DETECTIONS, json.dumps(detections))
    write_file(out / TARGETS, json.dumps(targets))
    return len(files)

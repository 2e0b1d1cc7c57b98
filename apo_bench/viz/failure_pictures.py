"""Pictures of some failed trials: the parts at the poses where the record says that they ended."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.assembly import Contact, Poses, list_outline_points
from apo_bench.benchmark.report.failure_choice import FailurePicture
from apo_bench.errors import InputError, require
from apo_bench.geometry import pose
from apo_bench.io import read_lines
from apo_bench.records import TrialConfig, TrialRecord, get_record_key, restore_settings
from apo_bench.records.run.replay_command import Files
from apo_bench.records.run.validation import decode_record

_SIZE = (640, 480)  # width and height, in pixels
_QUALITY = 82  # of the JPEG file
_AZIMUTH_DEG = 128.0
_ELEVATION_DEG = -24.0
_ARROW_M = 0.11  # from the contact to the tail of the arrow
_TIP_M = 0.012  # from the contact to the head of the arrow
_ARROW = (0.85, 0.1, 0.1)  # colour of the arrow


def draw_failures(chosen: Sequence[TrialRecord], folder: Path, files: Files) -> tuple[list[FailurePicture], list[str]]:
    """Draw failed trials.

    Args:
        chosen: Records of the trials to draw.
        folder: Folder of the sweep; its `trials.jsonl` holds the final poses.
        files: Scenario -> its file.

    Returns:
        The pictures, and one sentence for each distinct reason why a picture could not be made.
    """
    pictures: list[FailurePicture] = []
    missed: list[str] = []
    for record in chosen:
        try:
            pictures.append(_draw_failure(record, folder, files))
        except (InputError, RuntimeError, OSError, ValueError) as error:
            missed.append(str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__)
            if "no picture can be drawn here" in missed[-1]:  # this machine cannot render, so no other picture will do
                break
    return pictures, list(dict.fromkeys(missed))


def _draw_failure(record: TrialRecord, folder: Path, files: Files) -> FailurePicture:
    """Draw the final poses of a failed trial, with an arrow at the contact that failed."""
    import imageio.v3 as iio

    from apo_bench.scenario.scenario_file import is_named
    from apo_bench.simulation.scene.render import draw_picture
    from apo_bench.trial.trial_stages import scene_of

    name = record["scenario"]
    require(name in files or is_named(name), f"run.json names no file of the scenario '{name}'")
    # the picture shows no arm, and the arm of the record may be a plugin that must not be run here
    scene = scene_of(replace(restore_settings(record, files.get(name, name)), arm=TrialConfig.arm))
    poses = _read_poses(_read_whole_record(folder, record).get("final_poses"))
    require(poses, f"of seed {record['seed']} of {name} the record does not say where the parts ended")
    contact = _find_failed_contact(record, scene)
    image = draw_picture(scene, poses, *_SIZE, _aim_camera(scene, record, poses), _make_arrow(contact, scene, poses))
    words = "where the parts ended" if contact is None else f"where the parts ended; the arrow points at {contact}"
    return FailurePicture(record, iio.imwrite("<bytes>", image, extension=".jpg", quality=_QUALITY), words)


def _read_whole_record(folder: Path, record: TrialRecord) -> Mapping[str, Any]:
    """Return the complete line of `trials.jsonl` for a record that a report has shortened; empty if not found."""
    # a cheap search in the text of each line, before any line is parsed
    wanted = (f'"seed": {record["seed"]},'.encode(), json.dumps(record["config_hash"]).encode())
    path = folder / "trials.jsonl"
    for number, line in read_lines(path, "table of trials"):
        if all(part in line for part in wanted):
            whole = decode_record(line, f"{path}, line {number}")
            if get_record_key(whole) == get_record_key(record):
                return whole
    return {}


def _find_failed_contact(record: TrialRecord, scene: Any) -> Contact | None:
    """Return the contact that the failure sentence names, else the first contact of an operation with a force stop."""
    operations = scene.scenario.assembly.operations
    sentence = f"{record.get('sentence') or ''} "
    k = record.get("failure_operation")
    # the space prevents `a.px on b.n` from matching `a.px on b.nx`
    named = [contact for operation in operations for contact in operation.contacts if f"{contact} " in sentence]
    if k and record["failure_code"] == "force_stop":
        named += operations[k - 1].contacts
    return next(iter(named), None)


def _make_arrow(contact: Contact | None, scene: Any, poses: Poses) -> Any:
    """Return an arrow that points down at the middle of the environment's face, or None.

    If the environment is a fixed part, the arrow points at the face of the manipulated part. The middle of a fixed
    face may be far from the contact.
    """
    from apo_bench.simulation.scene.marks import Marks, ShiftArrows

    if contact is None or any(of.part not in poses for of in contact):
        return None
    assembly = scene.scenario.assembly
    of = contact.manipulated if contact.environment.part in assembly.fixed else contact.environment
    middle = list_outline_points(assembly, of, poses).mean(axis=0)
    return Marks([ShiftArrows(middle, np.array([0.0, 0.0, 1.0]), _ARROW_M, _TIP_M, _ARROW)])


def _read_poses(reached: Mapping[str, Sequence[float]] | None) -> Poses:
    """Return part -> pose, (4, 4), world, [m], from positions in mm and quaternions of a record."""
    return {part: pose.unpack([*(np.array(x[:3]) * 1e-3), *x[3:]]) for part, x in (reached or {}).items()}


def _aim_camera(scene: Any, record: TrialRecord, poses: Poses) -> Any:
    """Aim the camera at the parts of the operation that failed, else at all parts that are not fixed."""
    from apo_bench.simulation.film.framing import frame_parts
    from apo_bench.simulation.scene.render import aim_camera

    assembly = scene.scenario.assembly
    k = record.get("failure_operation")
    failed = assembly.operations if k is None else assembly.operations[k - 1 : k]  # operations of records count from 1
    near = {part for o in failed for part in (*o.moves, *(contact.environment.part for contact in o.contacts))}
    shown = (near & poses.keys()) - assembly.fixed or poses.keys() - assembly.fixed
    return aim_camera(*frame_parts(assembly, [poses], shown), _AZIMUTH_DEG, _ELEVATION_DEG)

"""What a person reads and sees of a recording: where things stand, in words and in a picture."""

from __future__ import annotations

import numpy as np

from apo_bench import load_scenario
from apo_bench.geometry import pose
from apo_bench.importers.recording.arranging import CameraPose
from apo_bench.importers.recording.camera_file import CameraFile, Conventions
from apo_bench.importers.recording.importing import planned_starts
from apo_bench.importers.recording.show.drawing import unfit_drawing
from apo_bench.importers.recording.show.text import camera_lines
from apo_bench.importers.recording.tracks import Log
from tests.recorded import seen

NAME = "stick_in_tower"


def test_a_camera_is_told_in_mm_and_degrees() -> None:
    turned = CameraPose(pose.at((0.9, -0.2, -1e-9), (0.0, 0.0, -90.0)))
    assert camera_lines(turned) == [
        ("camera", "as stated: at (900, -200, 0) mm, turned 90.0 deg about (0, 0, -1); its axes are those of OpenCV")
    ]
    solved = CameraPose(np.eye(4), {"peg": np.array([3e-3, 4e-3, 0.0, 0.0, 0.0, np.radians(2.0)])})
    assert camera_lines(solved) == [
        ("camera", "solved: at (0, 0, 0) mm, turned 0.0 deg; its axes are those of OpenCV"),
        ("residuals", "peg 5.00 mm 2.00 deg"),
    ]


def test_a_refused_recording_is_drawn_with_the_places_that_are_known() -> None:
    scenario = load_scenario(NAME)
    tracks = seen(NAME, 0.3)
    tracks["stranger"] = tracks.pop("stick")
    elsewhere = pose.at((0.3, 0.0, 0.0))
    known = {"castle1": None, "castle2": elsewhere, "stranger": elsewhere}
    drawing = unfit_drawing(Log("log.csv", tracks, ()), tracks, CameraFile(Conventions(), None, known, None), scenario)
    assert set(drawing.places) == set(known)
    assert np.array_equal(drawing.places["castle1"], planned_starts(scenario)["castle1"])
    assert np.array_equal(drawing.places["castle2"], elsewhere)
    assert drawing.title.endswith("it does not fit")

"""A recording gives the goals that were reached, in their order, and what is wrong with it is named."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from apo_bench import InputError, load_scenario
from apo_bench.geometry import pose
from apo_bench.importers.recording.camera_file import CameraFile, Conventions
from apo_bench.importers.recording.importing import ImportedRecording, import_recording
from apo_bench.importers.recording.log_poses import mirror
from apo_bench.importers.recording.ordering import Stated
from apo_bench.importers.recording.tracks import PoseTrack
from apo_bench.importers.recording.unplanned import unplanned_recording
from apo_bench.scenario.layout import place_layout
from tests.recorded import CAMERA, seen

NOTHING = Stated()
GIVEN = CameraFile(Conventions(), CAMERA, {}, None)
NAME = "stick_in_tower"
KNOWN = replace(GIVEN, T_world_camera=None, known=dict.fromkeys(("castle1", "castle2", "stick")))


def imported(
    tracks: dict[str, PoseTrack], camera: CameraFile = GIVEN, name: str = NAME, stated: Stated = NOTHING
) -> ImportedRecording:
    return import_recording(tracks, camera, load_scenario(name), stated, "log.csv")


def goals(name: str) -> np.ndarray:
    return place_layout(load_scenario(name), 0.1, 0.0, 0.3).poses


@pytest.mark.parametrize("name", [NAME, "carried_bridge"])
@pytest.mark.parametrize("camera", ["given", "solved"])
def test_goals_are_found_within_the_noise_of_their_means(name: str, camera: str) -> None:
    tracks = seen(name, 0.5)
    stated = GIVEN if camera == "given" else replace(KNOWN, known=dict.fromkeys(tracks))
    recording = imported(tracks, stated, name)
    off = pose.log(pose.inverse(goals(name)) @ recording.observation.poses)
    # 24 frames and more: 0.1 mm and 0.1 deg per axis; five times that, and as much again for a solved camera.
    assert np.abs(off[:, :3]).max() < 1e-3
    assert np.degrees(np.abs(off[:, 3:]).max()) < 1.0
    assert recording.doubts == ()
    assert bool(recording.observation.shared) == (camera == "solved")


def test_frames_that_are_wrong_and_frames_that_are_missing_change_nothing() -> None:
    tracks = seen(NAME, 0.3)
    rng = np.random.default_rng(1)
    for part, (t, T) in tracks.items():
        wrong = T.copy()
        wrong[::17] = wrong[::17] @ pose.at((0.05, 0.0, 0.0), (0.0, 120.0, 0.0))
        kept = rng.random(len(t)) > 0.2
        tracks[part] = PoseTrack(t[kept], wrong[kept])
    recording = imported(tracks)
    off = pose.log(pose.inverse(goals(NAME)) @ recording.observation.poses)
    assert np.abs(off[:, :3]).max() < 1e-3
    assert all(n >= len(tracks[part].t) // 25 for part, n in recording.gross.items())


def test_without_a_scenario_the_order_is_found_all_the_same() -> None:
    puts = unplanned_recording(seen("carried_bridge", 0.5), GIVEN, "log.csv").placements
    operations = load_scenario("carried_bridge").assembly.operations
    assert [(put.part, *put.carries) for put in puts[:4]] == [operation.moves for operation in operations[:4]]
    assert {puts[4].part, *puts[4].carries} == set(operations[4].moves)


def test_times_may_be_stated_and_operations_left_out() -> None:
    tracks = seen(NAME, 0.5)
    by_time = imported(tracks, stated=Stated(ends=(2.2, 4.0, 5.8)))
    assert np.array_equal(by_time.observation.poses, imported(tracks).observation.poses)
    hidden = imported(tracks, stated=Stated(unseen=(1,)))
    assert hidden.observation.observed.tolist() == [True, False, True]
    with pytest.raises(InputError, match=r"'castle2' of operation 2 does not rest at 3\.3 s"):
        imported(tracks, stated=Stated(ends=(2.2, 3.3, 5.8)))


MODEL = pose.at((0.01, -0.02, 0.03), (20.0, -40.0, 60.0))
"""Where the frame of each part lies in the model of the tracker, whose poses the mistake is made in."""
MISTAKES = {
    "quaternion": lambda T: pose.unpack(pose.pack(T)[:, [0, 1, 2, 6, 3, 4, 5]]),
    "mirror": lambda T: T * mirror("y"),
    "inverted": pose.inverse,
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_another_convention_that_fits_better_is_named(mistake: str) -> None:
    wrong = MISTAKES[mistake]
    tracks = {part: PoseTrack(t, wrong(T @ pose.inverse(MODEL)) @ MODEL) for part, (t, T) in seen(NAME, 0.3).items()}
    with pytest.raises(InputError, match=f"no contact fits .* state another `{mistake}` in the camera file"):
        import_recording(tracks, KNOWN, load_scenario(NAME), NOTHING, "log.csv", dict.fromkeys(tracks, MODEL))


def without(track: PoseTrack, first_s: float, last_s: float) -> PoseTrack:
    """The frames outside of a time."""
    kept = (track.t < first_s) | (track.t > last_s)
    return PoseTrack(track.t[kept], track.T[kept])


def test_a_part_that_is_hidden_while_others_are_placed_is_where_it_is_seen_again() -> None:
    tracks = seen(NAME, 0.5)
    whole = imported(tracks)
    # The stick waits hidden while both castles are placed, and is seen again shortly before it is taken.
    recording = imported({**tracks, "stick": without(tracks["stick"], 0.6, 3.9)})
    assert np.allclose(recording.observation.poses, whole.observation.poses, atol=1e-4)
    # It is taken while it is hidden.
    later = imported({**tracks, "stick": without(tracks["stick"], 0.6, 4.8)})
    assert re.fullmatch(r"'stick' was hidden from 0\.[56]\d to 4\.8\d s", *later.doubts)
    off = pose.log(pose.inverse(whole.observation.poses) @ later.observation.poses)
    assert np.abs(off[:, :3]).max() < 1e-3
    assert all(np.linalg.norm(twist[:3]) < 1e-3 for each in later.operations for twist in each.adjusted.values())


def test_a_part_that_is_placed_while_it_is_hidden_is_where_it_is_seen_again() -> None:
    """The first castle has no frames until the second one stands on the table, and the tower needs it there."""
    tracks = seen(NAME, 0.5)
    whole = imported(tracks)
    recording = imported({**tracks, "castle1": without(tracks["castle1"], -1.0, 3.9)})
    off = pose.log(pose.inverse(whole.observation.poses) @ recording.observation.poses)
    assert np.abs(off[:, :3]).max() < 1e-3
    assert recording.arrangement.start_source["castle1"] == "scenario"
    assert all(not each.adjusted for each in recording.operations)


def test_a_part_that_is_never_seen_at_a_place_is_not_observed_there() -> None:
    """The fixture A is hidden in a hand, put down, taken again, and seen in the hand."""
    name = "fixture_alignment"
    tracks = seen(name, 0.5)
    recording = imported({**tracks, "B": without(tracks["B"], 1.5, 4.7)}, name=name)
    assert recording.observation.observed.tolist() == [False, True, True]
    assert any("operation 1 (B) was not observed" in doubt for doubt in recording.doubts)


def test_a_log_may_end_before_the_last_operations_and_not_leave_out_others() -> None:
    tracks = {part: PoseTrack(t[t < 2.6], T[t < 2.6]) for part, (t, T) in seen(NAME, 0.5).items()}
    recording = imported(tracks)
    assert recording.observation.observed.tolist() == [True, False, False]
    assert any("operation 3 (stick) was not observed" in doubt for doubt in recording.doubts)
    with pytest.raises(InputError, match="the log shows no operation"):
        imported({part: PoseTrack(t[t < 1.7], T[t < 1.7]) for part, (t, T) in tracks.items()})
    tracks = seen(NAME, 0.5)
    with pytest.raises(InputError, match="have another order"):
        imported({**tracks, "castle1": tracks["castle2"], "castle2": tracks["castle1"]})


def test_a_round_part_that_spins_rests_and_may_be_hidden_while_another_is_placed() -> None:
    name = "peg_in_hole"
    tracks = seen(name, 0.5)
    base = place_layout(load_scenario(name), 0.1, 0.0, 0.3, clearance_mm=load_scenario(name).clearance_mm).start["base"]
    camera = replace(GIVEN, known={"base": base})
    whole = imported(tracks, camera, name)
    t, T = tracks["peg"]
    spin = np.array([pose.at((0.0, 0.0, 0.0), (0.0, 0.0, 30.0 * x)) for x in t])
    spun = without(PoseTrack(t, T @ spin), 0.6, 2.5)
    found = imported({**tracks, "peg": spun}, camera, name)
    off = pose.log(pose.inverse(whole.observation.poses) @ found.observation.poses)
    assert np.abs(off[:, :3]).max() < 5e-4
    assert np.abs(off[:, 3:5]).max() < 5e-3  # not about the axis, z
    size = [np.diagonal(each.covariance, axis1=1, axis2=2) for each in (found, whole)]
    assert np.allclose(*size, rtol=1.0)  # variances of means of 24 frames
    assert any(doubt.startswith("'peg' was hidden") for doubt in found.doubts)


def test_a_part_that_moves_during_the_operation_of_another_is_refused() -> None:
    tracks = seen(NAME, 0.3)
    pushed = pose.at((0.03, 0.0, 0.0))
    t, T = tracks["castle1"]
    aside = PoseTrack(t, np.where((t > 4.5)[:, None, None], T @ pushed, T))
    with pytest.raises(
        InputError,
        match=r"log\.csv: 'castle1' moved by 30 mm and 0 deg during operation 3 \('stick'\), which should not move it, "
        r"\d\d standard deviations .* state when operations ended by --operation-ends",
    ):
        imported({**tracks, "castle1": aside})
    # An adjustment is counted into the error.
    nudged = PoseTrack(t, np.where((t > 4.5)[:, None, None], T @ pose.at((0.004, 0.0, 0.0)), T))
    assert imported({**tracks, "castle1": nudged}).observation.covariance[0, 0, 0] > 0.003**2


def test_a_fixed_part_is_where_it_was_seen_or_stated_though_the_assembly_stands_elsewhere() -> None:
    name = "peg_in_hole"
    scenario = load_scenario(name)
    base = place_layout(scenario, 0.1, 0.0, 0.3, clearance_mm=scenario.clearance_mm).start["base"]
    tracks = seen(name, 0.3)
    with pytest.raises(InputError, match="no contact fits"):
        imported(tracks, name=name)
    stated = imported(tracks, replace(GIVEN, known={"base": base}), name)
    assert stated.arrangement.start_source["base"] == "known"
    assert np.allclose(stated.observation.start["base"], base)
    still = PoseTrack(tracks["peg"].t, np.tile(pose.inverse(CAMERA) @ base, (len(tracks["peg"].t), 1, 1)))
    tracked = imported({**tracks, "base": still}, name=name)
    assert tracked.arrangement.start_source["base"] == "seen"
    assert np.abs(tracked.observation.start["base"] - base).max() < 1e-6
    with pytest.raises(InputError, match="tracked part"):
        imported(tracks, replace(GIVEN, known={"plate2": base}), name)

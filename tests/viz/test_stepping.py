"""Stepping through a story: the same place is shown in a window and in a browser."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import mujoco
import numpy as np
import pytest

from apo_bench import Scene, SweepConfig, run_sweep
from apo_bench.cli.app import main
from apo_bench.geometry import pose
from apo_bench.simulation.film.shapes import shapes_of, surface
from apo_bench.simulation.film.track import read_part_poses
from apo_bench.simulation.film.window import WINDOW_KEYS, step_in_window
from apo_bench.simulation.scene.world import make_initial_state
from apo_bench.trial.rollout import AS_CORRECTED, AS_OBSERVED, AS_TRUE, Rollout, scenario_story
from apo_bench.viz.repeat_trial import repeat_trial
from apo_bench.viz.rollout_cursor import FACES, Cursor


def with_target_poses(scene: Scene) -> Rollout:
    """What the tower asks for, as if it had been seen 1 cm aside."""
    rollout = scenario_story(scene)
    true = scene.scenario.nominal_poses
    aside = np.array(true)
    aside[:, 0, 3] += 0.01
    return Rollout(scene, rollout.segments, rollout.assembled, {AS_OBSERVED: aside, AS_TRUE: true})


def test_a_scenario_is_stepped_through_operation_by_operation(tower: Scene) -> None:
    cursor = Cursor(scenario_story(tower))
    assembly = tower.scenario.assembly
    assert cursor.snapshot().faces == ()
    seen = []
    for _ in range(4):
        cursor.press("next operation")
        seen.append(cursor.moment.phase.operation)
    assert seen == [0, 1, 2, 2]
    last = cursor.snapshot()
    assert set(last.faces) == {of for contact in assembly.operations[2].contacts for of in contact}
    assert last.words[0].endswith("operation 3 of 3, stick: in place")
    poses = read_part_poses(last.segment, last.moment)
    for part, T in cursor.rollout.assembled.items():
        np.testing.assert_allclose(poses[part], T, atol=1e-9)
    cursor.press("previous operation")
    assert cursor.moment.phase.operation == 1
    for faces in (FACES[2], FACES[0]):
        cursor.press("faces")
        assert cursor.faces == faces
    cursor.press("play")
    cursor.pass_time(10.0)
    assert (cursor.place, cursor.playing) == (3, False)


def test_goals_are_laid_over_the_parts_and_said_in_millimetres(tower: Scene) -> None:
    cursor = Cursor(with_target_poses(tower))
    cursor.go(2)
    assert "as observed: 10.00 mm, 0.00 degrees off" in cursor.words()
    assert "as it is now: 0.00 mm, 0.00 degrees off" in cursor.words()
    assert cursor.snapshot().overlays == ()
    cursor.press("goals")
    seen, true = cursor.snapshot().overlays
    assert sorted(seen.poses) == sorted(true.poses) == ["castle1", "castle2"]
    assert cursor.words()[-2:] == ("orange: as observed", "violet: true")
    shifts = [seen.poses[part][:3, 3] - true.poses[part][:3, 3] for part in seen.poses]
    np.testing.assert_allclose(shifts, [(0.01, 0.0, 0.0)] * 2, atol=1e-12)
    shapes = list(shapes_of(tower, make_initial_state(tower.work, cursor.segment.start), cursor.snapshot()))
    labels = [kind.label for kind, _ in shapes if kind.label]
    assert labels == [str(face) for face in cursor.snapshot().faces]
    names = [tower.work.free.index("castle1"), tower.work.free.index("castle2")]
    pieces = sum(int(part) in names for part in tower.work.geom_part)
    assert sum(kind.rgba[3] == np.float32(0.4) for kind, _ in shapes) == 2 * pieces


def test_shapes_are_as_large_as_what_they_stand_for_and_where_it_is(tower: Scene) -> None:
    """The castles and the stick at the end: the corners of all their shapes are those of their solids."""
    cursor = Cursor(scenario_story(tower))
    cursor.go(3)
    poses = read_part_poses(cursor.segment, cursor.moment)
    points = []
    for kind, at in shapes_of(tower, make_initial_state(tower.work, cursor.segment.start), cursor.snapshot()):
        color = next((part for part, rgb in tower.scenario.colors.items() if np.allclose(kind.rgba[:3], rgb)), None)
        if color in tower.work.free and not kind.label:
            points.append(pose.apply(pose.unpack(at), surface(tower.work.model, kind).vertices))
    found = np.concatenate(points)
    corners = [pose.apply(poses[part], tower.scenario.assembly.solids[part].bounds) for part in tower.work.free]
    for side in (np.min, np.max):
        np.testing.assert_allclose(side(found, axis=0), side(np.concatenate(corners), axis=0), atol=5e-4)


class Window:
    """What MuJoCo's window is asked for; keys are pressed one a picture, then it is closed."""

    def __init__(self, model: Any, key_callback: Any, codes: list[int]) -> None:
        self.user_scn = mujoco.MjvScene(model, maxgeom=2000)
        self.cam = mujoco.MjvCamera()
        self.texts: list[str] = []
        self.drawn: list[int] = []
        self._press = key_callback
        self._codes = codes

    def __enter__(self) -> Window:
        return self

    def __exit__(self, *_: object) -> None:
        self.closed = True

    lock = lambda self: self  # noqa: E731

    def is_running(self) -> bool:
        if not self._codes:
            return False
        self._press(self._codes.pop(0))
        return True

    def sync(self) -> None:
        self.drawn.append(self.user_scn.ngeom)

    def set_texts(self, texts: Any) -> None:
        self.texts.append(texts[0][2])


def test_keys_of_the_window_move_what_is_shown(tower: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    windows: list[Window] = []
    codes = [next(code for code, key in WINDOW_KEYS.items() if key == wanted) for wanted in ("next operation", "goals")]

    def launch(model: Any, data: Any, key_callback: Any, **_: Any) -> Window:
        windows.append(Window(model, key_callback, [0, *codes]))
        return windows[0]

    monkeypatch.setitem(sys.modules, "mujoco.viewer", SimpleNamespace(launch_passive=launch))
    monkeypatch.setattr(mujoco, "viewer", SimpleNamespace(launch_passive=launch), raising=False)
    cursor = Cursor(with_target_poses(tower))
    step_in_window(tower, cursor.rollout.assembled, cursor.snapshot, cursor.press, cursor.pass_time)
    (window,) = windows
    assert ["at the start" in window.texts[0], "operation 1 of 3" in window.texts[1]] == [True, True]
    assert window.drawn[0] == 0 < window.drawn[1] < window.drawn[2]
    assert window.cam.distance > 0.1


def test_a_trial_of_a_sweep_is_run_again(tmp_path: Path) -> None:
    asked = SweepConfig(
        ("block_on_block",),
        noise_level=(3.0,),
        human_error_scale=(0.0,),
        method=("contact",),
        trials=1,
        fidelity="near-contact",
    )
    (row,) = run_sweep(asked, tmp_path / "run")
    again, rollout = repeat_trial(tmp_path / "run", None)
    assert {name: again[name] for name in ("success", "worst_gap_mm")} == {
        name: row[name] for name in ("success", "worst_gap_mm")
    }
    assert set(rollout.poses) == {AS_OBSERVED, AS_CORRECTED, AS_TRUE}
    reached = read_part_poses(rollout.segments[1], rollout.segments[1].moments[-1])
    assert row["final_poses"] is not None
    for part, packed in row["final_poses"].items():
        np.testing.assert_allclose(1e3 * reached[part][:3, 3], packed[:3], atol=0.01)
    assert main(["view", str(tmp_path / "run"), "--trial", "2", "--port", "0"]) == 2


def test_where_nothing_can_be_shown_one_sentence_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("apo_bench.viz.choose_viewer.no_window", lambda: "no window can be opened here (none)")
    monkeypatch.setattr("apo_bench.viz.choose_viewer.explain_missing_browser", lambda: "viser is not installed")
    said = {
        ("view", "stick_in_tower"): "no window can be opened here (none), and for a browser viser is not installed",
        ("view", "stick_in_tower", "--port", "8090"): "--port 8090 needs a browser, but viser is not",
        ("view", "stick_in_tower", "--trial", "1"): "--trial and --secret-seed-file belong to the folder of a sweep",
        ("run", "stick_in_tower", "--view"): "no window can be opened here (none)",
    }
    for request, sentence in said.items():
        assert main(request) == 2
        assert sentence in capsys.readouterr().err


def test_clicks_in_a_browser_move_the_cursor(tower: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Buttons and the slider do what stands on them; viser itself is played by a stand-in that keeps callbacks."""
    from apo_bench.viz import browser

    server = MagicMock()
    monkeypatch.setattr(browser, "_start_server", lambda _: server)
    page = browser.Page(with_target_poses(tower), 8080)
    cursor = page.cursor
    groups = server.gui.add_button_group.call_args_list
    clicked = server.gui.add_button_group.return_value.on_click.call_args_list

    def happen(callback: Any, value: Any) -> None:
        callback.args[0](SimpleNamespace(target=SimpleNamespace(value=value)))

    def click(label: str) -> None:
        happen(next(on for group, on in zip(groups, clicked, strict=True) if label in group.args[1]), label)

    assert cursor.place == len(cursor.places) - 1  # the outcome
    cursor.go(0)
    for label, place in (("moment on", 1), ("moment on", 2), ("moment back", 1), ("operation on", 2)):
        click(label)
        page.draw()
        assert cursor.place == place == server.gui.add_slider.return_value.value
    click("play / stop")
    click("target poses")
    page.draw()
    assert (cursor.playing, cursor.shows_goals) == (True, True)
    click("play / stop")
    happen(server.gui.add_slider.return_value.on_update.call_args, 1)
    page.draw()
    assert cursor.place == 1
    page.close()
    server.stop.assert_called_once()

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

from apo_bench import Scene, SweepSettings, run_sweep
from apo_bench.cli.app import main
from apo_bench.show.stepping import FACES, Cursor
from apo_bench.show.viewing import trial_again
from apo_bench.simulation.film.still import body_meshes, body_poses, draw_over, part_meshes, part_poses, show_moment
from apo_bench.simulation.film.window import WINDOW_KEYS, step_in_window
from apo_bench.simulation.scene.world import initial_state
from apo_bench.trial.story import AS_CORRECTED, AS_SEEN, AS_TRUE, Story, scenario_story


def with_goals(scene: Scene) -> Story:
    """What the tower asks for, as if it had been seen 1 cm aside."""
    story = scenario_story(scene)
    true = scene.scenario.goals
    aside = np.array(true)
    aside[:, 0, 3] += 0.01
    return Story(scene, story.chapters, story.assembled, {AS_SEEN: aside, AS_TRUE: true})


def test_a_scenario_is_stepped_through_operation_by_operation(tower: Scene) -> None:
    cursor = Cursor(scenario_story(tower))
    assembly = tower.scenario.assembly
    assert cursor.still().faces == ()
    seen = []
    for _ in range(4):
        cursor.press("next operation")
        seen.append(cursor.at.doing.operation)
    assert seen == [0, 1, 2, 2]
    last = cursor.still()
    assert set(last.faces) == {of for contact in assembly.operations[2].contacts for of in contact}
    assert last.words[0].endswith("operation 3 of 3, stick: in place")
    poses = part_poses(last.chapter, last.moment)
    for part, T in cursor.story.assembled.items():
        np.testing.assert_allclose(poses[part], T, atol=1e-9)
    cursor.press("previous operation")
    assert cursor.at.doing.operation == 1
    for faces in (FACES[2], FACES[0]):
        cursor.press("faces")
        assert cursor.faces == faces
    cursor.press("play")
    cursor.pass_time(10.0)
    assert (cursor.moment, cursor.playing) == (3, False)


def test_goals_are_laid_over_the_parts_and_said_in_millimetres(tower: Scene) -> None:
    cursor = Cursor(with_goals(tower))
    cursor.go(2)
    assert "as seen: 10.00 mm, 0.00 degrees off" in cursor.words()
    assert "as it is now: 0.00 mm, 0.00 degrees off" in cursor.words()
    assert cursor.still().ghosts == ()
    cursor.press("goals")
    ghosts = cursor.still().ghosts
    assert [(ghost.name, sorted(ghost.poses)) for ghost in ghosts] == [
        (name, ["castle1", "castle2"]) for name in (AS_SEEN, AS_TRUE)
    ]
    shifts = [ghosts[0].poses[part][:3, 3] - ghosts[1].poses[part][:3, 3] for part in ghosts[0].poses]
    np.testing.assert_allclose(shifts, [(0.01, 0.0, 0.0)] * 2, atol=1e-12)

    drawn = mujoco.MjvScene(tower.work.model, maxgeom=2000)
    draw_over(tower, cursor.still(), drawn)
    geoms = drawn.geoms[: drawn.ngeom]
    labels = [geom.label for geom in geoms if geom.type == mujoco.mjtGeom.mjGEOM_LABEL]
    assert labels == [str(face) for face in cursor.still().faces]
    ours = tower.work.geom_part
    pieces = sum(
        int(ours[i]) in (tower.work.free.index("castle1"), tower.work.free.index("castle2")) for i in range(len(ours))
    )
    assert sum(bool(geom.rgba[3] == np.float32(0.4)) for geom in geoms) == 2 * pieces


def test_shapes_are_as_large_as_what_they_stand_for(tower: Scene) -> None:
    for part in tower.work.free:
        points = np.concatenate([shape.vertices for shape in part_meshes(tower.work, part)])
        bounds = tower.scenario.assembly.solids[part].bounds
        np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], bounds, atol=5e-4)  # the clearance
    chapter = scenario_story(tower).chapters[0]
    data = initial_state(tower.work, chapter.start)
    show_moment(tower, data, chapter, chapter.moments[-1])
    poses = body_poses(data)
    found = body_meshes(tower.work)
    assert len(poses) == tower.work.model.nbody
    assert {shape.part for shape in found} == {None, *tower.scenario.assembly.solids}
    for shape in found:
        assert shape.triangles.max() < len(shape.vertices)


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
    cursor = Cursor(with_goals(tower))
    step_in_window(tower, cursor.story.assembled, cursor.still, cursor.press, cursor.pass_time)
    (window,) = windows
    assert ["at the start" in window.texts[0], "operation 1 of 3" in window.texts[1]] == [True, True]
    assert window.drawn[0] == 0 < window.drawn[1] < window.drawn[2]
    assert window.cam.distance > 0.1


def test_a_trial_of_a_sweep_is_run_again(tmp_path: Path) -> None:
    asked = SweepSettings(
        ("block_on_block",), levels=(3.0,), careless=(0.0,), methods=("contact",), trials=1, fidelity="contact"
    )
    (row,) = run_sweep(asked, tmp_path / "run")
    again, story = trial_again(tmp_path / "run", None)
    assert {name: again[name] for name in ("success", "worst_gap_mm")} == {
        name: row[name] for name in ("success", "worst_gap_mm")
    }
    assert set(story.goals) == {AS_SEEN, AS_CORRECTED, AS_TRUE}
    reached = part_poses(story.chapters[1], story.chapters[1].moments[-1])
    assert row["reached"] is not None
    for part, packed in row["reached"].items():
        np.testing.assert_allclose(1e3 * reached[part][:3, 3], packed[:3], atol=0.01)
    assert main(["view", str(tmp_path / "run"), "--trial", "2", "--port", "0"]) == 2


def test_where_nothing_can_be_shown_one_sentence_says_so(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("apo_bench.show.viewing.no_window", lambda: "no window can be opened here (none)")
    monkeypatch.setattr("apo_bench.show.viewing.no_browser", lambda: "viser is not installed")
    said = {
        ("view", "stick_in_tower"): "no window can be opened here (none), and for a browser viser is not installed",
        ("view", "stick_in_tower", "--port", "8090"): "--port 8090 was given, which is for a browser, but viser is not",
        ("view", "stick_in_tower", "--port", "70000"): "a whole number from 1 to 65535 is allowed",
        ("view", "stick_in_tower", "--trial", "1"): "--trial, which is for the folder of a sweep",
        ("replay", "stick_in_tower", "--port", "8090"): "--port 8090, which is for --view, was given without it",
        ("replay", "stick_in_tower", "--view"): "no window can be opened here (none)",
    }
    for request, sentence in said.items():
        assert main(request) == 2
        assert sentence in capsys.readouterr().err


def test_a_browser_is_served_what_the_cursor_is_at(tower: Scene) -> None:
    pytest.importorskip("viser")
    from apo_bench.show.browser import serve_story

    said: list[str] = []
    serve_story(with_goals(tower), 18417, said.append, ends=lambda: bool(said))
    assert said[0].startswith("Open http://127.0.0.1:18")


def test_clicks_in_a_browser_move_the_cursor(tower: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Buttons, sliders and boxes do what stands on them; viser itself is played by a stand-in that keeps callbacks."""
    from apo_bench.show import browser

    server = MagicMock()
    sliders: list[Any] = []

    def slider(*_: Any, **__: Any) -> Any:
        sliders.append(MagicMock())
        return sliders[-1]

    server.gui.add_slider.side_effect = slider
    monkeypatch.setattr(browser, "_server", lambda _: server)
    page = browser.Page(with_goals(tower), 8080)
    cursor = page.cursor

    def click(label: str) -> None:
        event = SimpleNamespace(target=SimpleNamespace(value=label))
        for group, on_click in zip(server.gui.add_button_group.call_args_list, clicked, strict=True):
            if label in group.args[1]:
                on_click.args[0](event)

    clicked = server.gui.add_button_group.return_value.on_click.call_args_list
    assert cursor.moment == 0
    click("moment on")
    click("moment on")
    assert cursor.moment == 2
    click("moment back")
    assert cursor.moment == 1
    click("operation on")
    assert cursor.at.doing.operation == 1
    click("play / stop")
    assert cursor.playing
    click("play / stop")
    slid = sliders[0].on_update.call_args.args[0]
    slid(SimpleNamespace(target=SimpleNamespace(value=1)))
    assert cursor.moment == 1
    (seen, true) = (call.args[0] for call in server.gui.add_checkbox.return_value.on_update.call_args_list)
    seen(SimpleNamespace(target=SimpleNamespace(value=True)))
    assert cursor.goals == {AS_SEEN}
    true(SimpleNamespace(target=SimpleNamespace(value=True)))
    seen(SimpleNamespace(target=SimpleNamespace(value=False)))
    assert cursor.goals == {AS_TRUE}
    page.draw()
    assert sliders[0].value == 1
    page.close()
    server.stop.assert_called_once()

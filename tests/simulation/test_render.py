"""Pictures without a display, several renderers beside each other."""

import sys
from pathlib import Path

import numpy as np
import pytest

from apo_bench import Film, InputError, Scene, aim_camera, draw_layout
from apo_bench.simulation.scene.render import save_film
from apo_bench.simulation.scene.world import make_initial_state
from apo_bench.trial.request import Request, run_request

SIZE = (160, 120)


def test_the_end_of_one_film_does_not_spoil_the_next(tower: Scene) -> None:
    data = make_initial_state(tower.work, draw_layout(tower.scenario, np.random.default_rng(0)).start)
    first = Film(tower, width=SIZE[0], height=SIZE[1], camera=aim_camera(np.zeros(3), 1.0))
    first(data)
    second = Film(tower, width=SIZE[0], height=SIZE[1], camera=aim_camera(np.zeros(3), 1.0))
    first.close()
    second(data)
    assert np.array_equal(first.frames[0], second.frames[0])


def test_films_are_written_by_their_ending(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg, of the extra film, is not installed")
    frames = [np.full((64, 64, 3), v, dtype=np.uint8) for v in (0, 128, 255)]
    for name in ("a.mp4", "b.gif"):
        save_film(frames, tmp_path / name, fps=10)
        assert (tmp_path / name).stat().st_size > 100
    with pytest.raises(InputError, match=r"ends in \.mp4 or \.gif"):
        save_film(frames, tmp_path / "c.avi", fps=10)


def test_without_imageio_ffmpeg_a_gif_is_written_and_an_mp4_is_refused_before_the_trial(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    save_film([np.full((64, 64, 3), v, dtype=np.uint8) for v in (0, 128, 255)], tmp_path / "a.gif", fps=10)
    assert (tmp_path / "a.gif").read_bytes()[:3] == b"GIF"
    monkeypatch.setattr("apo_bench.trial.request.scene_of", lambda *_: pytest.fail("a scene was built"))
    sentence = "an MP4 film needs the package imageio-ffmpeg; install it with: pip install imageio-ffmpeg, or give a"
    with pytest.raises(InputError, match=sentence):
        run_request(Request("block_on_block", video=tmp_path / "a.mp4"))

"""Images in the observations of APOInsert-v0: two cameras, one renderer that is kept."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from apo_bench.envs.apo_insert import APOInsert
from apo_bench.simulation.scene import kept_renderer

STILL = np.zeros(6, dtype=np.float32)


@pytest.fixture
def env() -> APOInsert:
    return APOInsert("block_on_block", grasp="weld", pixels=("scene", "wrist"), render_mode="rgb_array")


def test_both_cameras_see_the_part_and_where_it_goes(env: APOInsert) -> None:
    seen, _ = env.reset(options={"trial": 3})
    assert env.observation_space.contains(seen)
    for camera in ("scene", "wrist"):
        picture = seen[f"pixels_{camera}"].astype(np.float64)
        assert picture.shape == (96, 96, 3)
        colours = np.ptp(picture, axis=2)
        assert (colours > 80).mean() > 0.02  # of a coloured block; arm, table and sky are grey or pale
    assert {"pixels_scene", "pixels_wrist"} < {*env.observation_groups["policy"]}


def test_one_renderer_serves_all_pictures_of_a_size(env: APOInsert, monkeypatch: pytest.MonkeyPatch) -> None:
    made = []
    renderer = kept_renderer.renderer
    monkeypatch.setattr(kept_renderer, "renderer", lambda *how: made.append(how) or renderer(*how))
    first, _ = env.reset(options={"trial": 3})
    env.step(STILL)
    again, _ = env.reset(options={"trial": 3})
    np.testing.assert_array_equal(first["pixels_wrist"], again["pixels_wrist"])
    assert len(made) == 1
    assert env.render().shape == (480, 640, 3)
    assert len(made) == 2
    env.close()


def test_a_copy_draws_what_the_original_would(env: APOInsert) -> None:
    env.reset(options={"trial": 3})
    env.step(STILL)
    copied = pickle.loads(pickle.dumps(env))
    here, there = (each.step(STILL)[0]["pixels_scene"] for each in (env, copied))
    np.testing.assert_array_equal(here, there)

"""Flat float32 observations, and actions from -1 to 1, in every environment."""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import apo_bench

ENVIRONMENTS = ("APOReplay-v0", "APOTrack-v0", "APOInsert-v0", "APOAssemble-v0")


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_gymnasium_has_no_complaint(name: str) -> None:
    env = apo_bench.Flatten(gymnasium.make(name, scenario="block_on_block", grasp="weld").unwrapped)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*is different from the unwrapped version")
        check_env(env, skip_render_check=True)


def test_a_flat_action_is_the_action_of_the_environment() -> None:
    plain: Any = gymnasium.make("APOReplay-v0", scenario="block_on_block", grasp="weld").unwrapped
    flat = apo_bench.Flatten(plain)
    seen, _ = flat.reset(seed=3)
    entries = np.concatenate([each.ravel() for _, each in sorted(plain.reset(seed=3)[0].items())])
    np.testing.assert_allclose(seen, entries, rtol=1e-6)
    with pytest.raises(apo_bench.InputError, match=r"shape \(3,\) from 0 to 0 was given .* shape \(12,\)"):
        flat.step(np.zeros(3, np.float32))
    action = np.linspace(-1.0, 1.0, 12, dtype=np.float32)
    np.testing.assert_allclose(flat._action(action), plain.action_space.high * action.reshape(2, 6), rtol=1e-6)

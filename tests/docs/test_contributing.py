"""CONTRIBUTING adds a corrector in sixty lines: its code corrects, and the files that it names exist."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench import draw_layout, load_scenario, observe
from apo_bench.records.methods import CORRECTORS
from tests import scenes

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
SECTION = TEXT.split("## Add a corrector\n")[1].split("\n## ")[0]
CODE, TEST = re.findall(r"^```python\n(.*?)^```$", SECTION, re.MULTILINE | re.DOTALL)


def test_the_section_is_short_and_names_files_that_exist() -> None:
    assert len(SECTION.strip().splitlines()) <= 60
    files = set(re.findall(r"`((?:apo_bench|docs)/[\w/.]+)`", SECTION)) - {"apo_bench/correction/baselines/upright.py"}
    assert len(files) > 2
    assert [name for name in files if not (ROOT / name).exists()] == []
    assert "upright" not in CORRECTORS


def test_the_corrector_passes_its_test_and_keeps_parts_upright() -> None:
    names: dict[str, Any] = {"np": np, "draw_layout": draw_layout, "load_scenario": load_scenario}
    exec(CODE + TEST, names)
    names["test_true_poses_stay"]()
    shown = scenes.shown(scenes.stick_in_tower())
    observation = observe(shown, "isotropic", np.random.default_rng(0), noise_level=2.0)
    corrected = names["upright"](observation).poses
    assert np.array_equal(corrected[:, :3, 3], observation.poses[:, :3, 3])
    assert np.allclose(np.abs(corrected[:, 2, 2]), 1.0)
    assert not np.allclose(np.abs(observation.poses[:, 2, 2]), 1.0, atol=1e-4)

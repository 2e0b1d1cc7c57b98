"""Draw what the depth camera measured, as `apo-bench inspect depth` does: `python docs/depth_camera.py` (seconds)."""

from __future__ import annotations

from pathlib import Path

from apo_bench.viz.depth_picture import draw_depth
from apo_bench.viz.depth_run import run_depth_camera

HERE = Path(__file__).parent
SHOWN = {"stick_in_tower": 7, "carried_bridge": 2}
"""Scenario and seed."""


def main() -> None:
    for scenario, seed in SHOWN.items():
        draw_depth(run_depth_camera(scenario, 1.0, seed, 1.0), HERE / "pictures" / f"depth_{scenario}.png")


if __name__ == "__main__":
    main()

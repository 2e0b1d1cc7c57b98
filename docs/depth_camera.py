"""Draw what the depth camera measured, as `apo-bench inspect depth` does: `python docs/depth_camera.py` (seconds)."""

from __future__ import annotations

from pathlib import Path

from apo_bench.viz.sensor import run_sensor
from apo_bench.viz.sensor_picture import draw_sensor

HERE = Path(__file__).parent
SHOWN = {"stick_in_tower": 7, "carried_bridge": 2}
"""Scenario and seed."""


def main() -> None:
    for scenario, seed in SHOWN.items():
        draw_sensor(run_sensor(scenario, 1.0, seed, 1.0), HERE / "pictures" / f"depth_{scenario}.png")


if __name__ == "__main__":
    main()

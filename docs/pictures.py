"""Draw pose estimates and two pictures of films: `python docs/pictures.py` (half a minute)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import imageio.v3 as imageio

from apo_bench.correction.correctors import correct
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.scenario.scenario_file import load_scenario
from apo_bench.simulation.film.film import frames
from apo_bench.simulation.scene.scene import build_scene
from apo_bench.trial.request import Request, run_request
from apo_bench.trial.rollout import Rollout
from apo_bench.trial.trial_stages import observe_demonstration, simulate_demonstration
from apo_bench.viz.poses_picture import draw_poses, make_poses_panel

HERE = Path(__file__).parent / "pictures"
SEED = 7
NOISE_LEVEL = 2.0


def main() -> None:
    scene = build_scene(load_scenario("stick_in_tower"))
    shown = simulate_demonstration(scene, 1.0, SEED)
    observed = observe_demonstration(shown, make_noise("isotropic", NoiseLevel(NOISE_LEVEL, NOISE_LEVEL)), SEED)
    corrected = correct(observed, "contact").poses
    panels = [
        make_poses_panel("observed", observed, observed.poses, 3),
        make_poses_panel("corrected by contacts", observed, corrected, 3),
    ]
    draw_poses(scene.scenario, 3, panels, HERE / "estimates.png")
    for method in ("uncorrected", "contact"):
        draw_film(method, HERE / f"film_{method}.png")


def draw_film(method: str, path: Path) -> None:
    """One picture of the film of a replay: how it ended where it failed, else the stick on its way in."""

    def keep(rollout: Rollout) -> None:
        replayed = rollout.segments[-1]
        inside = [m for m in replayed.moments if m.phase.operation == 2 and m.phase.macro.startswith("insert")]
        shown = replayed.moments if method == "uncorrected" else inside[: 3 * len(inside) // 4]
        *_, ended = pictures = [
            picture
            for picture, _ in frames(
                rollout.scene.scenario.assembly, rollout.assembled, [replace(replayed, moments=tuple(shown[-6:]))]
            )
        ]
        imageio.imwrite(path, ended if method == "uncorrected" else pictures[0])

    run_request(Request("stick_in_tower", {"noise_level": 1.0, "seed": SEED, "method": method}), keep)


if __name__ == "__main__":
    main()

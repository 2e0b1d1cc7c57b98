"""Draw the pictures of the README: `python docs/pictures.py` (about a minute, no display needed)."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt

from apo_bench.assembly.goals import Plan
from apo_bench.correction.correctors import correct
from apo_bench.observation.noise import Level, make_noise
from apo_bench.scenario.file import load_scenario
from apo_bench.show.believed_picture import belief_panel, draw_beliefs
from apo_bench.simulation.scene.render import Film, view
from apo_bench.simulation.scene.scene import build_scene
from apo_bench.trial.stages import attempt, see, show

HERE = Path(__file__).parent / "pictures"
SEED, LEVEL = 7, 2.0
CAPTIONS = ("castle 1 is put down", "castle 2 is put on it", "the stick comes", "it goes in, or not", "the end")


def main() -> None:
    scene = build_scene(load_scenario("stick_in_tower"))
    shown = show(scene, 1.0, SEED)
    seen = see(scene, shown, make_noise("isotropic", Level(LEVEL, LEVEL)), SEED)
    corrected = correct(seen, "paper").goals
    center = shown.layout.goals[0][:3, 3] + [0.0, 0.0, 0.05]
    for name, goals, title in (
        ("replay_none", seen.goals, "As it was seen, 2 mm and 2 degrees off"),
        ("replay_paper", corrected, "The same observation, corrected by its face contacts"),
    ):
        film = Film(
            scene, fps=4, speed=1.0, shadows=True, width=480, height=420, camera=view(center, 0.66, 118.0, -20.0)
        )
        tried = attempt(Plan(seen.assembly, seen.start, goals), scene, shown.layout.goals, film)
        _strip(
            HERE / f"{name}.png", film, f"{title}: {'right' if tried.verdict.success else tried.result.outcome.code}"
        )
    panels = [belief_panel("as seen", seen, seen.goals, 3), belief_panel("corrected by paper", seen, corrected, 3)]
    draw_beliefs(scene.scenario, 3, panels, HERE / "believed.png")


def _strip(path: Path, film: Film, title: str) -> None:
    """Five moments of a replay side by side."""
    n = len(film.frames)
    moments = [int(n * f) for f in (0.25, 0.57, 0.80, 0.885)] + [n - 1]
    figure, axes = plt.subplots(1, 5, figsize=(15, 3.1), layout="constrained")
    for axis, moment, caption in zip(axes, moments, CAPTIONS, strict=True):
        axis.imshow(film.frames[moment])
        axis.set_title(caption, fontsize=11)
        axis.axis("off")
    figure.suptitle(title, fontsize=13)
    figure.savefig(path, dpi=90)
    plt.close(figure)


if __name__ == "__main__":
    main()

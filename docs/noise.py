"""Write the cards of all noise models and draw their histograms: `python docs/noise.py` (half a minute)."""

from __future__ import annotations

from pathlib import Path

from apo_bench.benchmark.noise_card import described, draw, listed, measured
from apo_bench.benchmark.noise_picture import draw_histogram
from apo_bench.observation.noise import Level

HERE = Path(__file__).parent
PICTURE = "pictures/noise_{}.png"
LEVEL = Level(1.0, 1.0)
INTRODUCTION = """
A noise model is a function `noise(assembly, shown, rng) -> Observation`: from what was shown, without error, and
chance, it makes what was seen: goals, the covariance that the camera states of each, and whether the operation was
seen at all. `--noise` takes the names below, `package.module:name`, and in Python the function or class itself; a
class is made with the level. A plain function `(goals, rng) -> goals` will do if it says how large its errors are, in
attributes:

    def high(goals, rng):
        goals[:, 2, 3] += 0.002 * rng.random(len(goals))
        return goals

    high.deviation_mm, high.deviation_deg = 1.5, 0.1

In the formulas T is the pose of a part in the world, exp(xi) the displacement of a twist (x, y, z, rx, ry, rz) in the
part's own frame, e are independent standard normal numbers, and L is the level: in mm for positions, in degrees for
turns. Levels only scale the same draws, so one seed gives comparable errors at all of them, and at level 0 everything
is seen exactly as it was shown. What is stated also holds the mean square of the human's carelessness, where the
scenario has any, and at least 0.05 mm and 0.05 deg.

`tests/test_noise_laws.py` and, for what is measured, `tests/test_measured_noise.py` hold all of them to the same laws:
over seeds, errors have zero mean and the covariance that is declared; nothing depends on the choice of the world
frame; what was not seen is never carried out; what was seen reaches the robot bit for bit.

Pictures show the errors of 1000 observations at level 1, in the frame of the ray from the default camera to each part,
and as a line the Gaussian with the covariance that was stated; densities are logarithmic, and the outermost bins hold
all that is beyond. `apo-bench noise card NAME` prints a card with its histogram in text, `--level` and `--out` draw
others.
"""


def main() -> None:
    models = listed()
    lines = ["<!-- Written by `python docs/noise.py`; change the models, not this page. -->", "", "# Noise models"]
    lines += [INTRODUCTION, *(f"- [{name}](#{name}): {title}" for name, title in models.items())]
    for name in models:
        picture = PICTURE.format(name.replace("-", "_"))
        drawn = draw(name, LEVEL)
        draw_histogram(drawn, HERE / picture)
        lines += ["", f'<a id="{name}"></a>', "", described(name, 2)]
        lines += [f"![Errors of {name}]({picture})", "", f"*{measured(drawn, LEVEL)}.*"]
    (HERE / "noise.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""Write the sheets of all noise models: `python docs/noise_sheets.py` (a minute)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from apo_bench.correction.correctors import correct
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.observing import observe
from apo_bench.viz.noise_sheet import SCENARIO, draw_errors, list_models, noise_sheet, nominal_demonstration

HERE = Path(__file__).parent
PAGE = HERE / "reference" / "noise-models.md"
NOISE_LEVEL = NoiseLevel(1.0, 1.0)
INTRODUCTION = """
`--noise` takes the names below. [Your own noise](../guide/noise.md) describes how to write another one.

A noise model makes an observation of the true poses: the pose of each operation with an error, the covariance that
the camera states, and whether the operation was observed. In the formulas T is the pose of a part in the world,
exp(xi) the displacement of a twist (x, y, z, rx, ry, rz) in the part's own frame, e are independent standard normal
numbers, and L is the [noise level](glossary.md#noise-level): in mm for positions, in degrees for rotations. The noise
level only scales the same random numbers, so one seed gives comparable errors at all of them. At noise level 0 the
models below observe everything exactly. The stated covariance also holds the mean square of the human error, where
the scenario has one, and at least 0.05 mm and 0.05 degrees.

`tests/perception/observation/test_laws.py` and, for what is measured, `test_measured_noise.py` hold all of them to the
same laws: over seeds, errors have zero mean and the stated covariance; nothing depends on the choice of the world
frame; an operation that was not observed is marked; what was observed reaches the robot bit for bit.

Tables show the errors of 1000 observations at noise level 1, in the frame of the ray from the default camera to each
part: their standard deviation, the one that observations state, and percentiles of their size. `apo-bench noise show
NAME` prints a sheet, with `--noise-level` at another noise level.
"""

TRIALS = 200
TABLE = """
## Corrections by `contact`

{trials} observations of the nominal {scenario} at noise level 1, of measured noise as measured, without human error.
*Complete*: observations of every operation; others are not corrected. *Test fails*: in how many of the converged
corrections the chi-square test, at a level of {level:g} %, finds that the stated noise does not explain the correction.
All contacts are right, so that is a false alarm or a detected outlier. *Error*: root mean square of the positions per
axis, observed and corrected, of the same observations.

| noise | complete | test fails | error observed | corrected |
|---|---|---|---|---|
"""


def row(name: str) -> str:
    """Return the corrections of observations by one model, as a line of the table."""
    shown = nominal_demonstration()
    noise = make_noise(name, NOISE_LEVEL)
    complete = 0
    fails = 0
    observed_errors = []
    errors = []
    for seed in range(TRIALS):
        observation = observe(shown, noise, np.random.default_rng([seed, 2]))
        made = correct(observation, "contact")
        complete += int(observation.observed.all())
        if made.ok:
            assert made.test is not None
            fails += int(not made.test.passes)
            observed_errors.append(observation.poses[:, :3, 3] - shown.poses[:, :3, 3])
            errors.append(made.poses[:, :3, 3] - shown.poses[:, :3, 3])
    before, after = (f"{1e3 * np.sqrt(np.mean(np.square(some))):.2f} mm" for some in (observed_errors, errors))
    test = f"{fails} of {len(errors)}"
    return f"| [{name}](#{name}) | {complete} of {TRIALS} | {test} | {before} | {after} |"


def table(names: list[str]) -> list[str]:
    made = correct(
        observe(nominal_demonstration(), make_noise("isotropic", NOISE_LEVEL), np.random.default_rng(0)), "contact"
    )
    assert made.test is not None
    head = TABLE.format(trials=TRIALS, scenario=SCENARIO, level=100 * made.test.level)
    return [head.rstrip("\n"), *map(row, names)]


def main() -> None:
    models = list_models()
    lines = [
        "<!-- Written by `python docs/noise_sheets.py`; change the models, not this page. -->",
        "",
        "# Noise models",
    ]
    lines += [INTRODUCTION, *(f"- [{name}](#{name}): {title}" for name, title in models.items())]
    lines += table(list(models))
    for name in models:
        lines += [
            "",
            f'<a id="{name}"></a>',
            "",
            noise_sheet(name, NOISE_LEVEL, draw_errors(name, NOISE_LEVEL), 2).rstrip(),
        ]
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

"""Write the cards of all noise models: `python docs/noise.py` (a minute)."""

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
`--noise` takes the names below. [Your own noise](../guide/noise.md) says how to write another one.

A noise model makes an observation of the true poses: the pose of each operation with an error, the covariance that the
camera states, and whether the operation was seen. In the formulas T is the pose of a part in the world, exp(xi) the
displacement of a twist (x, y, z, rx, ry, rz) in the part's own frame, e are independent standard normal numbers, and L
is the [level](glossary.md#level): in mm for positions, in degrees for turns. Levels only scale the same random numbers, so
one seed gives comparable errors at all of them. At level 0 the models below see everything exactly. The stated
covariance also holds the mean square of the person's error, where the scenario has one, and at least 0.05 mm and 0.05
degrees.

`tests/perception/observation/test_laws.py` and, for what is measured, `test_measured_noise.py` there hold all of them
to the same laws: over seeds, errors have zero mean and the covariance that is declared; nothing depends on the choice
of the world frame; what was not seen says so; what was seen reaches the robot bit for bit.

Tables show the errors of 1000 observations at level 1, in the frame of the ray from the default camera to each part:
their standard deviation, the one that observations state, and percentiles of their size. `apo-bench noise show NAME`
prints a sheet, with `--noise-level` at another level.
"""

TRIALS = 200
TABLE = """
## What `contact` makes of them

{trials} observations of the nominal {scenario} at level 1, of measured noise as measured, without carelessness.
*Whole*: every operation was seen, else nothing is corrected. *Test fails*: of those for which consistent goals
were found near what was seen, how often the chi-square test, at a level of {level:g} %, says that the stated noise
does not explain the correction. All relations are right, so that is a false alarm, or an outlier that was noticed.
*Error*: root mean square of the positions of goals per axis, as seen and corrected, of the same observations.

| noise | whole | test fails | error seen | corrected |
|---|---|---|---|---|
"""


def row(name: str) -> str:
    """What `contact` makes of one model, as a line of the table."""
    shown = nominal_demonstration()
    noise = make_noise(name, NOISE_LEVEL)
    whole = 0
    fails = 0
    seen_off = []
    off = []
    for seed in range(TRIALS):
        seen = observe(shown, noise, np.random.default_rng([seed, 2]))
        made = correct(seen, "contact")
        whole += int(seen.observed.all())
        if made.ok:
            assert made.test is not None
            fails += int(not made.test.passes)
            seen_off.append(seen.poses[:, :3, 3] - shown.poses[:, :3, 3])
            off.append(made.poses[:, :3, 3] - shown.poses[:, :3, 3])
    before, after = (f"{1e3 * np.sqrt(np.mean(np.square(some))):.2f} mm" for some in (seen_off, off))
    test = f"{fails} of {len(off)}"
    return f"| [{name}](#{name}) | {whole} of {TRIALS} | {test} | {before} | {after} |"


def table(names: list[str]) -> list[str]:
    made = correct(
        observe(nominal_demonstration(), make_noise("isotropic", NOISE_LEVEL), np.random.default_rng(0)), "contact"
    )
    assert made.test is not None
    head = TABLE.format(trials=TRIALS, scenario=SCENARIO, level=100 * made.test.level)
    return [head.rstrip("\n"), *map(row, names)]


def main() -> None:
    models = list_models()
    lines = ["<!-- Written by `python docs/noise.py`; change the models, not this page. -->", "", "# Noise models"]
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

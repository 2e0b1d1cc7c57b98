"""Write the page of noise models: `python docs/noise_sheets.py` (a minute)."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

import numpy as np

from apo_bench.correction.correctors import correct
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.observe import observe
from apo_bench.viz.noise_sheet import (
    SCENARIO,
    describe_model,
    draw_errors,
    find_facts,
    list_models,
    make_nominal_demonstration,
)

PAGE = Path(__file__).parent / "reference" / "noise-models.md"
NOISE_LEVEL = NoiseLevel(1.0, 1.0)
TRIALS = 200
HEAD = f"""\
<!-- Written by `python docs/noise_sheets.py`; change the models, not this page. -->

# Noise models

Choose the errors of observed poses here: `--noise NAME` takes the names below, `apo-bench noise show NAME` prints the
errors of one model with percentiles, and [a function of yours](../guide/noise.md) can replace it.

A noise model draws an observation of the true poses: for each operation a pose with an error, the stated covariance,
and whether it was observed. One seed gives comparable errors at every [noise level](glossary.md#noise-level) L, which
only scales the random numbers. At level 0 every model is exact. The stated covariance also
has the mean square of the human error, and is at least 0.05 mm and 0.05 degrees.

## Errors and corrections

All at noise level 1, without human error:

- *across* to *about*: standard deviations of 1,000 observations of {SCENARIO} in the frame of the ray from the
  camera, found / stated;
- *complete*: how many of {TRIALS} observations have every operation; `contact` corrects these;
- *test fails*: corrections that the stated noise does not explain (chi-square test at 1 %);
- *position error*: root mean square per axis, observed and corrected.

| noise | across, mm | along, mm | tilt, deg | about, deg | complete | test fails | position error, mm |
|---|---|---|---|---|---|---|---|
"""
FORMULAS = """

## Formulas

- T: the pose of a part in the world.
- exp(xi): the displacement of a twist (x, y, z, rx, ry, rz) in the frame of the part.
- e: independent standard normal numbers.
- L: the noise level in mm and degrees.

Tests hold every model to one set of laws: zero mean and the stated covariance over seeds, and no dependence on the
world frame.
"""


def row(name: str) -> str:
    """Return the errors of one model and the corrections of its observations, as a line of the table."""
    sample = draw_errors(name, NOISE_LEVEL)
    found = np.sqrt(np.mean(sample.errors**2, axis=0))
    errors = " | ".join(f"{a:.3g} / {b:.3g}" for a, b in zip(found, sample.stated, strict=True))
    shown = make_nominal_demonstration()
    noise = make_noise(name, NOISE_LEVEL)
    complete = 0
    fails = 0
    before = []
    after = []
    for seed in range(TRIALS):
        observation = observe(shown, noise, np.random.default_rng([seed, 2]))
        made = correct(observation, "contact")
        complete += int(observation.observed.all())
        if made.ok:
            assert made.test is not None
            fails += int(not made.test.passes)
            before.append(observation.poses[:, :3, 3] - shown.poses[:, :3, 3])
            after.append(made.poses[:, :3, 3] - shown.poses[:, :3, 3])
    position = " to ".join(f"{1e3 * np.sqrt(np.mean(np.square(some))):.2f}" for some in (before, after))
    return f"| [{name}](#{name}) | {errors} | {complete} | {fails} of {len(after)} | {position} |"


def main() -> None:
    titles = list_models()
    lines = [HEAD + "\n".join(map(row, titles)), FORMULAS]
    for _, same in groupby(titles, find_facts):
        group = list(same)
        lines += [f'<a id="{name}"></a>' for name in group]
        lines += ["", describe_model(group[0], 3).replace(f"### {group[0]}:", f"### {', '.join(group)}:", 1)]
        lines += [f"- `{name}`: {titles[name]}." for name in group if len(group) > 1]
    PAGE.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()

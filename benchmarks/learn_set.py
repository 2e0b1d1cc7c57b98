"""Trains the network of `learned-set+contact`, and says what it is worth: `python -m benchmarks.learn_set`.

    python -m benchmarks.learn_set draw FILE.npz     # observations and truth as tokens, no physics (ten minutes)
    python -m benchmarks.learn_set train FILE.npz    # writes assets/learned/set.npz; needs PyTorch, any build
    python -m benchmarks.learn_set compare           # beside contact and contact-robust; writes its page
    python -m benchmarks.learn_set means             # of errors that stay: `class_mean`; writes the end of the page

Trained on generated assemblies of families that are not held out, none of which a track has, and on the noises of
`NOISES`; compared on scenarios of the package, on families held out, and on noises that it never saw. Right is what
`benchmarks.failures` calls right: fixed directions within the play, every contact covered, the plan foretold to fit.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, final

import numpy as np

from apo_bench import Assembly, Demonstration, Observation, draw_layout, load_scenario
from apo_bench.assembly import lowered_observation
from apo_bench.correction.correctors import correct
from apo_bench.correction.learned.class_mean import ClassMean, class_mean
from apo_bench.correction.learned.network import GROSS_SCALE, Tokens, forward, learned_set, shapes, tokens
from apo_bench.datasets import pairs
from apo_bench.generated import FAMILIES
from apo_bench.geometry import pose
from apo_bench.observation.looking import observe
from apo_bench.observation.models.isotropic import Isotropic
from apo_bench.observation.noise import Level, make_noise
from apo_bench.scenario.scenario import Scenario
from apo_bench.trial.outcome_columns import goal_errors
from benchmarks.failures import right

ROOT = Path(__file__).resolve().parents[1]
WEIGHTS = ROOT / "assets" / "learned" / "set.npz"
RESULT = ROOT / "benchmarks" / "results" / "learn_set.json"
MEANS = ROOT / "benchmarks" / "results" / "class_mean.json"
PAGE = ROOT / "docs" / "results" / "learned-set.md"
STREAM = 0x6C736574
NOISES = ("isotropic", "per-part", "camera", "heavy-tailed", "outliers", "flips", "megapose-lmo")
LEVELS = (0.5, 1.0, 2.0)
ASSEMBLIES = range(1000, 1006)
"""Seeds of each family; tracks have others."""
EACH = 30
"""Observations of each assembly, noise and level."""
STEPS = 6000
BATCH = 64
RATE = 2e-3
TRIED = (
    "stick_in_tower",
    "carried_bridge",
    "vanished_fixture",
    "pocket_table",
    "generated:castles:0",
    "generated:rods:0",
)
TRIED_NOISES = ("isotropic", "outliers", "flips", "megapose-lmo", "megapose-tless", "rays", "stale", "swaps")
METHODS: dict[str, Any] = {"contact": "contact", "contact-robust": "contact-robust", "learned-set": learned_set}
PAIRS = (10, 100, 1000)
"""So many pairs a mean is learned from."""
OWN = 1.0 / 3.0
"""Of the level, what is drawn for each operation where models of parts are off by the level."""


@final
@dataclass(frozen=True)
class ModelsOff:
    """The model of each part is off by a twist that stays for ever, and what is seen errs by a third of that besides.

    What is stated is how large both are, not which way, nor that the first is the same wherever a part is moved.
    """

    level: Level

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        seen = Isotropic(Level(*(OWN * size for size in self.level)))(assembly, demonstration, rng)
        mains = [operation.main for operation in assembly.operations]
        off = [np.random.default_rng([STREAM, *main.encode()]).standard_normal(6) for main in mains]
        goals = seen.goals @ pose.exp(np.array(off) * self.level.sigma())
        return replace(seen, goals=goals, covariance=seen.covariance + np.diag(self.level.sigma() ** 2))


TRIED_MEANS: dict[str, Any] = {
    "models of parts that are off for ever": ModelsOff,
    "`bias`": "bias",
    "`megapose-tless`": "megapose-tless",
}


def drawn(scenario: Scenario, noise: Any, level: float, seed: int) -> tuple[Demonstration, Observation]:
    """The truth and what a camera sees of it; no trial has these numbers of chance."""
    name = noise if isinstance(noise, str) else noise.__name__
    words = [STREAM, *scenario.name.encode(), *name.encode(), round(1e3 * level), seed]
    rng = np.random.default_rng(words)
    layout = draw_layout(scenario, rng, 0.0)
    n = len(layout.goals)
    shown = Demonstration(scenario.assembly, layout.start, layout.goals, layout.start, np.zeros((n, 6, 6)))
    return shown, observe(shown, make_noise(noise, Level(level, level)), rng)


def draw(out: Path) -> None:
    """Tokens and whitened errors of all assemblies, families that are not held out."""
    kept: dict[str, np.ndarray] = {}
    families = [name for name, family in FAMILIES.items() if family.weight]
    for number, (family, seed) in enumerate(product(families, ASSEMBLIES)):
        scenario = load_scenario(f"generated:{family}:{seed}")
        found = []
        for noise, level, i in product(NOISES, LEVELS, range(EACH)):
            shown, seen = drawn(scenario, noise, level, i)
            flat = lowered_observation(seen)
            L = np.linalg.cholesky(flat.covariance)
            xi = pose.log(pose.inverse(flat.goals) @ shown.goals)
            found.append((*tokens(flat), np.linalg.solve(L, xi[..., None])[..., 0], flat.seen))
        for name, column in zip((*Tokens._fields, "error", "seen"), zip(*found, strict=True), strict=True):
            kept[f"{number}.{name}"] = np.array(column, dtype=np.float32)
        print(scenario.name, len(found), flush=True)
    np.savez_compressed(out, **kept)


def train(given: Path) -> None:
    """The weights with the likeliest errors: a Gaussian of the scale and twist that are said, or a gross one."""
    import torch

    torch.set_num_threads(1)
    torch.manual_seed(0)
    rng = np.random.default_rng(STREAM)
    with np.load(given) as kept:
        data = {name: torch.from_numpy(kept[name]) for name in kept.files}
    assemblies = sorted({int(name.split(".")[0]) for name in data})
    weights = {
        name: torch.nn.Parameter(torch.randn(shape) / max(shape[0], 1) ** 0.5 if len(shape) > 1 else torch.zeros(shape))
        for name, shape in shapes().items()
    }
    with torch.no_grad():
        weights["gate.w"] *= 0.1
        weights["said.w"] *= 0.1
    optimiser = torch.optim.Adam(weights.values(), lr=RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, STEPS)
    began = time.process_time()
    losses = []
    for step in range(STEPS):
        a = assemblies[int(rng.integers(len(assemblies)))]
        some = torch.from_numpy(rng.integers(len(data[f"{a}.seen"]), size=BATCH))
        batch = Tokens(*(data[f"{a}.{name}"][some] for name in Tokens._fields))
        said = forward(weights, batch, torch)
        error = data[f"{a}.error"][some]
        log_scale = said.log_scale.clamp(-3.0, 3.0)
        off = ((error - said.twist) ** 2).sum(-1)
        fine = -0.5 * off * torch.exp(-2 * log_scale) - 6 * log_scale + torch.nn.functional.logsigmoid(-said.gross)
        bad = (error**2).sum(-1) / GROSS_SCALE**2
        bad = -3.5 * torch.log1p(bad) - 6 * np.log(GROSS_SCALE) + torch.nn.functional.logsigmoid(said.gross)
        loss = -(torch.logaddexp(fine, bad) * data[f"{a}.seen"][some]).sum() / data[f"{a}.seen"][some].sum()
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(list(weights.values()), 1.0)
        optimiser.step()
        schedule.step()
        losses.append(float(loss))
        if step % 500 == 499:
            print(f"{step + 1}: {np.mean(losses[-500:]):.3f}, {time.process_time() - began:.0f} s", flush=True)
    WEIGHTS.parent.mkdir(exist_ok=True)
    np.savez_compressed(WEIGHTS, **{name: each.detach().numpy() for name, each in weights.items()})


def compared(seeds: int) -> Iterator[dict[str, Any]]:
    """How many each method has right, of so many observations of each scenario."""
    for noise, name in product(TRIED_NOISES, TRIED):
        scenario = load_scenario(name)
        counts: Counter[str] = Counter()
        for seed in range(10_000, 10_000 + seeds):
            shown, seen = drawn(scenario, noise, 1.0, seed)
            for method, corrector in METHODS.items():
                made = correct(seen, corrector)
                counts[method] += made.ok and right(scenario, shown, made.goals)
        line = {"noise": noise, "scenario": name, "of": seeds, **{method: counts[method] for method in METHODS}}
        print(line, flush=True)
        yield line


def unshared(observation: Observation) -> Any:
    """`contact`, not told that operations on one part share its error."""
    return correct(replace(observation, shared=()), "contact")


def mean_of(scenario: Scenario, noise: Any, n: int) -> ClassMean:
    """What n pairs tell of the errors that stay; no observation that is compared is one of them."""
    data = pairs(scenario, noise, n, level=1.0, careless=0.0)
    return class_mean(scenario.assembly, data.goals, data.truth, data.seen)


def means(seeds: int) -> Iterator[dict[str, Any]]:
    """By how much goals are off where contacts leave them free, median, [mm], and how many are right."""
    for label, noise in TRIED_MEANS.items():
        off: dict[str, list[float]] = {}
        count: Counter[str] = Counter()
        for name in TRIED:
            scenario = load_scenario(name)
            learned = {f"class-mean+contact of {n} pairs": mean_of(scenario, noise, n) for n in PAIRS}
            methods = {"contact, not told what operations share": unshared, **METHODS, **learned}
            for seed in range(10_000, 10_000 + seeds):
                shown, seen = drawn(scenario, noise, 1.0, seed)
                for method, corrector in methods.items():
                    goals = correct(seen, corrector).goals
                    off.setdefault(method, []).append(goal_errors(seen.assembly, seen.start, shown.goals, goals)[1])
                    count[method] += right(scenario, shown, goals)
        found = {method: [float(np.median(mm)), count[method]] for method, mm in off.items()}
        print(label, found, flush=True)
        yield {"noise": label, "of": seeds * len(TRIED), "found": found}


def _page(lines: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    yield from (
        "# A learned corrector",
        "",
        "`learned-set` is told no model of outliers. A network of 20,000 weights, in which operations and contacts",
        "attend to each other, says which poses are grossly wrong and how wrong the others are. Poses that it does not",
        "believe are inferred from contacts, the others are corrected by them. It was trained on observations and",
        "truth of 60 generated assemblies of families that are not held out, with the noises",
        f"{', '.join(f'`{x}`' for x in NOISES)}.",
        "",
        "Written by `python -m benchmarks.learn_set compare`, no physics. Right are goals whose fixed directions are",
        "within the play, with every contact covered, whose plan is foretold to fit. 1 mm and 1 degree, the same draws",
        f"for every method, of {', '.join(f'`{x}`' for x in TRIED)}:",
        "none of them is what it was trained on. *Never seen*: noise that it was not trained on.",
        "",
        f"| noise | | of | {' | '.join(f'`{method}`' for method in METHODS)} |",
        "|---|---|---|---|---|---|",
    )
    for noise in TRIED_NOISES:
        own = [line for line in lines if line["noise"] == noise]
        total = sum(line["of"] for line in own)
        counts = [sum(line[method] for line in own) for method in METHODS]
        rates = " | ".join(f"{count} ({100 * count / total:.0f} %)" for count in counts)
        yield f"| `{noise}` | {'' if noise in NOISES else 'never seen'} | {total} | {rates} |"
    yield ""
    yield "`contact-robust` is told how often poses fail, and in which ways: that is what the difference is worth."
    yield from _page_of_means(json.loads(MEANS.read_text(encoding="utf-8")))


def _page_of_means(lines: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    yield """
## An error that stays needs a mean, and no network

Where the model of a part is off, every look at it is off alike. `apo_bench.correction.learned.class_mean` learns this
from pairs of observation and truth, such as [`pairs`](../guide/learning.md#pairs-of-observation-and-truth) draws, whose
seeds no trial has, and makes a corrector of it: `class-mean+contact` takes the mean error of each part off, then it is
`contact-robust`. It has no short name, since it has to be told pairs of the camera that it is for.

Written by `python -m benchmarks.learn_set means`, no physics: by how much goals are off in directions that contacts
leave free (median), and how many are right, 1 mm and 1 degree, of the scenarios above. *For ever*: models of parts are
off by 1 mm and 1 degree, the same in all observations, and each operation by a third of that besides. `bias`: models
are off alike, but anew in each observation.
"""
    yield "| method | " + " | ".join(f"{line['noise']}, {line['of']} of each" for line in lines) + " |"
    yield f"|---|{'---|' * len(lines)}"
    for method in lines[0]["found"]:
        cells = [line["found"][method] for line in lines]
        yield f"| {method} | " + " | ".join(f"{mm:.2f} mm, {count} right" for mm, count in cells) + " |"
    yield """
Success does not depend on it: what contacts fix they correct with or without a mean, and where they leave a part free
it may stand. The mean is worth what a part that no contact ties to this one asks for.
With `megapose-tless` gross errors decide, and half of 24 is a matter of few of them.

**Why not from the observation itself.** Operations on one part share its error, and `contact` is told so; that is what
the first two lines differ by. But few parts are moved twice in one demonstration (one of four in `carried_bridge`, none
in `stick_in_tower`), and an error that is the same in all looks is no difference of any two. The noise models of the
package have zero mean over trials, so there is nothing to take off, as the column `bias` shows: this is for cameras of
your own. What a camera always adds to its whole view is learned
[without the truth](../guide/noise.md#which-camera-is-this), by `noise learn --constant`."""


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("what", choices=("draw", "train", "compare", "means"))
    asked.add_argument("file", type=Path, nargs="?")
    asked.add_argument("--seeds", type=int, default=50)
    given = asked.parse_args()
    if given.what in ("compare", "means"):
        file, measured = (RESULT, compared) if given.what == "compare" else (MEANS, means)
        file.write_text(json.dumps(list(measured(given.seeds)), indent=1) + "\n", encoding="utf-8")
        PAGE.write_text("\n".join(_page(json.loads(RESULT.read_text(encoding="utf-8")))) + "\n", encoding="utf-8")
    else:
        (draw if given.what == "draw" else train)(given.file)


if __name__ == "__main__":
    main()

"""Trains the network of `dagger-insert` by DAgger, and says what it is worth: `python -m benchmarks.learn_insert`.

    python -m benchmarks.learn_insert draw FOLDER     # a round: what the student sees, what the teacher would do
    python -m benchmarks.learn_insert train FOLDER    # by all rounds, writes FOLDER/weights.npz; needs PyTorch
    python -m benchmarks.learn_insert compare FOLDER  # beside the approach, a spiral, and feeling; its page

Rounds of `draw` and `train` take turns; the student of the first round is the approach alone. The teacher is `expert`
of `apo_bench.envs.policies`, which sees where the part and its neighbours really are; in each episode it takes over at
a step that is drawn. FOLDER/weights.npz comes with the package as assets/learned/insert.npz. `compare` keeps a line for
each episode in FOLDER/compare.jsonl and goes on where it ended. Its layouts are trials from 0 on; those of training
begin at a million.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import count, product
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np

from apo_bench import InputError
from apo_bench.envs.apo_insert import APOInsert
from apo_bench.envs.dagger_insert import MIRRORS, SHAPES, VECTORS, DaggerInsert
from apo_bench.envs.policies import expert
from benchmarks.insertion import Spiral, Straight
from benchmarks.provenance import with_mujoco

ROOT = Path(__file__).resolve().parents[1]
WEIGHTS = ROOT / "assets" / "learned" / "insert.npz"
RESULT = ROOT / "benchmarks" / "results" / "learn_insert.jsonl"
PAGE = ROOT / "docs" / "results" / "dagger-insert.md"
TRAINED = ("stick_in_tower", "dovetail", "shaft_through_brackets")
NEVER = ("pocket_table", "peg_in_hole")
"""Scenarios that it is not trained on."""
TRIED = (*TRAINED, *NEVER)
LEVELS = (0.25, 0.5, 1.0)
FIRST = 1_000_000
"""The trial that training begins with."""
WEIGHTS_IN_ALL = sum((a + 1) * b for a, b in SHAPES)
POLICIES = ("straight", "spiral", "feel")
HORIZON = 120
"""Actions of an episode that is learned from."""
NOTE = """
**Three trainings.** `dagger-insert, 1` are the weights that come along: 26,125 steps of `stick_in_tower`, 5,653 of
`dovetail` and 5,779 of `shaft_through_brackets`, drawn in 12, 2 and 2 rounds; what the student is told was changed on
the way, so they cannot be drawn again bit for bit. 2 and 3 are other seeds of the last training, by the same rounds.
They are a baseline, and no good one: the spiral, which was written by hand, has more of the same trials right, and a
robot that feels before it inserts nearly all. With 20 layouts an interval is 40 points wide.

**Nothing to clone.** After its touches `feel` is the approach alone, actions of zero; what imitates it would be
`straight` with `feels=True`. In 150 trials of `stick_in_tower` that has 150 right, as has `contact-robust+probe` in the
bench (`python benchmarks/insertion.py stick_in_tower --feels --first 300 --trials 150`).

**What is to be felt.** Neighbours stand loose, so the approach pushes lightly where it is stopped, with 0.4 N in
`stick_in_tower`. With a sensor without noise, a stick that is off to one side in height turns the hand by some 4 mNm
more than one that is off to the other, at the same push, and each newton of the push by 36 mNm (the approach alone, 20
layouts, level 1). A reading has noise of 0.1 N and 5 mNm, so that six do not tell the side; a mean of thirty could. Of
two rounds held out, a network that was told six readings explained nothing of how far the stick is off in height while
it stands, and one that was told the mean since it stands a quarter of the variance.
"""
EPOCHS = 60
BATCH = 256
RATE = 1e-3


def error(noise_level: float) -> str:
    """What is wrong with the robot: hand and eye, by so many mm and a fifth of so many degrees."""
    return f"hand_eye:{noise_level:g}/{noise_level / 5:g}"


def made(scenario: str, noise_level: float, **more: Any) -> APOInsert:
    """The environment of a scenario, all but the error of the robot as usual."""
    env = gymnasium.make(
        "APOInsert-v0", scenario=scenario, robot_error=error(noise_level), disable_env_checker=True, **more
    ).unwrapped
    assert isinstance(env, APOInsert)
    return env


def loaded(file: Path) -> dict[str, Any]:
    """The weights of a file."""
    with np.load(file) as kept:
        return {name: kept[name].astype(np.float64) for name in kept.files}


def draw(folder: Path, scenarios: Sequence[str], levels: Sequence[float], episodes: int) -> None:
    """A round of each scenario: so many episodes under the student of now, all of layouts that no round had yet."""
    weights = loaded(folder / "weights.npz") if (folder / "weights.npz").exists() else still()
    for scenario in scenarios:
        began = time.process_time()
        number = len(list(folder.glob(f"{scenario}-*.npz")))
        envs = {noise_level: made(scenario, noise_level, horizon=HORIZON) for noise_level in levels}
        rng = np.random.default_rng([FIRST, number])
        told: list[Any] = []
        wanted: list[Any] = []
        ends: list[bool] = []
        for trial in count(FIRST + 10_000 * number):
            if len(ends) == episodes:
                break
            env = envs[levels[trial % len(levels)]]
            try:
                seen, _ = env.reset(seed=trial, options={"trial": trial})
            except InputError:
                continue
            student = DaggerInsert(weights)
            takes_over = len(told) + int(rng.integers(1.5 * HORIZON))
            over = False
            while not over:
                told.append(student.told(seen))
                wanted.append(np.clip(expert(env, seen), -1.0, 1.0))
                act = wanted[-1] if len(told) > takes_over else student.act(seen, told[-1])
                seen, _, over, _, info = env.step(np.float32(act))
            ends.append(info["success"])
        np.savez_compressed(
            folder / f"{scenario}-{number}.npz", told=np.float32(told), wanted=np.float32(wanted)[:, :6]
        )
        seconds = time.process_time() - began
        print(f"{scenario} {number}: {sum(ends)} of {episodes}, {len(told)} steps, {seconds:.0f} s", flush=True)


def still() -> dict[str, Any]:
    """Weights that say nothing, so that the approach is left alone."""
    kinds = {f"{kind}{i}": shape for i, (a, b) in enumerate(SHAPES) for kind, shape in (("w", (a, b)), ("b", (b,)))}
    return {name: np.zeros(shape) for name, shape in kinds.items()}


def data(folder: Path) -> tuple[Any, Any, Any]:
    """What was told in all rounds, what the teacher wanted, and how often to draw it, all scenarios alike."""
    rounds = [(file.stem.rpartition("-")[0], np.load(file)) for file in sorted(folder.glob("*-*.npz"))]
    steps: Counter[str] = Counter()
    for name, kept in rounds:
        steps[name] += len(kept["told"])
    print(dict(steps), flush=True)
    chance = [np.full(len(kept["told"]), 1 / steps[name], np.float32) for name, kept in rounds]
    told, wanted = (np.concatenate([kept[column] for _, kept in rounds]) for column in ("told", "wanted"))
    return told, wanted, np.concatenate(chance)


def train(folder: Path, seed: int) -> None:
    """The weights that are nearest to what the teacher would have done, of all scenarios alike."""
    import torch

    torch.set_num_threads(1)
    torch.manual_seed(seed)
    weights = {
        name: torch.nn.Parameter(
            torch.randn(each.shape) * (2.0 / each.shape[0]) ** 0.5 if each.ndim > 1 else torch.zeros(each.shape)
        )
        for name, each in still().items()
    }
    mirrors = torch.tensor(MIRRORS, dtype=torch.float32)
    told, wanted, chance = (torch.from_numpy(each) for each in data(folder))
    optimiser = torch.optim.AdamW(weights.values(), lr=RATE, weight_decay=1e-2)
    steps = EPOCHS * len(told) // BATCH
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    began = time.process_time()
    losses = []
    last = len(SHAPES) - 1
    for step in range(steps):
        if step % 200 == 0:
            drawn = torch.multinomial(chance, 200 * BATCH, replacement=True).reshape(200, BATCH)
        some = drawn[step % 200]
        signs = mirrors[torch.randint(len(mirrors), (BATCH,))]
        x = torch.cat([told[some, :VECTORS] * signs.repeat(1, VECTORS // 6), told[some, VECTORS:]], 1)
        for layer in range(last):
            x = torch.relu(x @ weights[f"w{layer}"] + weights[f"b{layer}"])
        said = x @ weights[f"w{last}"] + weights[f"b{last}"]
        loss = ((said - wanted[some] * signs) ** 2).mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        losses.append(loss.item())
    print(
        f"{len(told)} steps, loss {np.mean(losses[:200]):.3f} to {np.mean(losses[-200:]):.3f}",
        f"{time.process_time() - began:.0f} s",
        flush=True,
    )
    np.savez_compressed(folder / "weights.npz", **{name: each.detach().numpy() for name, each in weights.items()})


def compare(folder: Path, given: argparse.Namespace) -> None:
    """Each policy in the same layouts, none of which was trained on; a line for each episode in compare.jsonl."""
    students = {
        "dagger-insert" if len(given.weights) == 1 else f"dagger-insert, {i + 1}": loaded(file)
        for i, file in enumerate(given.weights)
    }
    policies = [policy for policy in POLICIES if policy in given.policies] + list(students)
    lines = lines_of(folder)
    with (folder / "compare.jsonl").open("a", encoding="utf-8") as out:
        envs: dict[Any, APOInsert] = {}  # policies share the starts that one keeps
        for scenario, noise_level, policy in product(given.scenarios, given.noise_level, policies):
            cell = {"scenario": scenario, "noise_level": noise_level, "policy": policy, "horizon": given.horizon}
            known = {line["trial"]: line for line in lines if cell.items() <= line.items()}
            of = scenario, noise_level, policy == "feel"
            came = 0
            for trial in range(3 * given.layouts):
                if came == given.layouts:
                    break
                if trial not in known:
                    if of not in envs:
                        envs = {key: env for key, env in envs.items() if key[:2] == of[:2]}
                        envs[of] = made(scenario, noise_level, horizon=given.horizon, probing=of[2])
                    known[trial] = cell | {"trial": trial} | episode(envs[of], begun(policy, students), trial)
                    out.write(json.dumps(known[trial]) + "\n")
                    out.flush()
                came += known[trial]["success"] is not None
            right = sum(bool(line["success"]) for line in known.values())
            print(f"{scenario} {noise_level:g} {policy}: {right} of {came}", flush=True)
    RESULT.write_text((folder / "compare.jsonl").read_text(encoding="utf-8"), encoding="utf-8")
    PAGE.write_text(page(lines_of(folder), given), encoding="utf-8")


def lines_of(folder: Path) -> list[dict[str, Any]]:
    """What was compared so far."""
    file = folder / "compare.jsonl"
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()] if file.exists() else []


def begun(policy: str, students: dict[str, Any]) -> Callable[[Any, Any], Any]:
    """A policy at the beginning of an episode."""
    if policy in students:
        return DaggerInsert(students[policy])
    alone = Spiral() if policy == "spiral" else Straight()
    return lambda env, seen: alone(seen)


def episode(env: APOInsert, act: Callable[[Any, Any], Any], trial: int) -> dict[str, Any]:
    """What becomes of one trial; success is None where it never comes to the operation."""
    try:
        seen, _ = env.reset(seed=trial, options={"trial": trial})
    except InputError:
        return {"success": None}
    over, steps = False, 0
    info: dict[str, Any] = {}
    while not over:
        seen, _, over, _, info = env.step(np.float32(act(env, seen)))
        steps += 1
    return {"success": info["success"], "code": info["code"], "steps": steps}


def page(lines: Sequence[dict[str, Any]], given: argparse.Namespace) -> str:
    """The page of what is kept, of this horizon."""
    named = {line["policy"] for line in lines}
    policies = [policy for policy in POLICIES if policy in named] + sorted(named.difference(POLICIES))
    here = [line for line in lines if line["horizon"] == given.horizon and line["success"] is not None]

    def cell(**of: Any) -> str:
        found = [line for line in here if of.items() <= line.items()]
        return f"{sum(line['success'] for line in found)} of {len(found)}" if found else ""

    scenarios = list(dict.fromkeys(line["scenario"] for line in here))
    text = f"""# A learned insertion

`dagger-insert` is a policy of [`APOInsert-v0`](../guide/insertion.md): {WEIGHTS_IN_ALL:,} weights in NumPy.
It is told what was seen in the last six actions (tip, lag, wrench with its torque, last action), how it is pushed
since it stands (the mean wrench less that of free air), and what the plan states, never where parts are. It learned by
DAgger from the teacher `expert`, which knows that: the student acts, and the teacher says at each step what it would
have done. Trained on the last operations of
{_names(TRAINED)}; never on {_names(NEVER)}.

Written by `python -m benchmarks.learn_insert compare FOLDER`: at most {given.horizon} actions of 50 ms,
right by the judge after release. The level L is the error of hand and eye in mm, and a fifth of it in degrees, drawn
anew in each trial (`hand_eye:L/(L/5)`); poses are seen by `isotropic` with 1 mm and 1 degree, and corrected by
`contact-robust`. Layouts are trials from 0 on; those of training begin at {FIRST:,}. `straight` is the approach
alone, `spiral` the scripted search of `benchmarks/insertion.py`, `feel` the approach after all that
[a robot that feels](../guide/arm.md#a-robot-that-feels) does before it.

| scenario | level | {" | ".join(f"`{policy}`" for policy in policies)} |
|---|---|{"---|" * len(policies)}
"""
    for scenario, noise_level in product(scenarios, sorted({line["noise_level"] for line in here})):
        cells = [cell(scenario=scenario, noise_level=noise_level, policy=policy) for policy in policies]
        if any(cells):
            never = " (never trained on)" if scenario in NEVER else ""
            text += f"| `{scenario}`{never} | {noise_level:g} | {' | '.join(cells)} |\n"
    by_policy: dict[str, dict[Any, bool]] = {policy: {} for policy in policies}
    for line in here:
        by_policy[line["policy"]][line["scenario"], line["noise_level"], line["trial"]] = line["success"]
    text += "\nTrials that both came to, and one of them has right:\n\n"
    for student, other in product(policies, POLICIES):
        if student not in POLICIES and other in by_policy:
            both = [(right, by_policy[other].get(trial)) for trial, right in by_policy[student].items()]
            more, fewer = both.count((True, False)), both.count((False, True))
            text += f"- `{student}` and not `{other}`: {more}, the other way {fewer}\n"
    return with_mujoco(text + NOTE, [mujoco.__version__])


def _names(scenarios: Sequence[str]) -> str:
    return ", ".join(f"`{name}`" for name in scenarios)


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("what", choices=("draw", "train", "compare"))
    asked.add_argument("folder", type=Path)
    asked.add_argument("--scenarios", nargs="+", help="as usual: those of training, and for compare two more")
    asked.add_argument("--noise-level", type=float, nargs="+", default=LEVELS)
    asked.add_argument("--episodes", type=int, default=30, help="of each scenario and round")
    asked.add_argument("--seed", type=int, default=0, help="of the training")
    asked.add_argument("--layouts", type=int, default=20)
    asked.add_argument("--horizon", type=int, default=200, help="actions of an episode that is compared")
    asked.add_argument("--policies", nargs="+", choices=POLICIES, default=POLICIES)
    asked.add_argument("--weights", type=Path, nargs="+", default=[WEIGHTS], help="one file for each seed of training")
    given = asked.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    if given.what == "draw":
        draw(given.folder, given.scenarios or TRAINED, given.noise_level, given.episodes)
    elif given.what == "train":
        train(given.folder, given.seed)
    else:
        given.scenarios = given.scenarios or TRIED
        compare(given.folder, given)


if __name__ == "__main__":
    main()

"""What an item of the golden data holds: the package does what the item says, and all that it returns is flattened."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import lru_cache
from numbers import Number
from typing import Any

import gymnasium
import numpy as np

import apo_bench
from benchmarks.golden_items import (
    DROPPED,
    EXPORTS,
    KEYS,
    LEVELS,
    NOISES,
    SCENARIOS,
    SETTINGS,
    VALUES,
    Item,
    neutral,
    neutral_value,
    today,
)

PERTURBATION = 1e-9
"""[m] and [rad]."""


def flat(value: Any, key: str = "") -> dict[str, Any]:
    """Everything in a value by dotted neutral keys: numbers, words, and lists of numbers."""
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    elif hasattr(value, "__struct_fields__") or hasattr(value, "_fields"):
        names = getattr(value, "__struct_fields__", None) or value._fields
        value = {name: getattr(value, name) for name in names}
    if isinstance(value, np.ndarray):
        return {key: [rounded(x) for x in in_mm(value).ravel().tolist()]}
    if isinstance(value, Mapping):
        inner = {neutral(str(name)): each for name, each in value.items()}
    elif isinstance(value, set | frozenset):
        return {key: sorted(map(str, value))}
    elif not isinstance(value, Sequence) or isinstance(value, str):
        return {key: rounded(value)}
    elif all(each is None or isinstance(each, str | Number) for each in value):
        return {key: [rounded(each) for each in value]}
    else:
        inner = {str(k): each for k, each in enumerate(value)}
    found = dict[str, Any]()
    for name, each in inner.items():
        if name not in DROPPED:
            found |= flat(each, f"{key}.{name}" if key else name)
    return found


def in_mm(values: np.ndarray) -> np.ndarray:
    """Poses (..., 4, 4) as (..., 3, 4) in mm, covariances (..., 6, 6) in mm^2 and mrad^2; other arrays as they are."""
    if values.shape[-2:] == (4, 4):
        return values[..., :3, :] * np.array([1.0, 1.0, 1.0, 1e3])
    return values * 1e6 if values.shape[-2:] == (6, 6) else values


def rounded(value: Any) -> Any:
    """A number with 12 digits, none of them beyond the 12th decimal; words, truth values and None as they are."""
    if value is None or isinstance(value, str | bool):
        return neutral_value(value) if isinstance(value, str) else value
    if isinstance(value, np.bool_):
        return bool(value)
    return float(f"{round(float(value), 12):.12g}") + 0.0


@lru_cache(maxsize=6)
def scene_of(scenario: str, clearance_mm: float, grasp: str = "friction", arm: str = "six_axis") -> Any:
    """The compiled scene."""
    return apo_bench.build_scene(apo_bench.load_scenario(scenario), clearance_mm=clearance_mm, grasp=grasp, arm=arm)


@lru_cache(maxsize=3)
def demonstrated(scenario: str, seed: int) -> Any:
    """The demonstration of an item."""
    loaded = apo_bench.load_scenario(scenario)
    layout = apo_bench.draw_layout(loaded, np.random.default_rng([seed, 0]), loaded.clearance_mm)
    scene = scene_of(scenario, loaded.clearance_mm)
    return apo_bench.demonstrate(scene, layout, 1.0, np.random.default_rng([seed, 1]))


def recorded_demonstration(scenario: str, values: Mapping[str, Any]) -> Any:
    """The demonstration out of the values of an observation, which were simulated elsewhere."""
    start, final = (
        {key.removeprefix(prefix): in_m(value)[0] for key, value in values.items() if key.startswith(prefix)}
        for prefix in ("demonstration.start.", "demonstration.final.")
    )
    covariance = 1e-6 * np.array(values["human_covariance"]).reshape(-1, 6, 6)
    rest = {name: values[f"demonstration.{name}"] for name in ("code", "gap_m", "play_m")}
    arrays = {"poses": in_m(values["demonstration.poses"]), "human_covariance": covariance}
    named = {"start": start, "final": final, **arrays, **rest}
    assembly = apo_bench.load_scenario(scenario).assembly
    return apo_bench.Demonstration(assembly=assembly, **{today(key, KEYS): value for key, value in named.items()})


def in_m(values: Sequence[float]) -> np.ndarray:
    """Poses (n, 4, 4), [m], out of recorded ones."""
    poses = np.tile(np.eye(4), (len(values) // 12, 1, 1))
    poses[:, :3] = np.reshape(values, (-1, 3, 4)) / np.array([1.0, 1.0, 1.0, 1e3])
    return poses


def observe(item: Item, demonstration: Any) -> Any:
    """What is observed of a demonstration."""
    noise = "isotropic" if item.seed == 0 else NOISES[(2 * SCENARIOS.index(item.scenario) + item.seed) % len(NOISES)]
    rng = np.random.default_rng([item.seed, 2])
    return apo_bench.observe(demonstration, today(noise, VALUES), rng, noise_level=LEVELS[item.seed])


def perturbed(observation: Any) -> Any:
    """An observation whose poses are moved and turned by `PERTURBATION`, standard deviation per axis."""
    poses = getattr(observation, today("poses", KEYS))
    nudge = np.tile(np.eye(4), (len(poses), 1, 1))
    x, y, z = PERTURBATION * np.random.default_rng(len(poses)).standard_normal((3, len(poses)))
    nudge[:, :3, 3] = np.stack([x, y, z], axis=1)
    nudge[:, 0, 1], nudge[:, 1, 0], nudge[:, 1, 2] = -z, z, -x
    nudge[:, 2, 1], nudge[:, 0, 2], nudge[:, 2, 0] = x, y, -y
    return replace(observation, **{today("poses", KEYS): poses @ nudge})


def observation_values(demonstration: Any, observation: Any) -> dict[str, Any]:
    """Poses that were demonstrated and observed, and the error between them."""
    true, found = (np.asarray(getattr(each, today("poses", KEYS))) for each in (demonstration, observation))
    covariance = np.asarray(getattr(demonstration, today("human_covariance", KEYS)))
    error = np.linalg.inv(true) @ found
    named = {"demonstration": demonstration, "observation": observation}
    return flat({**named, "human_covariance": covariance, "observed_error": error})


def detection_values(observation: Any) -> dict[str, Any]:
    """The contacts that are found in an observation, operation by operation, and what is said of them."""
    detected = getattr(apo_bench, today("detect_contacts", EXPORTS))(observation)
    return flat({"contacts": [operation.contacts for operation in detected.assembly.operations], "found": detected})


def trial_values(item: Item, off: float) -> dict[str, Any]:
    """The record of a trial."""
    level = LEVELS[item.seed]
    asked: dict[str, Any] = {"noise_mm": level, "noise_deg": level}
    asked["clearance_mm"] = apo_bench.load_scenario(item.scenario).clearance_mm
    for pair in item.case.split():
        name, _, text = pair.partition("=")
        asked[name] = float(text) if name.endswith(("_mm", "_deg", "_scale", "_success")) else text
    asked["max_reobservations"] = int(asked.get("max_reobservations", 0))
    asked["noise_mm"] += 1e3 * off
    asked["noise_deg"] += math.degrees(off)
    asked["clearance_mm"] += 1e3 * off
    shaping = {name: asked[name] for name in ("clearance_mm", "grasp", "arm") if name in asked}
    scene = scene_of(item.scenario, **shaping)
    settings = {
        today(name, SETTINGS): today(value, VALUES) if isinstance(value, str) else value
        for name, value in asked.items()
    }
    config = getattr(apo_bench, today("TrialConfig", EXPORTS))(scenario=item.scenario, seed=item.seed, **settings)
    return flat(apo_bench.run_trial(config, scene))


def actions_of(environment: str, n: int, seed: int) -> Iterator[Any]:
    """Fixed actions: small twists, and in `APOTrack-v0` an operation that is undone and done again."""
    rng = np.random.default_rng([seed, 3])
    if environment == "APOReplay-v0":
        yield (1e-4 * rng.standard_normal((n, 6))).astype(np.float32)
    elif environment == "APOTrack-v0":
        for act in (0, 0, 1, *[0] * (n - 1), 2):
            yield {"act": act, "twist": 1e-4 * rng.standard_normal(6)}
    while environment == "APOInsert-v0":
        yield (0.3 * rng.uniform(-1.0, 1.0, 6)).astype(np.float32)


def episode_values(item: Item, off: float) -> dict[str, Any]:
    """Observations, rewards and ends of an episode; of a long one every tenth step and the last."""
    scenario = apo_bench.load_scenario(item.scenario)
    level = (1.0 + 1e3 * off, 1.0 + math.degrees(off))
    asked: dict[str, Any] = {
        today("noise_level", SETTINGS): level,
        today("clearance_mm", SETTINGS): scenario.clearance_mm + 1e3 * off,
    }
    if item.case == "APOInsert-v0":
        asked["operation"] = 1 + SCENARIOS.index(item.scenario) % len(scenario.assembly)
    env = gymnasium.make(item.case, scenario=item.scenario, **asked)
    try:
        seen, info = env.reset(seed=item.seed)
        values = flat({"0": {"observed": seen, "info": info}})
        for k, action in enumerate(actions_of(item.case, len(scenario.assembly), item.seed), 1):
            seen, reward, ended, cut, info = env.step(action)
            step = {str(k): {"observed": seen, "reward": reward, "ended": ended, "cut": cut, "info": info}}
            if k % 10 == 0 or k < 10 or ended or cut:
                values |= flat(step)
            if ended or cut:
                break
    finally:
        env.close()
    return values | {"failure_code": info.get("code"), "success": info.get("success")}


def compute(item: Item, off: float = 0.0, recorded: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The values of an item; where an error is raised, its kind.

    Args:
        off: By how much it is perturbed, [m] and [rad].
        recorded: The values of an observation whose demonstration takes the place of a simulated one.
    """
    try:
        if item.kind == "trial":
            return trial_values(item, off)
        if item.kind == "episode":
            return episode_values(item, off)
        if recorded is None:
            demonstration = demonstrated(item.scenario, item.seed)
        else:
            demonstration = recorded_demonstration(item.scenario, recorded)
        observation = observe(item, demonstration)
        if item.kind == "observation":
            return observation_values(demonstration, observation)
        observation = perturbed(observation) if off else observation
        if item.kind == "detection":
            return detection_values(observation)
        return flat(apo_bench.correct(observation, today(item.case, VALUES)))
    except apo_bench.InputError:
        return {"error": "InputError"}
    except Exception as error:  # such as a name that the package has no more: one item, not the end of all
        print(f"{item.name}: {error!r}", file=sys.stderr)
        return {"error": type(error).__name__}

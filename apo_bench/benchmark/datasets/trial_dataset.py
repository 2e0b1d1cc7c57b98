"""Make a data set of trials in one of three formats.

The trials are replays, or insertions: observations and actions of a policy in `APOInsert-v0`, with the judge's verdict.
"""

import inspect
import shutil
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from apo_bench.benchmark.datasets.card import DatasetMetadata, Field, RecordedEpisode
from apo_bench.benchmark.datasets.episodes import convert_replays, describe_replays, record_replays, write_parquet
from apo_bench.benchmark.datasets.minari import load_h5py, write_minari
from apo_bench.benchmark.sweeps.stop_signals import Check, stop_at_signals
from apo_bench.envs.apo_insert import APOInsert
from apo_bench.envs.insert_spaces import pixels_key
from apo_bench.envs.insertion_progress import PHASES
from apo_bench.envs.policies import POLICIES, MakePolicy, insert_env
from apo_bench.envs.robot_state import STATE_NAMES, read_robot_state, stack_states
from apo_bench.errors import RAISED, InputError, missing_package, require, require_known
from apo_bench.io import has_parquet, write_file
from apo_bench.names import resolve
from apo_bench.records import TrialConfig
from apo_bench.simulation.scene import check_film
from apo_bench.trial.trial_stages import scene_of

_FRAME = "insertion"  # the frame of the insertion axis


def _list_names(*kinds: str) -> tuple[str, ...]:
    """Return the names of the six numbers of each kind of twist."""
    return tuple(f"{kind}_{axis}" for kind in kinds for axis in ("x", "y", "z", "rx", "ry", "rz"))


_FIELDS: Mapping[str, Field] = MappingProxyType(  # observations and actions of `APOInsert-v0`
    {
        "agent_pos": Field(
            (*_list_names("tip", "lag"), "opening"),
            "mm, deg",
            _FRAME,
            "front of the part and its rotation less those at the estimated target, by the encoders; commanded less "
            "measured pose; opening of a finger less half the width of the part",
        ),
        "wrench": Field(_list_names("wrench"), "N, Nm", _FRAME, "on the hand and what is in it, about the flange"),
        "plan": Field(
            (
                *("axis_x", "axis_y", "axis_z", "left", "least_left", "time_left"),
                *(*_list_names("sigma"), "penalised_force", *_list_names("target")),
            ),
            "mm, deg, s, N",
            f"{_FRAME}; of the axis: world",
            "the insertion axis; the distance left along it, now and at least; time left; stated standard deviations "
            "of the part relative to the hole; the force above which there is a penalty; the displacement of the tip "
            "by the actions",
        ),
        "action": Field(
            _list_names("target"),
            "1",
            _FRAME,
            "target of the front and its rotation, in reach_mm and reach_deg of the environment; the third number is a "
            "step along the axis, in shift_mm",
        ),
    }
)
_ROBOT_FIELDS: Mapping[str, Field] = MappingProxyType(  # what is recorded but not observed
    {
        "tip": Field(STATE_NAMES["tip"], "m", "base of the arm", "measured pose of the tip"),
        "tip_command": Field(STATE_NAMES["tip_command"], "m", "base of the arm", "commanded pose of the tip"),
        "phase": Field(STATE_NAMES["phase"], "", "", ", ".join(f"{k} {name}" for k, name in enumerate(PHASES))),
    }
)
_OF_EPISODE: Mapping[str, str] = MappingProxyType(  # column of the table of episodes -> its meaning
    {
        "seed": "number of the trial",
        "scenario": "the assembly",
        "operation": "the operation, from 1",
        "policy": "what acted",
        "success": "whether the operation, and those before it, are right after release; the judge's word",
        "code": "how it failed, or ok",
        "sentence": "the same in words",
    }
)


def record_insertions(
    trials: Sequence[TrialConfig],
    policy: str,
    command: str,
    say: Callable[[str], None],
    pixels: Sequence[str] = (),
) -> tuple[DatasetMetadata, Iterator[RecordedEpisode]]:
    """Let a policy insert parts, trial by trial.

    Args:
        trials: Trials in the order of their scenarios; at least one.
        policy: One of `POLICIES`, or `module:name` of a function that makes the policy of an episode from its
            environment.
        command: The command line that makes the data set.
        say: Called with a sentence about each trial that fails before the operation.
        pixels: Cameras whose images are recorded, as in `APOInsert-v0`.

    Returns:
        The metadata, and the episodes, which run when they are iterated.

    Raises:
        InputError: There is no such policy, or the environment does not take a setting.
    """
    make = resolve(policy, POLICIES, "policy")
    env = insert_env(trials[0], policy, pixels=pixels)
    given = env.spec.kwargs if env.spec else {}
    defaults = {name: each.default for name, each in inspect.signature(APOInsert).parameters.items()}
    joints = (*env.scene.arm.joints, "opening")
    boxes = {**dict(env.observation_space.items()), "action": env.action_space}  # type: ignore[attr-defined]
    fields = {
        name: _FIELDS[name]._replace(most=tuple(box.high.tolist())) for name, box in boxes.items() if name in _FIELDS
    }
    about = DatasetMetadata(
        name="insertions",
        summary="A robot holds a part before its hole, and a policy moves the tip until the hand opens, in "
        f"`APOInsert-v0` of apo_bench; the policy is `{policy}`. `reset(seed=seed, options={{'trial': seed}})` begins "
        "an episode.",
        command=command,
        action=fields.pop("action"),
        fields=fields,
        episodes=_OF_EPISODE,
        robot=trials[0].arm,
        env_spec=env.spec.to_json() if env.spec and len({each.scenario for each in trials}) == 1 else None,
        robot_fields={
            "joints": Field(joints, "rad, m", "", "measured joint angles, and opening of a finger"),
            **_ROBOT_FIELDS,
        },
        arguments={name: x for name, x in {**defaults, **given}.items() if name != "scenario"},
    )
    return about, _run_rollouts(trials, policy, make, say, pixels)


def _run_rollouts(
    trials: Iterable[TrialConfig],
    policy: str,
    make: MakePolicy,
    say: Callable[[str], None],
    pixels: Sequence[str],
) -> Iterator[RecordedEpisode]:
    """Yield the episodes; a new environment is made for each new scenario."""
    env = None
    for trial in trials:
        if env is None or env.scene.scenario.name != trial.scenario:
            env = insert_env(trial, policy, pixels=pixels)
        try:
            seen, info = env.reset(seed=trial.seed, options={"trial": trial.seed})
        except InputError as error:
            say(str(error))
            continue
        scenario, k = env.scene.scenario, env.operation
        with _name_policy_errors(policy):
            act = make(env)
        observations, actions, rewards = [seen], [], []
        states = [read_robot_state(env, PHASES[0])]
        over = truncated = False
        while not over:
            with _name_policy_errors(policy):
                action = np.asarray(act(seen), dtype=np.float64)
            actions.append(np.clip(action, -1.0, 1.0).astype(np.float32))
            seen, reward, terminated, truncated, info = env.step(actions[-1])
            over = terminated or truncated
            observations.append(seen)
            states.append(read_robot_state(env, info["phase"]))
            rewards.append(reward)
        facts = {"seed": trial.seed, "scenario": scenario.name, "operation": k, "policy": policy}
        yield RecordedEpisode(
            seed=trial.seed,
            task=f"Insert the part in the hand: {scenario.title[0].lower()}{scenario.title[1:]}.",
            observations={name: np.array([each[name] for each in observations]) for name in seen if name in _FIELDS},
            actions=np.array(actions),
            rewards=np.array(rewards),
            more={**facts, **{name: info[name] for name in ("success", "code", "sentence")}},
            robot=stack_states(states),
            images={each: np.array([seen[pixels_key(each)] for seen in observations[:-1]]) for each in pixels},
            truncated=truncated,
        )


@contextmanager
def _name_policy_errors(policy: str) -> Iterator[None]:
    """Convert an exception of a policy into an `InputError` that names the policy and its line."""
    try:
        yield
    except RAISED as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        what = f"{type(error).__name__}: {error}".rstrip(": ")
        raise InputError(f"the policy '{policy}' raised {what} ({last.filename}, line {last.lineno}).") from error


FORMATS = ("parquet", "lerobot", "minari")


def make_dataset(
    trials: Sequence[TrialConfig],
    out: Path,
    command: str,
    form: str = "parquet",
    policy: str | None = None,
    say: Callable[[str], None] = print,
    pixels: Sequence[str] = (),
) -> tuple[int, int]:
    """Run trials and write them, with a card `README.md`.

    The same trials give the same bytes on one machine. A signal (Ctrl-C, SIGTERM) or an exception in a policy ends the
    data set early: after the current trial, with the episodes made so far. A second signal, or a full disk, ends it at
    once, and the file `UNFINISHED` stays in the folder.

    Args:
        trials: At least one.
        out: A folder that does not exist, or is empty.
        command: The command line that the card states.
        form: One of `FORMATS`.
        policy: Policy that inserts parts; None records replays.
        say: Called with a sentence about each trial that makes no episode.
        pixels: Cameras whose images are written as videos, `scene` or `wrist`; only for insertions as `lerobot`.

    Returns:
        The number of episodes, and the number of successes.

    Raises:
        InputError: The folder holds files, a trial cannot be run, none makes an episode, or a package is missing.
        KeyboardInterrupt: A signal ended the run.
    """
    require_known("format", form, FORMATS)
    require(
        not out.exists() or (out.is_dir() and not any(out.iterdir())),
        f"'{out}' is there already and not an empty folder; name another.",
    )
    require(
        form != "parquet" or policy is None,
        "insertions were asked for as parquet; give the format lerobot, whose tables are Parquet files, or minari.",
    )
    if pixels:
        require(form == "lerobot" and policy is not None, "images of cameras need insertions in the format lerobot.")
        check_film(Path("episode.mp4"))
    if form == "minari":
        load_h5py()
    elif not has_parquet():
        raise missing_package(f"the format {form}", "pyarrow")
    existed = out.exists()
    ends: list[BaseException] = []  # the exceptions that ended the run early
    found: Iterator[Any]
    if policy is not None:
        about, found = record_insertions(trials, policy, command, say, pixels)
    else:
        scenes = {each.scenario: scene_of(each) for each in trials}
        about = describe_replays([*scenes.values()], command, trials[0].arm)
        found = record_replays(trials, scenes)
    with stop_at_signals(patience=1) as check, _mark_unfinished(out):
        found = _collect_until_error(found, ends, check)
        if form == "parquet":
            counted = write_parquet(found, about, out)
        else:
            rollouts = found if policy is not None else convert_replays(found, about, say)
            counted = _write_rollouts(form, rollouts, about, out)
    if not counted[0]:  # without an episode, the folder is left as it was
        for each in out.iterdir() if out.is_dir() else ():
            shutil.rmtree(each) if each.is_dir() else each.unlink()
        if out.is_dir() and not existed:
            out.rmdir()
    elif ends:
        say(f"{counted[0]} episodes that had ended are kept.")
    for end in ends:
        raise end
    require(counted[0] > 0, "no trial made an episode, so nothing was written; give other seeds or a lower level.")
    return counted


def _write_rollouts(
    form: str, rollouts: Iterable[RecordedEpisode], about: DatasetMetadata, out: Path
) -> tuple[int, int]:
    """Write episodes as `minari` or `lerobot`, and return the numbers of episodes and successes."""
    if form == "minari":
        return write_minari(rollouts, about, out)
    from apo_bench.benchmark.datasets.lerobot import write_lerobot

    return write_lerobot(rollouts, about, out)


@contextmanager
def _mark_unfinished(out: Path) -> Iterator[None]:
    """Keep a file `UNFINISHED` in the folder until the block has ended without an exception."""
    out.mkdir(parents=True, exist_ok=True)
    mark = out / "UNFINISHED"
    write_file(mark, "This data set is not finished: `apo-bench dataset make` still runs, or was ended.\n")
    yield
    mark.unlink()


def _collect_until_error(found: Iterable[Any], ends: list[BaseException], check: Check) -> Iterator[Any]:
    """Yield what is found until an exception, which is appended to `ends`, so that the data set is completed first."""
    try:
        for each in found:
            yield each
            check()
    except (InputError, KeyboardInterrupt) as error:
        ends.append(error)

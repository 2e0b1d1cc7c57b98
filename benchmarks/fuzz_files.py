"""Valid files of every kind, and the commands of `apo-bench` that read them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.assembly import Plan
from apo_bench.cli import app as cli
from apo_bench.files import json_forms as files
from apo_bench.files.csv_form import table
from apo_bench.files.observation import as_planned
from apo_bench.resources import folder
from apo_bench.scenario.file import load_scenario
from apo_bench.sweeps.grid import SweepSettings
from apo_bench.sweeps.sweep import run_sweep
from benchmarks.fuzz_foreign import foreign_kinds
from benchmarks.fuzz_kind import Kind

SCENARIO = "stick_in_tower"


def kinds(work: Path) -> Mapping[str, Kind]:
    """Every kind; made with the code that is tested, in an empty folder.

    Raises:
        RuntimeError: A valid file was refused.
    """
    scenario = (folder("scenarios") / f"{SCENARIO}.toml").read_bytes()
    pockets = (folder("scenarios") / "pocket_table.toml").read_bytes()
    part = (folder("assets") / "parts" / "stick.xml").read_bytes()
    mine = scenario.replace(b'file = "stick"', b'file = "rod.xml"')
    noise = sorted((folder("assets") / "noise").glob("*.toml"))[0].read_bytes()
    seen = as_planned(load_scenario(SCENARIO), 1.0, 1.0)
    estimates, truth, scene = _poses()
    run = _run(work)
    show = (["scenarios", "s.toml"], ["graph", "s.toml"], ["plan", "s.toml"], ["explain", "s.toml"])
    of_poses = ("correct", "graph", "explain", "recognise", "plan")
    of_file = [[name, SCENARIO, "--observation"] for name in of_poses]
    made = {
        "part": Kind(
            {"s.toml": mine, "rod.xml": part},
            ["rod.xml"],
            (*[["scenarios", "s.toml"]] * 3, ["scene", "s.toml", "--out", "scene.xml"]),
            18,
            ("scene.xml",),
        ),
        "scenario": Kind(
            {"s.toml": scenario}, ["s.toml"], (*show, ["scene", "s.toml", "--out", "scene.xml"]), 16, ("scene.xml",)
        ),
        "scenario with groups": Kind({"s.toml": pockets}, ["s.toml"], show, 8),
        "sweep": Kind({"w.toml": _SWEEP, "taken": b""}, ["w.toml"], (["sweep", "w.toml", "--out", "taken"],), 12),
        "noise": Kind({"n.toml": noise}, ["n.toml"], (["noise", "card", "n.toml"],), 4),
        "observation, JSON": Kind(
            {"o.json": _json(files.observation_form(seen, SCENARIO))}, ["o.json"], [[*c, "o.json"] for c in of_file], 10
        ),
        "observation, CSV": Kind({"o.csv": _observed(seen)}, ["o.csv"], [[*c, "o.csv"] for c in of_file], 10),
        "plan": Kind(
            {"p.json": _json(files.plan_form(Plan(seen.assembly, seen.start, seen.goals), SCENARIO))},
            ["p.json"],
            (["read-plan", "p.json"],),
            10,
        ),
        "estimates and truth": Kind(
            {"e.csv": estimates, "t.csv": truth, "g.json": scene},
            ["e.csv", "t.csv", "g.json"],
            [["noise", "fit", "--estimates", "e.csv", "--truth", name, *more] for name, more in _TRUTHS],
            8,
            ("n.toml", "x.csv"),
        ),
        "residuals": Kind(
            {"r.csv": _residuals(work, estimates, truth)}, ["r.csv"], (["noise", "card", "empirical:r.csv"],), 4
        ),
        "run folder": Kind(
            {f"{name}/{file}": raw for name in ("a", "b") for file, raw in run.items()},
            [f"a/{file}" for file in run],
            (["report", "a", "--pictures", "0"], *[["compare", "a", "b", "--out", "c"]] * 3),
            10,
            _REPORTS,
        ),
    }
    return {**made, **foreign_kinds(work)}


_REPORTS = ("a/report.html", "a/tables/*", "a/figures/*", "c/*")
_TRUTHS = (
    ("t.csv", []),
    ("g.json", ["--scene-id", "1"]),
    ("t.csv", ["--json", "--out", "n.toml", "--residuals", "x.csv"]),
)
_SWEEP = b"""scenarios = ["stick_in_tower", "carried_bridge"]
levels = [0.5, 1, [2, 1]]
careless = [0, 1]
methods = ["none", "paper", "contact"]
noises = ["isotropic", "camera"]
relations = ["given"]
clearances_mm = [0.25]
grasps = ["friction"]
trials = 3
seed = 5
arm = "six_axis"
timestep_ms = 1
fidelity = "contact"

[[also]]
methods = ["oracle"]
levels = [0]
"""


def _json(form: files.Form) -> bytes:
    return json.dumps(form, indent=1).encode()


def _observed(seen: object) -> bytes:
    """The table of an observation, with deviations."""
    head, *rows = table(seen.assembly, seen.goals).splitlines()  # type: ignore[attr-defined]
    more = [f"{row},1.5,0.5,true,0.25" for row in rows]
    return "\n".join([f"{head},deviation_mm,deviation_deg,seen,play_mm", *more, ""]).encode()


def _poses(n: int = 120) -> tuple[bytes, bytes, bytes]:
    """Estimates, and the truth in both of its forms."""
    rng = np.random.default_rng(0)
    true = Rotation.random(n, random_state=1)
    t = rng.uniform([-200, -200, 600], [200, 200, 1200], (n, 3))
    off = t + rng.normal(0, 3, (n, 3))
    turned = true * Rotation.from_rotvec(rng.normal(0, 2, (n, 3)), degrees=True)

    def lines(R: Rotation, t: np.ndarray) -> bytes:
        rows = [
            f"1,{k // 4},{k % 4 + 1},0.9,{_spaced(m.ravel())},{_spaced(p)},0.1"
            for k, (m, p) in enumerate(zip(R.as_matrix(), t, strict=True))
        ]
        return "\n".join(["scene_id,im_id,obj_id,score,R,t,time", *rows, ""]).encode()

    images: dict[str, list[dict[str, object]]] = {}
    for k, (m, p) in enumerate(zip(true.as_matrix(), t, strict=True)):
        entry = {"obj_id": k % 4 + 1, "cam_R_m2c": m.ravel().tolist(), "cam_t_m2c": p.tolist()}
        images.setdefault(str(k // 4), []).append(entry)
    return lines(turned, off), lines(true, t), json.dumps(images).encode()


def _spaced(numbers: np.ndarray) -> str:
    return " ".join(map(repr, numbers.tolist()))


def _residuals(work: Path, estimates: bytes, truth: bytes) -> bytes:
    names = [work / name for name in ("e.csv", "t.csv", "r.csv")]
    for path, raw in zip(names, (estimates, truth), strict=False):
        path.write_bytes(raw)
    e, t, r = map(str, names)
    _must(["noise", "fit", "--estimates", e, "--truth", t, "--residuals", r])
    return names[2].read_bytes()


def _run(work: Path) -> Mapping[str, bytes]:
    """The folder of a small sweep."""
    out = work / "run"
    methods = ("oracle", "none")
    run_sweep(SweepSettings(("block_on_block",), (0.0, 1.0), (0.0,), methods, trials=2, fidelity="contact"), out)
    return {name: (out / name).read_bytes() for name in ("trials.jsonl", "run.json", "timing.jsonl")}


def _must(arguments: list[str]) -> None:
    if cli.main(arguments):
        raise RuntimeError(f"apo-bench {' '.join(arguments)} did not work")

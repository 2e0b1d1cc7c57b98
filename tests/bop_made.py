"""Estimates with known errors, drawn without the code that fits them, as files of the BOP formats."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from apo_bench.geometry import Array

HEADER = "scene_id,im_id,obj_id,score,R,t,time"


class Known(NamedTuple):
    """What estimates are drawn with: scale and degrees of freedom across and along the ray."""

    shift: tuple[float, float, float, float] = (2.0, 4.0, 8.0, 3.0)
    """[mm]; none longer than 50."""
    turn: tuple[float, float, float, float] = (2.5, 5.0, 1.5, 4.0)
    """[deg]; none larger than 30."""
    missed: float = 0.12
    outliers: float = 0.1
    farthest: float = 800.0
    """[mm]; outliers are off by 50 to this, alike in each octave."""


class Made(NamedTuple):
    where: Array
    """(n, 3): scene, image, object."""
    R: Array
    t: Array
    found: Array
    """(n,)."""
    shift: Array
    """(n, 3), in the frame of the ray, [mm]."""
    turn: Array
    """(n, 3), likewise, [deg]."""
    R_seen: Array
    t_seen: Array


def draw(n: int, known: Known, rng: np.random.Generator, objects: int = 5) -> Made:
    """Parts 0.6 to 1.5 m away and up to 0.2 m aside, in images of several objects."""
    index = np.arange(n)
    where = np.stack([np.ones(n, dtype=int), index // objects, 1 + index % objects], axis=1)
    t = np.column_stack([rng.uniform(-200, 200, n), rng.uniform(-200, 200, n), rng.uniform(600, 1500, n)])
    R = Rotation.from_quat(rng.standard_normal((n, 4))).as_matrix()
    shift = _limited(n, known.shift, 50.0, rng)
    turn = _limited(n, known.turn, 30.0, rng)
    gross = rng.random(n) < known.outliers
    direction = rng.standard_normal((n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    shift[gross] = (direction * 50.0 * (known.farthest / 50.0) ** rng.random((n, 1)))[gross]
    F = ray_frames(t)
    R_seen = Rotation.from_rotvec(np.einsum("nij,nj->ni", F, turn), degrees=True).as_matrix() @ R
    return Made(where, R, t, rng.random(n) >= known.missed, shift, turn, R_seen, t + np.einsum("nij,nj->ni", F, shift))


def ray_frames(t: Array) -> Array:
    """The axes of the camera, turned the shortest way until the third is the ray, (n, 3, 3)."""
    ray = t / np.linalg.norm(t, axis=1, keepdims=True)
    axis = np.cross([0.0, 0.0, 1.0], ray)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, ray[:, 2:])).as_matrix()


def results(path: Path, where: Array, R: Array, t: Array, score: Array | None = None) -> Path:
    scores = np.full(len(where), 0.9) if score is None else score
    lines = [
        f"{s},{i},{o},{p:.9g},{' '.join(f'{x:.9g}' for x in M)},{' '.join(f'{x:.9g}' for x in v)},-1"
        for (s, i, o), M, v, p in zip(where.tolist(), R.reshape(-1, 9).tolist(), t.tolist(), scores, strict=True)
    ]
    path.write_text("\n".join([HEADER, *lines]) + "\n", encoding="utf-8")
    return path


def scene_gt(path: Path, where: Array, R: Array, t: Array) -> Path:
    form: dict[str, list[dict[str, object]]] = {}
    for (_, image, part), M, v in zip(where.tolist(), R.reshape(-1, 9).tolist(), t.tolist(), strict=True):
        form.setdefault(str(image), []).append({"obj_id": part, "cam_R_m2c": M, "cam_t_m2c": v})
    path.write_text(json.dumps(form), encoding="utf-8")
    return path


def files(folder: Path, made: Made) -> tuple[Path, Path]:
    """Estimates and truth, both as results files."""
    seen = made.found
    return (
        results(folder / "estimates.csv", made.where[seen], made.R_seen[seen], made.t_seen[seen]),
        results(folder / "truth.csv", made.where, made.R, made.t),
    )


def _limited(n: int, tails: tuple[float, float, float, float], limit: float, rng: np.random.Generator) -> Array:
    """Student t in two directions, and apart in one, drawn anew until it is within the limit."""
    across, n1, along, n2 = tails
    out = np.zeros((0, 3))
    while len(out) < n:
        pair = rng.standard_normal((n, 2)) * across / np.sqrt(rng.chisquare(n1, (n, 1)) / n1)
        error = np.column_stack([pair, along * rng.standard_t(n2, n)])
        out = np.concatenate([out, error[np.linalg.norm(error, axis=1) < limit]])
    return out[:n]

"""Observations and contacts that are wrong in ways that no model of the package has, to test what plans predict.

An error is drawn as a body twist of each operation. What the observation states is isotropic noise of the level, so
it is wrong about sizes, axes and correlations. Sources of contacts are functions as of `make_contacts`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from apo_bench.assembly import Assembly, Contact, Demonstration, Observation, PartFace, Poses, compute_placements
from apo_bench.geometry import Array, Face
from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.models.displacement import observe_displaced
from apo_bench.perception.observation.wrong_contacts import FaceOffset, add_contact, omit_contact

SIGMA = np.repeat([1e-3, np.radians(1.0)], 3)
"""Stated standard deviation, (6,), [m, rad]."""
CAMERA = Camera()
Drawn = Callable[[Demonstration, np.random.Generator], Array]
"""(demonstration, rng) -> body twists, (n, 6)."""


def white(shown: Demonstration, rng: np.random.Generator, scale: float = 1.0) -> Array:
    return rng.standard_normal((len(shown.poses), 6)) * SIGMA * scale


def in_body(shown: Demonstration, errors: Array) -> Array:
    """Errors in axes of the world, (n, 6), as body twists."""
    R = np.swapaxes(shown.poses[:, :3, :3], 1, 2)
    return np.concatenate([np.einsum("nij,nj->ni", R, errors[:, part]) for part in (slice(3), slice(3, 6))], axis=1)


def lag(shown: Demonstration, rng: np.random.Generator) -> Array:
    """The pose is read late: it lags along the motion of the part, and drifts from operation to operation."""
    before = (shown.start, *compute_placements(shown.assembly, shown.start, shown.poses))
    moved = [T[:3, 3] - before[k][shown.assembly.operations[k].main][:3, 3] for k, T in enumerate(shown.poses)]
    errors = np.zeros((len(moved), 6))
    errors[:, :3] = -np.array(moved) * rng.uniform(0.0, 0.006)
    errors += np.cumsum(rng.standard_normal(errors.shape) * SIGMA * 0.4, axis=0)
    return in_body(shown, errors) + white(shown, rng, 0.6)


def depth_scale(shown: Demonstration, rng: np.random.Generator) -> Array:
    """Distances from the camera are too long or too short by one factor, and noisier the farther away."""
    to = shown.poses[:, :3, 3] - CAMERA.T_world_camera[:3, 3]
    far = np.linalg.norm(to, axis=1, keepdims=True)
    along = to * rng.normal(0.0, 0.0015) + to / far * rng.normal(0.0, 1.2e-3, far.shape) * (far / 0.9) ** 2
    return in_body(shown, np.hstack([along, np.zeros_like(along)])) + white(shown, rng, 0.7)


def shared_yaw(shown: Demonstration, rng: np.random.Generator) -> Array:
    """All parts turned about the vertical through their middle, as by a camera whose pose is wrong."""
    turn = np.array([0.0, 0.0, rng.normal(0.0, np.radians(0.8))])
    across = np.cross(turn, shown.poses[:, :3, 3] - shown.poses[:, :3, 3].mean(axis=0))
    return in_body(shown, np.hstack([across, np.tile(turn, (len(across), 1))])) + white(shown, rng, 0.7)


def mixture(shown: Demonstration, rng: np.random.Generator) -> Array:
    """One operation in seven is four times as noisy."""
    return white(shown, rng, 0.8) * np.where(rng.random((len(shown.poses), 1)) < 1 / 7, 4.0, 1.0)


def mirrored_yaw(shown: Demonstration, rng: np.random.Generator) -> Array:
    """One operation in five has the sign of its yaw wrong: turned by 4 to 20 degrees about the vertical."""
    errors = np.zeros((len(shown.poses), 6))
    errors[:, 5] = np.radians(rng.uniform(4.0, 20.0, len(errors))) * (rng.random(len(errors)) < 0.2)
    return in_body(shown, errors) + white(shown, rng)


def one_camera(shown: Demonstration, rng: np.random.Generator) -> Array:
    """Three times as noisy along the ray of the camera as across, where one number is stated."""
    sigma = np.array([0.6, 0.6, 1.8, 1.2, 1.2, 0.6])
    return CAMERA.twists(shown.poses, rng.standard_normal((len(shown.poses), 6)) * SIGMA * sigma)


def understated(shown: Demonstration, rng: np.random.Generator) -> Array:
    return white(shown, rng, 1.6)


def lost(shown: Demonstration, rng: np.random.Generator) -> Array:
    """One operation in six is lost: 15 to 60 mm off in any direction, turned by up to 40 degrees."""
    out = rng.standard_normal((len(shown.poses), 6))
    far = out[:, :3] / np.linalg.norm(out[:, :3], axis=1, keepdims=True) * rng.uniform(0.015, 0.06, (len(out), 1))
    turned = np.radians(40.0) * np.tanh(out[:, 3:])
    gone = rng.random((len(out), 1)) < 1 / 6
    return np.where(gone, np.hstack([far, turned]), 0.0) + white(shown, rng)


def observe_as(drawn: Drawn) -> Callable[[Assembly, Demonstration, np.random.Generator], Observation]:
    """A noise model with errors of this kind."""

    def observe(assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        return observe_displaced(assembly, demonstration, drawn(demonstration, rng), np.diag(SIGMA**2))

    return observe


def shift_a_little(assembly: Assembly, start: Poses, poses: Array, rng: np.random.Generator) -> Assembly:
    """One face 1 to 5 mm off its model."""
    return FaceOffset(rng.uniform(1e-3, 5e-3))(assembly, start, poses, rng)


def omit_and_add(assembly: Assembly, start: Poses, poses: Array, rng: np.random.Generator) -> Assembly:
    """One contact missing, and one too many."""
    return add_contact(omit_contact(assembly, start, poses, rng), start, poses, rng)


def name_another_face(assembly: Assembly, start: Poses, poses: Array, rng: np.random.Generator) -> Assembly:
    """A contact names another face of the environment, which looks the same way; unchanged if there is none."""
    every = []
    for k, operation in enumerate(assembly.operations):
        for contact in operation.contacts:
            part, face = contact.environment
            known = assembly.solids[part].faces
            if isinstance(assembly.face_of(contact.environment), Face):
                alike = (n for n, f in known.items() if n != face and f.normal @ known[face].normal > 0.99)
                every += [(k, contact, Contact(contact.manipulated, PartFace(part, name))) for name in alike]
    if not every:
        return assembly
    k, right, wrong = every[int(rng.integers(len(every)))]
    operations = list(assembly.operations)
    contacts = tuple(wrong if contact == right else contact for contact in operations[k].contacts)
    operations[k] = replace(operations[k], contacts=contacts)
    gaps = {**assembly.gaps, wrong: assembly.gaps[right]} if right in assembly.gaps else assembly.gaps
    return replace(assembly, operations=tuple(operations), gaps=gaps)


NOISES = {
    each.__name__: observe_as(each)
    for each in (white, lag, depth_scale, shared_yaw, mixture, mirrored_yaw, one_camera, understated, lost)
}
"""Name in the tables -> noise model."""
CONTACTS = {each.__name__: each for each in (shift_a_little, omit_and_add, name_another_face)}
"""Name in the tables -> source of contacts; others are those of the package."""

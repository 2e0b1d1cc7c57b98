"""A small network in which operations and contacts attend to each other; the same code runs on NumPy and on PyTorch.

What a network is told of an observation: how far contacts are from what noise explains, and whose fault it may be.

All numbers are in units of the stated noise, so they mean the same for any assembly, place and size of noise.

`learned-set`: a network says whose pose is grossly wrong and how wrong the others are; contacts do the rest.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Correction, Observation, lowered_observation, measured_rates
from apo_bench.correction.contact.problem import problem_of
from apo_bench.correction.robust.robust import contact_robust
from apo_bench.geometry import Array, pose
from apo_bench.resources import folder

PLAY_M = 2e-5
"""Added to the standard deviation of every equation: what rounds off where no noise is stated."""
OPERATION = 4
CONTACT = 4
"""Numbers of each token."""
_FAR = 1e-3, np.radians(1.0)


class Tokens(NamedTuple):
    """Of n operations and c contacts; leading axes may be added to all."""

    operations: Array
    """(n, 4): whether it was seen, logarithms of its standard deviations over 1 mm and 1 degree, contacts over ten."""
    contacts: Array
    """(c, 4): whether all operations in its equations were seen, logarithms of the chi-square of its three equations
    and of their standard deviation over 1 mm, operations in its equations over ten."""
    edges: Array
    """(c, n): which share of the contact's variance is this operation's; 0 where it is in none of its equations."""
    gains: Array
    """(c, n, 6): the likeliest error of the operation if this contact alone were known, in standard deviations."""


def tokens(observation: Observation) -> Tokens:
    """The tokens of an observation whose faces are flat.

    Raises:
        InputError: A covariance is not positive definite.
    """
    problem = problem_of((replace(observation, shared=(), tails=None),))
    system = problem.laid.system
    n = len(observation.goals)
    e, blocks = (x[0] for x in system.blocks(problem.goals, problem.L))
    columns = system.words.columns
    seen = np.append(observation.seen, True)
    J = np.zeros((len(columns), n + 1, 6, 3))
    for letter in range(columns.shape[1]):
        J[np.arange(len(columns)), columns[:, letter]] += blocks[:, letter]
    J = J[:, :n]
    S = (np.swapaxes(J, -1, -2) @ J).sum(axis=1) + PLAY_M**2 * np.eye(3)
    said = np.linalg.solve(S, e.reshape(-1, 3, 1))
    chi = (e.reshape(-1, 3) * said[..., 0]).sum(axis=-1)
    share = np.einsum("cnij,cjk,cnik->cn", J, np.linalg.inv(S), J) / 3.0
    whole: NDArray[np.bool_] = np.asarray(seen[columns].all(axis=1))
    inside = share > 0.0
    spread = np.sqrt(np.trace(S, axis1=-2, axis2=-1) / 3.0)
    sigma = np.sqrt(np.diagonal(observation.covariance, axis1=-2, axis2=-1)).reshape(n, 2, 3).mean(axis=-1)
    operations = [observation.seen, *np.log(sigma / _FAR).T, (inside & whole[:, None]).sum(axis=0) / 10.0]
    contacts = [whole, np.log1p(np.where(whole, chi, 0.0)), np.log(spread / _FAR[0]), inside.sum(axis=1) / 10.0]
    return Tokens(
        np.stack(operations, axis=-1).astype(np.float64),
        np.stack(contacts, axis=-1).astype(np.float64),
        share * whole[:, None],
        -(J @ said[:, None])[..., 0] * whole[:, None, None],
    )


WIDTH = 32
ROUNDS = 3
_MASKED = -1e9


class Said(NamedTuple):
    """What the network says of each of n operations."""

    gross: Any
    """(*, n): the logit of that what was seen is grossly wrong."""
    log_scale: Any
    """(*, n): how many times its error is as large as stated where it is not, the logarithm."""
    twist: Any
    """(*, n, 6): its error, in standard deviations as stated."""


def shapes() -> dict[str, tuple[int, ...]]:
    """Names and shapes of all weights."""
    d = WIDTH
    layers = {"operation": (OPERATION, d), "contact": (CONTACT, d), "out": (d, d), "said": (d, 2), "gate": (2 * d, 1)}
    for r in range(ROUNDS):
        layers |= {f"to_contact{r}": (3 * d, d), f"to_operation{r}": (3 * d, d), f"heed{r}": (2 * d + 1, 1)}
    return {f"{name}.{kind}": shape for name, (a, b) in layers.items() for kind, shape in (("w", (a, b)), ("b", (b,)))}


def forward(weights: Mapping[str, Any], given: Tokens, xp: Any = np) -> Said:
    """What the network says.

    Args:
        weights: As `shapes`.
        given: Tokens, or a batch of the same assembly.
        xp: NumPy or PyTorch, whichever the arrays are of.
    """

    def layer(name: str, x: Any) -> Any:
        return x @ weights[f"{name}.w"] + weights[f"{name}.b"]

    def pairs(H: Any, C: Any) -> Any:
        """Every contact beside every operation, (*, c, n, 2 d)."""
        shape = (*given.edges.shape, WIDTH)
        return xp.concatenate(
            [xp.broadcast_to(C[..., :, None, :], shape), xp.broadcast_to(H[..., None, :, :], shape)], -1
        )

    inside = given.edges > 0.0
    H = xp.tanh(layer("operation", given.operations))
    C = xp.tanh(layer("contact", given.contacts))
    for r in range(ROUNDS):
        both = pairs(H, C)
        heed = layer(f"heed{r}", xp.concatenate([both, given.edges[..., None]], -1))[..., 0]
        heed = xp.where(inside, heed, _MASKED)
        of_operations = _weighed(xp, heed, inside, -1)
        of_contacts = _weighed(xp, heed, inside, -2)
        mean_H = (given.edges[..., None] * both[..., WIDTH:]).sum(-2)
        mean_C = (of_contacts[..., None] * both[..., :WIDTH]).sum(-3)
        most_C = xp.where(inside[..., None], both[..., :WIDTH], -1.0)
        most_C = most_C.max(-3) if xp is np else most_C.amax(-3)
        told_H = (of_operations[..., None] * both[..., WIDTH:]).sum(-2)
        C = C + xp.tanh(layer(f"to_contact{r}", xp.concatenate([C, mean_H, told_H], -1)))
        H = H + xp.tanh(layer(f"to_operation{r}", xp.concatenate([H, mean_C, most_C], -1)))
    said = layer("said", xp.tanh(layer("out", H)))
    gate = xp.tanh(layer("gate", pairs(H, C)))
    return Said(said[..., 0], said[..., 1], (gate * given.gains).sum(-3))


def _weighed(xp: Any, heed: Any, inside: Any, axis: int) -> Any:
    """A softmax along an axis, of nothing where nothing is inside."""
    top = heed.max(axis, keepdims=True) if xp is np else heed.amax(axis, keepdim=True)
    raised = xp.exp(heed - top) * inside
    total = raised.sum(axis, keepdims=True) if xp is np else raised.sum(axis, keepdim=True)
    return raised / (total + 1e-9)


GROSS_SCALE = 40.0
"""What was seen wrongly, where contacts alone do not say where it goes, is off by so many times what is stated."""


def learned_set(observation: Observation) -> Correction:
    """Correct an observation without any model of outliers: `contact-robust` of what the network leaves.

    Raises:
        InputError: A covariance is not positive definite.
    """
    flat = lowered_observation(observation)
    if not len(flat.goals):
        return contact_robust(flat)
    believed, gross = as_believed(flat)
    plain = replace(believed, outliers=measured_rates(0.0, 0.0), tails=None)
    found = contact_robust(replace(plain, seen=plain.seen & ~gross))
    if found.ok or not (gross & plain.seen).any():
        return found
    wide = np.where(gross, GROSS_SCALE**2, 1.0)[:, None, None]
    return contact_robust(replace(plain, covariance=plain.covariance * wide))


def as_believed(flat: Observation) -> tuple[Observation, NDArray[np.bool_]]:
    """An observation as the network believes it, and which operations it does not, (n,)."""
    said = forward(_weights(), tokens(flat))
    L = np.linalg.cholesky(flat.covariance)
    gross = np.asarray(said.gross > 0.0)
    moved = flat.goals @ pose.exp((L @ said.twist[..., None])[..., 0])
    # What operations share is stated of where they were seen, and within what is stated of each: both stay then.
    stays = gross | ~flat.seen | bool(flat.shared)
    goals = np.where(stays[:, None, None], flat.goals, moved)
    scale = np.where(gross, 1.0, np.exp(np.maximum(said.log_scale, 0.0 if flat.shared else -np.inf)))
    return replace(flat, goals=goals, covariance=flat.covariance * scale[:, None, None] ** 2), gross


@cache
def _weights() -> dict[str, Array]:
    with np.load(folder("assets") / "learned" / "set.npz", allow_pickle=False) as kept:
        return {name: kept[name].astype(np.float64) for name in shapes()}

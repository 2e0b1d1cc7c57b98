"""A small network in which operations and contacts attend to each other; the same code runs on NumPy and on PyTorch."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from apo_bench.correction.learned.tokens import CONTACT, OPERATION, Tokens

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

"""What a network is told of an observation: how far contacts are from what noise explains, and whose fault it may be.

All numbers are in units of the stated noise, so they mean the same for any assembly, place and size of noise.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Observation
from apo_bench.correction.contact.problem import problem_of
from apo_bench.geometry import Array

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

"""The contact equations as a function of z, sigma units, for solvers that know nothing of poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly import Equations
from apo_bench.correction.solvers.whitened import Whitened
from apo_bench.geometry import Array


@final
@dataclass(frozen=True, eq=False)
class InZ:
    """e(z) in millimetres with T = T_seen exp(L z), chart around what was seen."""

    system: Equations
    seen: Array
    """(n, 4, 4)."""
    L: Array
    """(n, 6, 6), Cholesky factors of the covariance, [m, rad]."""

    @property
    def zero(self) -> Array:
        return np.zeros(6 * len(self.seen))

    @property
    def chart(self) -> Whitened:
        return Whitened(self.seen, self.L)

    def goals(self, z: Array) -> Array:
        return self.chart.goals(z)

    def value(self, z: Array) -> Array:
        """e, (m,), [mm]."""
        return 1e3 * self.system.residual(self.goals(z))

    def slope(self, z: Array) -> Array:
        """de/dz, (m, 6 n), [mm] per sigma."""
        _, J = self.system.linearised(self.goals(z))
        return 1e3 * self.chart.pulled(z, J)

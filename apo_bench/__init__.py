"""Does a robot's replay of an observed assembly fit, with and without correction by face contacts?

Importing the package registers `APOReplay-v0` with Gymnasium and does nothing else; what needs MuJoCo is imported
by `gymnasium.make`.
"""

from __future__ import annotations

from typing import Any

import gymnasium

__version__ = "0.1.0"
__all__ = ["Corrected", "__version__"]

gymnasium.register(id="APOReplay-v0", entry_point="apo_bench.env:APOReplay")


def __getattr__(name: str) -> Any:
    """`apo_bench.Corrected`, imported when it is first asked for."""
    if name == "Corrected":
        from apo_bench.corrected import Corrected

        return Corrected
    raise AttributeError(f"module 'apo_bench' has no attribute '{name}'")

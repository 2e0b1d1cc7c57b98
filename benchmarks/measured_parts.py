"""Benchmarks of several parts, each measured by itself: what was measured before is kept."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco


def measured(parts: Mapping[str, Callable[[], Any]], only: Sequence[str] | None, kept: Path) -> dict[str, Any]:
    """What is in a file, with some parts measured anew, or all; each is written as soon as it is known."""
    found: dict[str, Any] = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    for name in only or parts:
        if name in parts:
            found[name] = parts[name]()
            found |= {"cores": os.cpu_count(), "machine": platform.platform(), "mujoco": mujoco.__version__}
            kept.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    return found

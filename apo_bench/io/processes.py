"""Environment variables for subprocesses that the package starts."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

SAFE_PATH = "PYTHONSAFEPATH"
"""Without it, `python -c` looks for Python's own modules in the current folder, and so do processes of a pool."""


@contextmanager
def set_environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Add variables to the environment of processes that are started meanwhile."""
    before = {name: os.environ[name] for name in variables if name in os.environ}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name in variables:
            os.environ.pop(name, None)
        os.environ.update(before)

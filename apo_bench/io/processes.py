"""Set environment variables for processes that the package starts."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

SAFE_PATH = "PYTHONSAFEPATH"
"""Without this variable, `python -c` and processes of a pool would import modules of the current folder."""


@contextmanager
def set_environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Add variables to the environment during the context; processes that are started meanwhile inherit them."""
    before = {name: os.environ[name] for name in variables if name in os.environ}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name in variables:
            os.environ.pop(name, None)
        os.environ.update(before)

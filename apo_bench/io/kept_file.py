"""A file that is only appended to, and is put back if somebody removes it meanwhile: its bytes are still at hand."""

import os
import shutil
from pathlib import Path
from typing import IO, Any


def is_there(file: IO[bytes], path: Path) -> bool:
    """Whether an open file stands where it was opened."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except OSError:
        return False


def put_back(file: IO[bytes], path: Path) -> IO[Any]:
    """Write what an open file holds to a new one at `path`, at once, in place of whatever stands there.

    Args:
        file: Opened in the mode `a+b`; it is not closed.

    Returns:
        The new file, in the same mode.

    Raises:
        OSError: It cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f"{path.name}.new")
    beside.unlink(missing_ok=True)
    made = beside.open("x+b", buffering=0)
    try:
        file.seek(0)
        shutil.copyfileobj(file, made)
        made.close()
        made = beside.open("a+b", buffering=0)
        os.replace(beside, path)
    except BaseException:
        made.close()
        raise
    return made

"""Secret seeds, which enter every random stream, so that only their owner can draw the trials of a sweep again."""

import hashlib
import hmac
import os
import re
import secrets
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, final

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.io import read_bytes

FEWEST_BYTES = 16  # 128 bits
_MOST_BYTES = 512
"""Most bytes of a secret seed."""
_FEWEST_DIFFERENT = 8
"""Fewest distinct bytes; of 16 random bytes, fewer are distinct in one of 10^11 cases."""
_FORM = re.compile(rb"((?:[0-9a-fA-F]{2})+)\r?\n?")  # whole bytes as hexadecimal digits
_TEXT = "one line of 32 to 1024 hexadecimal digits, an even number of them, drawn at random"


@final
@dataclass(frozen=True)
class SecretSeed:
    """A secret seed, known only to the processes that run trials, and written to no file but its own."""

    secret: bytes = field(repr=False)

    @cached_property
    def hash(self) -> str:
        """16 hexadecimal digits that identify a secret seed without revealing it."""
        return hashlib.sha256(b"apo-bench/salt/name/" + self.secret).hexdigest()[:16]

    def words(self, seed: int, which: int) -> list[int]:
        """Return eight 32-bit numbers that seed one stream of one trial.

        Numbers of one stream do not reveal those of another.

        Args:
            seed: Number of the trial.
            which: Number of the stream.
        """
        digest = hmac.digest(self.secret, f"apo-bench/salt/stream/{seed}/{which}".encode(), "sha256")
        return [int(word) for word in np.frombuffer(digest, dtype=">u4")]


def read_secret_seed(path: str | Path) -> SecretSeed:
    """Read a secret seed from its file.

    Raises:
        InputError: There is no such file, it cannot be read, or it is no secret seed.
    """
    match = _FORM.fullmatch(read_bytes(path, "secret seed file"))
    secret = bytes.fromhex(match[1].decode()) if match is not None else b""
    require(
        FEWEST_BYTES <= len(secret) <= _MOST_BYTES and len(set(secret)) >= _FEWEST_DIFFERENT,
        f"'{path}' is not a secret seed file; it must hold {_TEXT}.",
    )
    return SecretSeed(secret)


def open_secret_seed(path: str | Path, folder: str | Path) -> SecretSeed:
    """Read a secret seed; make the file if it does not exist and the folder of the sweep holds no trial yet.

    Raises:
        InputError: The file is no secret seed, cannot be read, or cannot be made.
    """
    if os.path.lexists(path):
        return read_secret_seed(path)
    trials = Path(folder) / "trials.jsonl"
    require(
        not trials.exists() or trials.stat().st_size <= 0,
        f"the secret seed file '{path}' is not there, and '{folder}' holds trials already; give the file that they "
        "were drawn with, or choose another folder.",
    )
    make_secret_seed(Path(path))
    return read_secret_seed(path)


def make_secret_seed(path: Path) -> None:
    """Write 256 random bits to a file that only its owner can read; an existing file is left as it is.

    Raises:
        InputError: The file cannot be made.
    """
    try:
        with suppress(FileExistsError), open(path, "x", opener=_open_privately) as file:
            file.write(f"{secrets.token_hex(32)}\n")
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}); choose another place.") from error


def _open_privately(path: str, flags: int) -> int:
    # readable and writable by the owner only
    return os.open(path, flags, 0o600)


def find_common_secret_seed(records: Iterable[Mapping[str, Any]]) -> str | None:
    """Return the hash of the secret seed that all records were drawn with; None if there is none.

    Raises:
        InputError: The records were drawn with several.
    """
    hashes = sorted({record.get("secret_seed") or "" for record in records})
    require(
        len(hashes) <= 1,
        f"the records were drawn {' and '.join(map(describe_secret_seed, hashes))}; count trials of one secret seed at "
        "a time.",
    )
    return hashes[0] or None if hashes else None


def check_same_secret_seed(holder: str, at_hand: str | None, drawn: str | None) -> None:
    """Raise an `InputError` unless the secret seed at hand is the one that existing trials were drawn with.

    Args:
        holder: Folder or file that holds the trials, in words.
        at_hand: Hash of the secret seed at hand; None if there is none.
        drawn: Hash in the records of the trials; None if they were drawn without one.
    """
    if at_hand == drawn:
        return
    require(drawn is not None, f"{holder} holds trials drawn without a secret seed; leave --secret-seed-file out.")
    what = "no secret seed file was given" if at_hand is None else f"the secret seed file given is that of {at_hand}"
    raise InputError(
        f"{holder} holds trials drawn with the secret seed {drawn}, and {what}; give theirs with --secret-seed-file."
    )


def describe_secret_seed(drawn: str | None) -> str:
    """Return `with the secret seed 0123456789abcdef`, or `without a secret seed`."""
    return f"with the secret seed {drawn}" if drawn else "without a secret seed"

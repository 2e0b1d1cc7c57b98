"""List what remains doubtful in a recording that fits its scenario, one sentence each."""

from collections.abc import Iterator, Mapping

import numpy as np

from apo_bench.assembly import Assembly
from apo_bench.geometry import Array
from apo_bench.importers.recording.arrangement import Arrangement
from apo_bench.importers.recording.averaging import per_axis
from apo_bench.importers.recording.tracks import PoseTrack, span_of

_MANY = 0.25  # share of frames of a part that were left out, which is doubtful
_HIDDEN_S = 0.5  # a part without frames for so long, and for so many usual steps, was hidden
_HIDDEN_FRAMES = 5
_OPEN_MM = 3.0  # smallest gap of a doubtful contact
_OPEN_DEVIATIONS = 5.0  # standard deviations of the pose, added to the gap above
"""A contact is doubtful if it is open by more than the sum of both; a degree counts like a millimetre."""


def list_doubts(
    tracks: Mapping[str, PoseTrack],
    gross: Mapping[str, int],
    arrangement: Arrangement,
    covariance: Array,
    assembly: Assembly,
) -> tuple[str, ...]:
    """Return one sentence for each doubt.

    Args:
        tracks: Track of each part, camera from part.
        gross: Part -> number of frames that were left out, as they are far from the frames around.
        covariance: Covariance of each observed pose, (n, 6, 6), [m, rad].
    """
    return (
        *_gross(tracks, gross),
        *_not_observed(arrangement, assembly),
        *_open_contacts(arrangement, covariance, assembly),
        *_pauses(arrangement, assembly),
        *_hidden(tracks),
    )


def _gross(tracks: Mapping[str, PoseTrack], gross: Mapping[str, int]) -> Iterator[str]:
    """Yield a sentence for each part of which many frames were left out."""
    for part, n in gross.items():
        if n > _MANY * (n + len(tracks[part].t)):
            yield (
                f"{n} of {n + len(tracks[part].t)} frames of '{part}' are far from the frames around, and were left out"
            )


def _not_observed(arrangement: Arrangement, assembly: Assembly) -> Iterator[str]:
    """Yield a sentence for each operation whose end was not observed."""
    for k, interval in enumerate(arrangement.order):
        if interval is None:
            yield f"operation {k + 1} ({assembly.operations[k].main}) was not observed, so its pose is unknown"


def _open_contacts(arrangement: Arrangement, covariance: Array, assembly: Assembly) -> Iterator[str]:
    """Yield a sentence for each operation that leaves a contact further open than its noise explains."""
    for k, fit in arrangement.fits.items():
        mm, deg = np.multiply(per_axis(covariance[k]), (1e3, np.degrees(1.0)))
        if fit.wrong_mm > _OPEN_MM + _OPEN_DEVIATIONS * (mm + deg):
            yield (
                f"operation {k + 1} ({assembly.operations[k].main}) leaves a contact open by {1e3 * fit.gap_m:.1f} mm "
                f"and {np.degrees(fit.angle_rad):.1f} deg, more than its noise explains; check the frames in the "
                "objects file"
            )


def _pauses(arrangement: Arrangement, assembly: Assembly) -> Iterator[str]:
    """Yield a sentence for each part that rested more often than operations ended with it."""
    for part, known in arrangement.intervals.items():
        pauses = [f"{each.begins:.2f} s" for each in known[1:] if each not in arrangement.order]
        if len(pauses) > sum(part in operation.carries for operation in assembly.operations):
            times = ", ".join(pauses)
            yield f"'{part}' also rested at {times}, counted as pauses; state --operation-ends if it was put down"


def _hidden(tracks: Mapping[str, PoseTrack]) -> Iterator[str]:
    """Yield a sentence for each time in which the tracker lost a part."""
    for part, track in tracks.items():
        for i in np.flatnonzero(np.diff(track.t) > max(_HIDDEN_S, _HIDDEN_FRAMES * span_of(track))):
            yield f"'{part}' was hidden from {track.t[i]:.2f} to {track.t[i + 1]:.2f} s"

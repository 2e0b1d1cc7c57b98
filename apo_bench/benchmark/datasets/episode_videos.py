"""Write the images of episodes as videos of a LeRobot data set v3.0: one MP4 for each episode and camera."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.benchmark.datasets.card import FPS
from apo_bench.benchmark.datasets.lerobot_statistics import count_colours, summarise_colours
from apo_bench.geometry import Ints
from apo_bench.simulation.scene import save_film

VIDEO_PATH = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_QUALITY = 8  # of 10
_KEYFRAME_EVERY = 2  # frames, as LeRobot has it, since training reads frames in random order


@final
class EpisodeVideos:
    """Writes the videos of episodes, and counts their colours."""

    def __init__(self, out: Path, files_in_folder: int) -> None:
        """Write into the folder of a data set."""
        self._out = out
        self._files_in_folder = files_in_folder
        self._frames = 0
        self._colours: dict[str, Ints] = {}
        self._features: dict[str, dict[str, Any]] = {}

    def write(self, images: Mapping[str, NDArray[np.uint8]], episode: int) -> dict[str, Any]:
        """Write the videos of the next episode.

        Args:
            images: Camera -> images, (T, height, width, 3).

        Returns:
            Column of the table of episodes -> its value: where the video is, and statistics.

        Raises:
            InputError: The package imageio-ffmpeg is missing, or a file cannot be written.
        """
        columns: dict[str, Any] = {}
        chunk, file = divmod(episode, self._files_in_folder)
        for camera, frames in images.items():
            key = f"observation.images.{camera}"
            path = self._out / VIDEO_PATH.format(video_key=key, chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            save_film(frames, path, FPS, quality=_QUALITY, output_params=["-g", str(_KEYFRAME_EVERY)])
            place = {"chunk_index": chunk, "file_index": file, "from_timestamp": 0.0, "to_timestamp": len(frames) / FPS}
            columns |= {f"videos/{key}/{name}": value for name, value in place.items()}
            colours = count_colours(frames)
            statistics = summarise_colours(colours, len(frames))
            columns |= {f"stats/{key}/{name}": value for name, value in statistics.items()}
            self._colours[key] = self._colours.get(key, np.zeros_like(colours)) + colours
            self._features[key] = describe_video(*frames.shape[1:3])
        self._frames += max(map(len, images.values()), default=0)
        return columns

    @property
    def features(self) -> Mapping[str, dict[str, Any]]:
        """The entries of `features` in `info.json`: name of the images of a camera in LeRobot -> description."""
        return self._features

    def summarise(self) -> dict[str, dict[str, Any]]:
        """The entries of `stats.json`: statistics over all episodes."""
        return {key: summarise_colours(colours, self._frames) for key, colours in self._colours.items()}


def describe_video(height: int, width: int) -> dict[str, Any]:
    """The entry of `features` in `info.json` of videos of a size in pixels."""
    stream = {"height": height, "width": width, "channels": 3, "fps": FPS, "codec": "h264", "pix_fmt": "yuv420p"}
    info = {**{f"video.{name}": value for name, value in stream.items()}, "is_depth_map": False, "has_audio": False}
    return {"dtype": "video", "shape": [height, width, 3], "names": ["height", "width", "channels"], "info": info}

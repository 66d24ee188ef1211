"""MP4 files with the images of one camera, episode after episode."""

from __future__ import annotations

import os
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsm.lerobot.layout import DatasetError

CODEC = "libsvtav1"
"""The encoder: AV1, which LeRobot itself writes by default."""

OPTIONS = {"g": "2", "crf": "30", "preset": "8", "svtav1-params": "lp=1"}
"""A key frame at each second frame, so that single frames are found fast; quality as LeRobot's; one thread."""


class VideoFile:
    """A file that grows by frames, the n-th at n / fps seconds."""

    def __init__(self, path: Path, fps: int, size: tuple[int, int]) -> None:
        """`size` is (height, width); raises `DatasetError` when it is odd, which the pixel format does not allow."""
        # The encoder tells of itself on stderr unless it is asked to keep to errors.
        os.environ.setdefault("SVT_LOG", "1")
        import av

        height, width = size
        if height % 2 or width % 2:
            raise DatasetError(f"{path.name}: expected images of even height and width, got {height} x {width}")
        path.parent.mkdir(parents=True, exist_ok=True)
        self.av = av
        self.container: Any = av.open(str(path), "w", format="mp4")
        self.stream: Any = self.container.add_stream(CODEC, rate=fps, options=dict(OPTIONS))
        self.stream.width, self.stream.height, self.stream.pix_fmt = width, height, "yuv420p"
        self.frame_time = Fraction(1, fps)
        self.frames = 0
        self.written_frames, self.written_bytes = 0, 0

    def put(self, image: NDArray[np.uint8]) -> None:
        """Adds an image, shape (height, width, 3)."""
        frame = self.av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
        frame.pts = self.frames
        frame.time_base = self.frame_time
        self.frames += 1
        self.mux(self.stream.encode(frame))

    def mux(self, packets: list[Any]) -> None:
        """Writes what the encoder gives."""
        for packet in packets:
            self.written_frames += 1
            self.written_bytes += packet.size
            self.container.mux(packet)

    def guess_bytes(self, more: int) -> float:
        """What the file comes to with so many frames more, going by what the encoder has given so far."""
        return self.written_bytes / max(1, self.written_frames) * (self.frames + more)

    def close(self) -> None:
        """Writes what is left."""
        self.mux(self.stream.encode(None))
        self.container.close()

    def __enter__(self) -> VideoFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def describe_video(path: Path) -> dict[str, Any]:
    """What `info.json` says of the videos of a feature, read from one of them."""
    import av

    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        return {
            "video.height": stream.height,
            "video.width": stream.width,
            "video.codec": stream.codec.canonical_name,
            "video.pix_fmt": stream.pix_fmt,
            "video.is_depth_map": False,
            "video.fps": int(stream.average_rate),
            "video.channels": 3,
            "has_audio": False,
        }

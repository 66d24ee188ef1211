"""Statistics of features, as LeRobotDataset v3.0 keeps them for each episode and for all."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsm.lerobot.layout import QUANTILES

Stats = dict[str, list[Any]]
"""`min`, `max`, `mean`, `std`, `count` and quantiles of a feature, in its shape."""

PIXEL_STRIDE = 4
"""Of an image each fourth pixel of each fourth row is counted."""


def number_stats(values: NDArray[Any]) -> Stats:
    """Of a feature with a row for each frame, shape (frames, size)."""
    found = np.asarray(values, dtype=np.float64)
    stats: Stats = {
        "min": found.min(axis=0).tolist(),
        "max": found.max(axis=0).tolist(),
        "mean": found.mean(axis=0).tolist(),
        "std": found.std(axis=0).tolist(),
        "count": [len(found)],
    }
    for name, share in QUANTILES.items():
        stats[name] = np.quantile(found, share, axis=0).tolist()
    return stats


class ImageStats:
    """Counts how often each value of each channel occurs."""

    def __init__(self) -> None:
        self.counts: NDArray[np.int64] = np.zeros((3, 256), dtype=np.int64)
        self.frames = 0

    def add(self, image: NDArray[np.uint8]) -> None:
        """Counts an image, shape (height, width, 3)."""
        thinned = image[::PIXEL_STRIDE, ::PIXEL_STRIDE]
        for channel in range(3):
            self.counts[channel] += np.bincount(thinned[..., channel].ravel(), minlength=256)
        self.frames += 1

    def merge(self, other: ImageStats) -> None:
        """Adds what another has counted."""
        self.counts += other.counts
        self.frames += other.frames

    def stats(self) -> Stats:
        """In the shape (3, 1, 1), values from 0 to 1."""
        levels = np.arange(256) / 255.0
        shares = self.counts / self.counts.sum(axis=1, keepdims=True)
        mean = shares @ levels
        spread = np.sqrt(np.maximum(shares @ levels**2 - mean**2, 0.0))
        present = self.counts > 0
        cumulated = shares.cumsum(axis=1)
        found = {
            "min": levels[present.argmax(axis=1)],
            "max": levels[255 - present[:, ::-1].argmax(axis=1)],
            "mean": mean,
            "std": spread,
        }
        for name, share in QUANTILES.items():
            found[name] = levels[(cumulated >= share - 1e-12).argmax(axis=1)]
        stats: Stats = {name: value.reshape(3, 1, 1).tolist() for name, value in found.items()}
        stats["count"] = [self.frames]
        return stats

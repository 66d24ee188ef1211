"""Help for detectors of your own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm._dsm import Frame


def mask_from_box(
    frame: Frame, box: tuple[float, float, float, float], *, depth_span_m: float = 0.25
) -> NDArray[np.bool_]:
    """The pixels of a box that belong to what stands in its middle, for detectors that give boxes alone.

    ``box`` is left, top, right, bottom in pixels, as most detectors give it. A pixel belongs when its depth is within
    ``depth_span_m`` of the median depth of the box's middle; where nothing came back it does not.
    """
    height, width = frame.depth.shape
    left, right = (int(np.clip(round(value), 0, width)) for value in (box[0], box[2]))
    top, bottom = (int(np.clip(round(value), 0, height)) for value in (box[1], box[3]))
    mask = np.zeros((height, width), dtype=np.bool_)
    inside = frame.depth[top:bottom, left:right]
    rows, columns = inside.shape
    middle = inside[rows // 4 : rows - rows // 4, columns // 4 : columns - columns // 4]
    known = middle[middle > 0.0]
    if known.size:
        near = np.abs(inside - np.median(known)) <= depth_span_m
        mask[top:bottom, left:right] = near & (inside > 0.0)
    return mask

# %% [markdown]
# # Write your own detector
#
# A detector is any object with a method `detect(frame)` that gives masks, names and scores. The one below knows nothing
# but the colour red. A network, YOLO-World for example, plugs in the same way: see `docs/python.md`.

# %%
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import dsm

# %% [markdown]
# Red pixels are put together in blocks of 8 x 8; blocks that touch are one thing. `frame.color` and `frame.depth` are
# numpy arrays on the memory of the picture itself.

# %%
BLOCK = 8


def patches(pixels: NDArray[np.bool_]) -> Iterator[NDArray[np.bool_]]:
    """Masks of the connected patches of `pixels`, by blocks."""
    rows, columns = (side // BLOCK for side in pixels.shape)
    blocks = pixels.reshape(rows, BLOCK, columns, BLOCK).sum(axis=(1, 3)) >= BLOCK * BLOCK // 4
    left = {(int(row), int(column)) for row, column in np.argwhere(blocks)}
    while left:
        patch, edge = np.zeros_like(blocks), [left.pop()]
        while edge:
            row, column = edge.pop()
            patch[row, column] = True
            around = {(row + dy, column + dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)} & left
            left -= around
            edge.extend(around)
        yield pixels & patch.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)


class RedThings:
    """Finds what is red, and calls it so."""

    name = "red-things"

    def __init__(self) -> None:
        self.frames = 0

    def detect(self, frame: dsm.Frame) -> list[dsm.Detection]:
        self.frames += 1
        red, green, blue = np.moveaxis(frame.color.astype(np.int16), 2, 0)
        pixels = (red > 70) & (red > 2 * green) & (red > 2 * blue) & (frame.depth > 0.0)
        return [dsm.Detection(mask, "red thing", 0.7) for mask in patches(pixels) if mask.sum() >= 150]


# %% [markdown]
# The robot turns once on the spot in the kitchen. Every picture of its head camera goes through the detector, on a
# thread of its own, and what it finds goes into the map: by what the pixels show, where they are, and when.

# %%
detector = RedThings()
session = dsm.Session(
    dsm.find_scene("apartment"), seed=1, start=(-1.6, 2.9, 3.1), time_limit_s=60.0, detector=detector
)
session.step(base=(0.0, 0.6), duration_s=11.0)
session.step(duration_s=1.0)

# %%
found = session.map
print(f"{detector.frames} pictures, {found}")
for thing in found.objects:
    x, y, z = thing["center"]
    color = thing["attributes"]["appearance"].get("color")
    print(f"  {thing['name']} ({color}) at ({x:5.2f}, {y:5.2f}, {z:4.2f}), seen in {thing['observations']} pictures")
assert found.objects and all(thing["name"] == "red thing" for thing in found.objects)
session.finish()

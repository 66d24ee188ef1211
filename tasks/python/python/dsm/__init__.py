"""Simulation-in-the-loop robot tasks on a Diverse Semantic Map.

A mobile manipulator drives through a simulated home, sees it through RGB-D cameras, builds a map of
objects, relations and rooms, and does what it is told in plain English.

>>> import dsm
>>> summary = dsm.run_episode("scenes/apartment/episodes/fetch_apple.toml", seed=3)  # doctest: +SKIP
>>> summary["success"]  # doctest: +SKIP
True

Lengths are metres, angles radians, times simulated seconds; x is forward and z is up, cameras look along +z.
"""

from dsm._dsm import (
    Detection,
    Error,
    Frame,
    InputError,
    Map,
    MapBuilder,
    Recording,
    RunError,
    Session,
    World,
    __version__,
    run_episode,
)
from dsm.detectors import mask_from_box
from dsm.scenes import find_episode, find_scene

__all__ = [
    "Detection",
    "Error",
    "Frame",
    "InputError",
    "Map",
    "MapBuilder",
    "Recording",
    "RunError",
    "Session",
    "World",
    "__version__",
    "find_episode",
    "find_scene",
    "mask_from_box",
    "run_episode",
]

"""Reads sequences in the layouts of others with `evo`, numpy and Pillow, and holds their points against ours.

Usage: loaders.py FOLDER; the folder holds {tum,replica,scannet}/ and {tum,replica,scannet}.json: for each frame the places
in the world of the middles of all pixels with depth, row by row.
"""

import json
import sys
from pathlib import Path

import numpy as np
from evo.core.sync import matching_time_indices
from evo.tools.file_interface import read_tum_trajectory_file
from PIL import Image

folder = Path(sys.argv[1])


def places(depth_file, units_in_a_metre, camera, world_from_camera):
    """As TUM's `generate_pointcloud.py` has it: the middle of pixel (0, 0) is at 0."""
    fx, fy, cx, cy = camera
    depth = np.asarray(Image.open(depth_file)).astype(float) / units_in_a_metre
    rows, columns = np.nonzero(depth)
    z = depth[rows, columns]
    points = np.stack([(columns - cx) * z / fx, (rows - cy) * z / fy, z, np.ones_like(z)])
    return (world_from_camera @ points)[:3].T


def associate(first, second, max_difference=0.02):
    """TUM's `associate.py`: the closest pairs first, none twice."""
    candidates = sorted((abs(a - b), a, b) for a in first for b in second if abs(a - b) < max_difference)
    first, second, matches = set(first), set(second), []
    for _, a, b in candidates:
        if a in first and b in second:
            first.remove(a)
            second.remove(b)
            matches.append((a, b))
    return sorted(matches)


def tum():
    def files(name):
        lines = [line.replace(",", " ").split() for line in (folder / "tum" / name).open() if not line.startswith("#")]
        return {float(stamp): file for stamp, file in lines}

    colors, depths = files("rgb.txt"), files("depth.txt")
    trajectory = read_tum_trajectory_file(folder / "tum/groundtruth.txt")
    pairs = associate(colors, depths)
    stamps = np.array([color for color, _ in pairs])
    indices, poses = matching_time_indices(stamps, trajectory.timestamps, max_diff=0.02)
    assert 0 < len(indices) < len(pairs) < len(colors), (indices, pairs)
    for index, pose in zip(indices, poses):
        file = folder / "tum" / depths[pairs[index][1]]
        yield places(file, 5000.0, (525.0, 525.0, 319.5, 239.5), trajectory.poses_se3[pose])


def replica():
    camera = json.loads((folder / "replica/cam_params.json").read_text())["camera"]
    poses = np.loadtxt(folder / "replica/traj.txt").reshape(-1, 4, 4)
    for file, pose in zip(sorted((folder / "replica/results").glob("depth*.png")), poses):
        yield places(file, camera["scale"], [camera[k] for k in ("fx", "fy", "cx", "cy")], pose)


def scannet():
    k = np.loadtxt(folder / "scannet/intrinsic/intrinsic_depth.txt")
    for file in sorted((folder / "scannet/pose").glob("*.txt"), key=lambda path: int(path.stem)):
        pose = np.loadtxt(file)
        if np.isfinite(pose).all():
            depth = folder / "scannet/depth" / (file.stem + ".png")
            yield places(depth, 1000.0, (k[0, 0], k[1, 1], k[0, 2], k[1, 2]), pose)


for layout in (tum, replica, scannet):
    ours = json.loads((folder / f"{layout.__name__}.json").read_text())
    theirs = list(layout())
    assert len(ours) == len(theirs) > 0, (layout.__name__, len(ours), len(theirs))
    for index, (a, b) in enumerate(zip(ours, theirs)):
        assert len(a) == len(b) > 100, (layout.__name__, index, len(a), len(b))
        apart = np.abs(np.array(a) - b).max()
        assert apart < 1e-5, (layout.__name__, index, apart)
    print(f"{layout.__name__}: {len(ours)} frames")

"""Times pyastar2d on the grid of `large` in nav.rs, after the same command has timed ours.

usage: pip install pyastar2d && python robot/benches/astar_peer.py
"""

import statistics
import subprocess
import time

import numpy as np
import pyastar2d

SIDE = 2000
state = 20_260


def draw(below: int) -> int:
    global state
    state = (state * 6_364_136_223_846_793_005 + 1_442_695_040_888_963_407) % 2**64
    return (state >> 33) % below


def grid() -> np.ndarray:
    cost = np.ones((SIDE, SIDE), dtype=np.float32)
    for _ in range(2200):
        column, row, side = draw(1950) + 10, draw(1950) + 10, draw(25) + 5
        cost[column : min(column + side, SIDE - 5), row : min(row + side, SIDE - 5)] = np.inf
    return cost


def main() -> None:
    subprocess.run(["cargo", "bench", "--locked", "-p", "dsm-robot", "--bench", "nav", "--", "A\\*, 2000"], check=True)
    cost = grid()
    start, goal = (2, 2), (1998, 1998)
    times = []
    for _ in range(10):
        begin = time.perf_counter()
        path = pyastar2d.astar_path(cost, start, goal, allow_diagonal=True)
        times.append(1000 * (time.perf_counter() - begin))
    length_m = 0.05 * np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    print(f"pyastar2d: median {statistics.median(times):.0f} ms ({min(times):.0f} to {max(times):.0f}), {length_m:.2f} m")


if __name__ == "__main__":
    main()

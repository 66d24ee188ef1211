"""How long stepping and rendering take through Python: ``step_and_render.py [SECONDS]``.

Held against ``cargo run --release -p dsm-tasks --features mcap --example step_and_render``, which steps the same scene
with the same seed and commands and reads the same pictures.
"""

import sys
import time

import dsm


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    world = dsm.World(dsm.find_scene("apartment"), seed=1)
    begin, begin_cpu_s = time.perf_counter(), time.process_time()
    pictures = checksum = 0
    for _ in range(round(seconds / 0.2)):
        world.step(base=(0.0, 0.5), duration_s=0.2)
        frame = world.read()
        if frame is not None:
            color, depth = frame.color, frame.depth
            height, width = depth.shape
            pictures += 1
            checksum += int(color[height // 2, 0, 0]) + int(depth[0, 0] * 1000.0)
    wall_s, cpu_s = time.perf_counter() - begin, time.process_time() - begin_cpu_s
    print(f"python  {seconds:.0f} simulated s, {pictures} pictures, checksum {checksum}: {wall_s:.3f} s wall, {cpu_s:.2f} s CPU")


if __name__ == "__main__":
    main()

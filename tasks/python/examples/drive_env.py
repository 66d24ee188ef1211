# %% [markdown]
# # Drive a Gymnasium environment
#
# `dsm/FetchObject-v0`, `dsm/NavigateTo-v0` and `dsm/PlaceObject-v0` are episodes as environments: pictures,
# proprioception and the command as text go in, velocities or skills come out, and the judge decides.

# %%
import gymnasium
import numpy as np
from numpy.typing import NDArray

import dsm.envs

# %% [markdown]
# ## Velocities
# An action is a row of values from -1 to 1. This policy knows no goal: it drives where there is room, and else turns.

# %%
env = gymnasium.make("dsm/NavigateTo-v0")
observation, info = env.reset(seed=3)
print("command:", observation["command"])
print("color", observation["color"].shape, "depth", observation["depth"].shape)


def wander(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Forward where the middle of the picture is far away, else to the left."""
    rows, columns = depth.shape
    ahead = depth[rows // 3 : 2 * rows // 3, columns // 3 : 2 * columns // 3]
    known = ahead[ahead > 0.0]
    free = known.size > 0 and float(np.percentile(known, 10)) > 1.0
    action = np.zeros(len(dsm.envs.VELOCITIES), dtype=np.float32)
    action[dsm.envs.VELOCITIES.index("forward" if free else "turn")] = 0.6
    return action


start = observation["proprioception"][2:4]
total = 0.0
for _ in range(50):
    observation, reward, terminated, truncated, info = env.step(wander(observation["depth"]))
    total += float(reward)
    if terminated or truncated:
        break
driven_m = float(np.linalg.norm(observation["proprioception"][2:4] - start))
print(f"{info['time_s']:.1f} simulated s, ends {driven_m:.2f} m from the start, reward {total}")
assert driven_m > 0.2
env.close()

# %% [markdown]
# ## Skills
# With `control="skills"` an action is one of `explore`, `navigate`, `grasp` and `command`. The last one does all that the
# command says, as the command line does.

# %%
env = gymnasium.make("dsm/NavigateTo-v0", control="skills")
env.reset(seed=3)
observation, reward, terminated, truncated, info = env.step(dsm.envs.SKILLS.index("command"))
print(f"{info['step']['command']}: {info['step']['outcome']}, reward {reward}")
assert terminated and reward == 1.0, info["expectations"]
env.close()

# %% [markdown]
# ## Several at a time
# Each world is on its own; their seeds follow one another.

# %%
worlds = gymnasium.make_vec("dsm/NavigateTo-v0", num_envs=2, vectorization_mode="sync", stride=8)
observations, info = worlds.reset(seed=3)
for _ in range(5):
    observations, rewards, ended, late, info = worlds.step(worlds.action_space.sample())
print("color", observations["color"].shape, "rewards", rewards)
worlds.close()

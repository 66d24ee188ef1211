# %% [markdown]
# # Fetch an object by a command
#
# A robot stands somewhere in an apartment that it has never seen. It is told in English what to fetch. It explores,
# builds a map of objects, relations and rooms, finds what the words mean in that map, drives there and lifts it.
#
# Run it with `python fetch_by_command.py [SEED]`, or open it as a notebook: the cells are marked.

# %%
import sys

import dsm

SEED = int(sys.argv[1]) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 1

# %% [markdown]
# A *session* is a run in the hands of your program: robot, senses, map and skills. The scene is that of an episode file,
# which also says what a judge expects in the end. The seed draws where the robot starts, where things lie, and the light.

# %%
session = dsm.Session(dsm.find_episode("fetch_apple"), seed=SEED)
frame = session.frame()
print("at the start:", session.map, frame)

# %% [markdown]
# There are five apples in this apartment. Only one lies on a white shelf that has the white cabinet beside it.

# %%
command = "Grasp the apple on the white shelf with white cabinet"
step = session.run(command)
print(f"{command}: {step['outcome']} after {step['duration_s']:.0f} simulated s: {step['reason']}")

# %% [markdown]
# The map that was built on the way can be looked into, and asked.

# %%
things = session.map
print(things)
for thing in sorted(things.objects, key=lambda thing: -thing["observations"])[:5]:
    x, y, z = thing["center"]
    print(f"  {thing['name']:14} at ({x:5.2f}, {y:5.2f}, {z:4.2f}) in {thing['room']}, seen {thing['observations']} times")
for text in ("the fridge", "the apple", "the unicorn"):
    answer = things.ground(text)
    print(f"  {text}: {answer['status']}, {answer['decided_by']}")

# %% [markdown]
# In the end the judge, who alone knows the truth, says whether it was the right apple and whether it was held.

# %%
summary = session.finish()
for expectation in summary["expectations"]:
    print(f"{expectation['kind']}: {'holds' if expectation['passed'] else 'FAILS'}: {expectation['measured']}")
assert summary["success"], summary["failure"]

"""What several tests need: the scene that ships with the program, and a map that was built in it once."""

from pathlib import Path

import pytest

import dsm

# The kitchen of the apartment.
KITCHEN = (-1.6, 2.9, 3.1)


@pytest.fixture(scope="session")
def explored() -> dsm.Map:
    """What a turn on the spot in the kitchen shows, without sensor noise."""
    session = dsm.Session(dsm.find_scene("apartment"), seed=1, start=KITCHEN, perception="oracle")
    session.step(base=(0.0, 0.8), duration_s=8.0)
    session.step(duration_s=1.0)
    found = session.map
    session.finish()
    return found


SMALL_ROOM = """<mujoco model="small">
  <worldbody>
    <geom name="floor" type="box" size="2 2 0.05" pos="0 0 -0.05"/>
    <geom type="box" size=".05 2 1" pos="2 0 1"/><geom type="box" size=".05 2 1" pos="-2 0 1"/>
    <geom type="box" size="2 .05 1" pos="0 2 1"/><geom type="box" size="2 .05 1" pos="0 -2 1"/>
    <body name="table_1" pos="1.4 0 0.2"><geom type="box" size="0.3 0.3 0.2"/></body>
  </worldbody>
</mujoco>
"""

SEMANTICS = """version = 1
name = "small"

[start]
areas = [{ x_m = -0.8, y_m = 0.0 }]

[[room]]
name = "kitchen"
polygon = [[-2, -2], [2, -2], [2, 2], [-2, 2]]

[[object]]
body = "table_1"
category = "table"
"""

EPISODE = """version = 1
scene = "scene.xml"
time_limit_s = 200

[[step]]
command = "Navigate to the table"

[[expect]]
kind = "robot_near"
object = "table_1"
"""


@pytest.fixture(scope="session")
def small_episode(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An episode in a room of four by four metres with one table: skills end soon there."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "scene.xml").write_text(SMALL_ROOM)
    (folder / "semantics.toml").write_text(SEMANTICS)
    (folder / "episode.toml").write_text(EPISODE)
    return folder / "episode.toml"

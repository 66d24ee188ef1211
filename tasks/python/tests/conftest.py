"""What several tests need: the scene that ships with the program, and a map that was built in it once."""

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

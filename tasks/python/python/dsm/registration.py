"""Names of the environments of :mod:`dsm.envs` for Gymnasium, which finds this module by itself once the package is
installed.
"""

from gymnasium.envs.registration import register, registry

SHIPPED = {
    "dsm/FetchObject-v0": "fetch_apple",
    "dsm/NavigateTo-v0": "navigate_chair_near_fridge",
    "dsm/PlaceObject-v0": "put_cube_on_coffee_table",
}
"""Environments with the episode that each has unless another is given."""


def register_envs() -> None:
    """Registers the environments, once."""
    for name, episode in SHIPPED.items():
        if name not in registry:
            register(name, entry_point="dsm.envs:make_shipped", kwargs={"episode": episode})
    if "dsm/Task-v0" not in registry:
        register("dsm/Task-v0", entry_point="dsm.envs:TaskEnv")

"""Where scenes are."""

from __future__ import annotations

from pathlib import Path

from dsm._dsm import CHECKOUT, InputError


def find_scene(name: str) -> Path:
    """The folder of a scene that ships with the program, by name: below the working directory, or in the checkout
    that this package was built from. Its episodes are in ``episodes/``.
    """
    roots = [Path("scenes"), Path(CHECKOUT).resolve() / "scenes"]
    for root in roots:
        if (root / name / "scene.xml").is_file():
            return root / name
    known = sorted({scene.parent.name for root in roots for scene in root.glob("*/scene.xml")})
    raise InputError(f"scene `{name}`: expected one of: {', '.join(known) or 'none (no checkout found)'}")


def find_episode(name: str, scene: str = "apartment") -> Path:
    """The file of an episode that ships with the program, by name."""
    folder = find_scene(scene) / "episodes"
    file = folder / f"{name}.toml"
    if file.is_file():
        return file
    known = ", ".join(sorted(episode.stem for episode in folder.glob("*.toml")))
    raise InputError(f"episode `{name}` of scene `{scene}`: expected one of: {known}")

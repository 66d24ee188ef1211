"""The files that an episode of a suite is made from, and how they come to a machine that does not have them."""

from __future__ import annotations

import hashlib
import io
import os
import zipfile
from dataclasses import dataclass
from pathlib import Path

LARGEST_BYTES = 256 << 20
"""What the files of one scene may come to."""


class InputsTooLarge(Exception):
    """The folder of a scene holds more than a scene."""


@dataclass(frozen=True)
class Inputs:
    """Which files an episode is made from, as the machine sees them on which the suite was started."""

    working_folder: str
    """Where it was started."""
    file: str
    """The episode file as it was named there."""
    root: str
    """The folder that all files lie below."""
    files: tuple[str, ...]
    """The files, relative to `root`, sorted: the folder of the scene, and the episode file."""
    digest: str
    """Of names and bytes."""


def list_inputs(file: Path, scene: Path) -> Inputs:
    """Lists the folder of a scene and the episode file.

    Raises `InputsTooLarge`: the folder holds more than 256 MiB.
    """
    folder = scene.resolve().parent
    found = {path for path in folder.rglob("*") if path.is_file()} | {file.resolve()}
    size = sum(path.stat().st_size for path in found)
    if size > LARGEST_BYTES:
        raise InputsTooLarge(
            f"{folder}: expected the folder of a scene with at most {LARGEST_BYTES >> 20} MiB, got {size >> 20} MiB;"
            " move the scene into a folder of its own"
        )
    root = Path(os.path.commonpath([folder, file.resolve().parent]))
    files = tuple(sorted(str(path.relative_to(root)) for path in found))
    return Inputs(os.getcwd(), str(file), str(root), files, digest_files(root, files))


def digest_files(root: Path, files: tuple[str, ...]) -> str:
    """The digest of names and bytes; raises `OSError` when a file is not there."""
    digest = hashlib.sha256()
    for name in files:
        content = (root / name).read_bytes()
        digest.update(f"{name}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def pack_inputs(inputs: Inputs) -> bytes:
    """The files in one archive."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name in inputs.files:
            archive.writestr(name, (Path(inputs.root) / name).read_bytes())
    return packed.getvalue()


def has_inputs(inputs: Inputs) -> bool:
    """Whether this machine sees the same files in the same places, as with a shared file system."""
    try:
        return Path(inputs.working_folder).is_dir() and digest_files(Path(inputs.root), inputs.files) == inputs.digest
    except OSError:
        return False


def unpack_inputs(inputs: Inputs, packed: bytes, folder: Path) -> Path:
    """Lays the files below a folder and gives the episode file there."""
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        archive.extractall(folder)
    file = (Path(inputs.working_folder) / inputs.file).resolve()
    return folder / os.path.relpath(file, inputs.root)

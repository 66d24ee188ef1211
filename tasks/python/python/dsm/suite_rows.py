"""The rows of a suite as a Parquet file."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

NAME = "results.parquet"
"""Name of the file."""


def write_rows(folder: Path, program: Sequence[str]) -> Path:
    """Writes the episodes of `suite.json` below `folder`, a row each, sorted by episode and seed.

    The columns are those of `suite.json`; what is nested there is named by its way, as `metrics.spl`. Their types come
    from the program's own schema, so an empty column has the type of a full one.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = json.loads(subprocess.run([*program, "schema", "suite"], stdout=subprocess.PIPE, check=True).stdout)
    fields = list_fields(schema["$defs"]["SuiteEpisode"], schema["$defs"], ())
    episodes = json.loads((folder / "suite.json").read_text())["episodes"]
    columns = [
        pa.array([find_value(episode, way) for episode in episodes], type=arrow_type(pa, kind)) for way, kind in fields
    ]
    table = pa.table(columns, names=[".".join(way) for way, _ in fields])
    path = folder / NAME
    part = path.with_name(f".part-{NAME}")
    pq.write_table(table, part, compression="zstd")
    os.replace(part, path)
    return path


def list_fields(
    shape: dict[str, Any], named: dict[str, Any], way: tuple[str, ...]
) -> list[tuple[tuple[str, ...], dict[str, Any]]]:
    """Each value that is no object, with the way to it and its JSON schema."""
    fields = []
    for name, inner in shape["properties"].items():
        plain = resolve(inner, named)
        if "properties" in plain:
            fields += list_fields(plain, named, (*way, name))
        else:
            fields.append(((*way, name), plain))
    return fields


def resolve(shape: dict[str, Any], named: dict[str, Any]) -> dict[str, Any]:
    """The schema behind references, and of what may be null."""
    if "$ref" in shape:
        return resolve(named[shape["$ref"].rsplit("/", 1)[1]], named)
    options = [option for option in shape.get("anyOf", []) if option.get("type") != "null"]
    return resolve(options[0], named) if len(options) == 1 else shape


def arrow_type(pa: Any, shape: dict[str, Any]) -> Any:
    """The column type of a JSON schema without properties."""
    kinds = shape.get("type", "string")
    kind = next(kind for kind in ([kinds] if isinstance(kinds, str) else kinds) if kind != "null")
    if kind == "array":
        return pa.list_(arrow_type(pa, shape["items"]))
    if kind == "integer":
        return pa.uint64() if shape.get("format") == "uint64" else pa.int64()
    return {"number": pa.float64(), "boolean": pa.bool_()}.get(kind, pa.string())


def find_value(episode: dict[str, Any], way: tuple[str, ...]) -> Any:
    """The value at the end of a way; `None` where the way ends before."""
    value: Any = episode
    for name in way:
        value = value.get(name) if isinstance(value, dict) else None
    return value

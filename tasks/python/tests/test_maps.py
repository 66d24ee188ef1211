"""Contract: maps are opened, asked and saved as plain data; what is damaged or no map says so."""

from pathlib import Path

import numpy as np
import pytest

import dsm


def test_a_map_holds_objects_relations_and_rooms(explored: dsm.Map) -> None:
    names = {thing["name"] for thing in explored.objects}
    assert {"fridge", "table"} & names, names
    ids = {thing["id"] for thing in explored.objects}
    assert explored.relations and all({r["from"], r["to"]} <= ids for r in explored.relations)
    assert explored.rooms and all(len(room["polygon"]) >= 3 for room in explored.rooms)


def test_words_are_grounded(explored: dsm.Map) -> None:
    found = explored.ground("the fridge")
    assert found["status"] == "found"
    by_id = {thing["id"]: thing["name"] for thing in explored.objects}
    assert found["object_id"] is not None and by_id[found["object_id"]] == "fridge"
    assert explored.ground("the unicorn")["status"] == "absent"
    assert explored.ground("")["status"] == "unparsed"
    assert explored.ground("the fridge", world_from_viewer=np.eye(4))["status"] == "found"


def test_maps_survive_a_file(tmp_path: Path, explored: dsm.Map) -> None:
    file = tmp_path / "map.dsm"
    explored.save(file)
    again = dsm.Map.open(file)
    assert (again.objects, again.relations, again.rooms) == (explored.objects, explored.relations, explored.rooms)
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    with pytest.warns(UserWarning, match="map.dsm"):
        part = dsm.Map.open(file)
    assert len(part.objects) <= len(explored.objects)
    file.write_text("no map at all")
    with pytest.raises(dsm.InputError, match="not a map file"):
        dsm.Map.open(file)
    with pytest.raises(dsm.InputError, match="models"):
        explored.ground("the fridge", backend="models.toml")


def test_maps_are_built_from_frames_of_ones_own() -> None:
    world = dsm.World(dsm.find_scene("apartment"), seed=1, start=(-1.6, 2.9, 3.1), perception="oracle")
    builder = dsm.MapBuilder(detector="halves")
    frames = 0
    while frames < 12:
        world.step(base=(0.0, 0.2), duration_s=0.2)
        frame = world.read()
        if frame is None:
            continue
        frames += 1
        near = (frame.depth > 0.0) & (frame.depth < 2.5)
        builder.observe(frame, [dsm.Detection(near, "box")] if near.sum() > 500 else [])
    assert {thing["name"] for thing in builder.map.objects} == {"box"}
    assert builder.map.ground("the box")["candidates"]
    assert frame is not None
    with pytest.raises(dsm.InputError, match="box"):
        builder.observe(frame, [dsm.Detection(near[::2, ::2], "box")])

"""Reads a Rerun recording with PyPI's `rerun-sdk` and holds it against the sequence and the map of the same run.

Usage: rerun_file.py FOLDER; the folder holds run.rrd, again.rrd, shown.json and seq/{frames,detections}.jsonl.
"""

import array
import collections
import json
import sys
from pathlib import Path

from rerun.chunk import RrdReader

folder = Path(sys.argv[1])
frames = [json.loads(line) for line in (folder / "seq/frames.jsonl").open()]
detections = [json.loads(line) for line in (folder / "seq/detections.jsonl").open()]
shown = json.loads((folder / "shown.json").read_text())

reader = RrdReader(folder / "run.rrd")
[recording] = reader.recordings()
assert recording.application_id == "dsm" and "seed" in recording.recording_id, recording
# The index at the end lists what the file holds.
chunks = reader.stream().to_chunks()
assert len(reader.store().stream().to_chunks()) == len(chunks)
# The same run gives the same chunks.
again = RrdReader(folder / "again.rrd").stream().to_chunks()
assert [chunk.id for chunk in chunks] == [chunk.id for chunk in again]
assert all(a.to_record_batch().equals(b.to_record_batch(), check_metadata=True) for a, b in zip(chunks, again))
# Per entity: (stamp, {component: values of the row}), in order of time.
rows = collections.defaultdict(list)
static = collections.defaultdict(dict)
for chunk in chunks:
    batch = chunk.to_record_batch()
    columns = {}
    for index, field in enumerate(batch.schema):
        facts = {k.decode(): v.decode() for k, v in (field.metadata or {}).items()}
        columns[field.name] = (facts, batch.column(index))
    assert chunk.is_static or chunk.timeline_names == ["sim_time"], chunk.timeline_names
    data = {
        facts["rerun:component"]: column
        for facts, column in columns.values()
        if facts.get("rerun:kind", "data") == "data" and "rerun:component" in facts
    }
    for row in range(batch.num_rows):
        values = {name: column[row].as_py() for name, column in data.items()}
        values = {name: value for name, value in values.items() if value is not None}
        if chunk.is_static:
            static[chunk.entity_path].update(values)
        else:
            stamp = columns["sim_time"][1][row].value
            rows[chunk.entity_path].append((stamp, values))
for path in rows:
    rows[path].sort(key=lambda row: row[0])
assert "ViewCoordinates:xyz" in static["/world"], static


def close(a, b, tolerance=1e-6):
    return len(a) == len(b) and all(abs(x - y) <= tolerance * max(1, abs(y)) for x, y in zip(a, b))


camera = "/world/camera/head"
for path in ("", "/color", "/depth", "/detections", "/masks", "/associations"):
    stamps = [stamp for stamp, _ in rows[camera + path]]
    assert stamps == [frame["stamp"] for frame in frames], (path, len(stamps), len(frames))
taken = 0
for index, (frame, found) in enumerate(zip(frames, detections)):
    at = {path: rows[camera + path][index][1] for path in ("", "/color", "/depth", "/detections", "/masks", "/associations")}
    [translation], [quaternion] = at[""]["Transform3D:translation"], at[""]["Transform3D:quaternion"]
    assert close(translation, frame["world_from_camera"]["translation"]), (index, translation)
    assert close(quaternion, frame["world_from_camera"]["rotation"]), (index, quaternion)
    model = frame["model"]
    [matrix] = at[""]["Pinhole:image_from_camera"]
    # Column by column.
    assert close(matrix, [model["fx"], 0, 0, 0, model["fy"], 0, model["cx"], model["cy"], 1]), matrix
    assert at[""]["Pinhole:resolution"] == [[model["width"], model["height"]]]
    for name, archetype in (("color", "EncodedImage"), ("depth", "EncodedDepthImage")):
        image = at["/" + name]
        assert image[archetype + ":media_type"] == ["image/png"]
        [blob] = image[archetype + ":blob"]
        assert bytes(blob) == (folder / "seq" / frame[name]).read_bytes(), (name, index)
    assert at["/depth"]["EncodedDepthImage:meter"] == [1000.0]
    seen = [item for item in found["items"] if item["runs"]]
    labels = [label.rsplit(" ", 1)[0] for label in at["/detections"]["Boxes2D:labels"]]
    assert labels == [item["name"] for item in seen], index
    centers, halves = (at["/detections"].get("Boxes2D:" + name, []) for name in ("centers", "half_sizes"))
    assert len(centers) == len(halves) == len(seen), (index, len(centers))
    for center, half, item in zip(centers, halves, seen):
        spans = [(s % model["width"], s % model["width"] + n, s // model["width"]) for s, n in item["runs"]]
        left, right = min(s[0] for s in spans), max(s[1] for s in spans)
        top, bottom = min(s[2] for s in spans), max(s[2] for s in spans) + 1
        assert close(center, [(left + right) / 2, (top + bottom) / 2]), (index, center)
        assert close(half, [(right - left) / 2, (bottom - top) / 2]), (index, half)
    # Masks: 16 bits, a place in the list from 1.
    wanted = [0] * (model["width"] * model["height"])
    for place, item in enumerate(found["items"]):
        for start, length in item["runs"]:
            wanted[start : start + length] = [place + 1] * length
    [buffer] = at["/masks"]["SegmentationImage:buffer"]
    assert bytes(buffer) == array.array("H", wanted).tobytes(), index
    link = at["/associations"]
    places, objects = link["dsm.Associations:detection"], link["dsm.Associations:object"]
    assert len(set(places)) == len(places) == len(set(objects)) == len(objects)
    assert link["dsm.Associations:name"] == [found["items"][place]["name"] for place in places]
    taken += len(places)
assert taken > 10, taken
# The base stands in a frame's footprint, and its way is all its poses.
bases = rows["/world/base"]
assert len(bases) == len(frames)
for frame, (stamp, base) in zip(frames, bases):
    [translation] = base["Transform3D:translation"]
    assert stamp == frame["stamp"] and close(translation[:2], frame["carrier"]["footprint"][0])
[(_, path)] = rows["/world/path"]
[strip] = path["LineStrips3D:strips"]
assert strip == [base["Transform3D:translation"][0] for _, base in bases]
# What was sent, and how the motion stood.
for entity in ("/command/base/turn_rad_per_s", "/command/arm/arm_1_joint", "/command/head/head_pan_joint"):
    stamps = [stamp for stamp, _ in rows[entity]]
    assert stamps and stamps == sorted(set(stamps)), entity
speeds = [abs(value) for _, row in rows["/command/base/turn_rad_per_s"] for value in row["Scalars:scalars"]]
assert 0 < max(speeds) < 3, max(speeds)
margins = rows["/margins/speed_m_per_s"]
assert abs(len(margins) - (margins[-1][0] - margins[0][0]) / 1e8) < 3, len(margins)
assert rows["/margins/clearance_m"]
assert rows["/log"][0][1]["TextLog:text"][0].startswith("step 0"), rows["/log"][0]
# The map: what its entities hold in the end.
stable = {}
for entity, history in rows.items():
    if not entity.startswith("/world/map/"):
        continue
    _, last = history[-1]
    if "Clear:is_recursive" in last:
        continue
    if last["dsm.Object:state"] == ["stable"]:
        stable[int(entity.rsplit("/", 1)[1])] = last
assert set(stable) == {o["id"] for o in shown["objects"]}, (set(stable), shown["objects"])
for known in shown["objects"]:
    last = stable[known["id"]]
    assert last["dsm.Object:name"] == last["Boxes3D:labels"] == [known["name"]]
    assert close(last["Boxes3D:centers"][0], known["center"])
    assert close([2 * half for half in last["Boxes3D:half_sizes"][0]], known["size"])
    w, x, y, z = known["quat_wxyz"]
    assert close(last["Boxes3D:quaternions"][0], [x, y, z, w])
    assert last["Boxes3D:colors"][0] & 0xFF == 153, last["Boxes3D:colors"]
print(f"{len(frames)} frames, {len(rows)} entities, {len(stable)} objects")

"""Reads an MCAP file with PyPI's `mcap` and holds it against the sequence and the map of the same run.

Usage: mcap_file.py FOLDER; the folder holds run.mcap, shown.json and seq/{frames,detections}.jsonl.
"""

import base64
import collections
import json
import struct
import sys
from pathlib import Path

from mcap.reader import make_reader

folder = Path(sys.argv[1])
frames = [json.loads(line) for line in (folder / "seq/frames.jsonl").open()]
detections = [json.loads(line) for line in (folder / "seq/detections.jsonl").open()]
shown = json.loads((folder / "shown.json").read_text())
messages = collections.defaultdict(list)
with (folder / "run.mcap").open("rb") as stream:
    reader = make_reader(stream, validate_crcs=True)
    for schema, channel, message in reader.iter_messages():
        assert schema.encoding == "jsonschema" and channel.message_encoding == "json"
        described = json.loads(schema.data)
        data = json.loads(message.data)
        assert described["title"] == schema.name and set(data) <= set(described["properties"]), schema.name
        messages[channel.topic].append((schema.name, message.log_time, data))
    statistics = reader.get_summary().statistics
assert statistics.message_count == sum(map(len, messages.values()))
schemas = {
    "/camera/head/color": "foxglove.CompressedImage",
    "/camera/head/depth": "foxglove.CompressedImage",
    "/camera/head/calibration": "foxglove.CameraCalibration",
    "/camera/head/detections": "foxglove.ImageAnnotations",
    "/tf": "foxglove.FrameTransform",
    "/base": "foxglove.PoseInFrame",
}
for topic, schema in schemas.items():
    assert len(messages[topic]) == len(frames), (topic, len(messages[topic]))
    assert all(m[0] == schema for m in messages[topic]), topic
for index, (frame, found) in enumerate(zip(frames, detections)):
    stamp = frame["stamp"]
    for topic in schemas:
        assert messages[topic][index][1] == stamp, (topic, index)
    for topic in ("color", "depth"):
        image = base64.b64decode(messages[f"/camera/head/{topic}"][index][2]["data"])
        assert image == (folder / "seq" / frame[topic]).read_bytes(), (topic, index)
        assert struct.unpack(">II", image[16:24]) == (frame["model"]["width"], frame["model"]["height"])
    transform = messages["/tf"][index][2]
    assert [transform["translation"][k] for k in "xyz"] == frame["world_from_camera"]["translation"]
    assert [transform["rotation"][k] for k in "xyzw"] == frame["world_from_camera"]["rotation"]
    texts = [t["text"].rsplit(" ", 1)[0] for t in messages["/camera/head/detections"][index][2]["texts"]]
    assert texts == [item["name"] for item in found["items"] if item["runs"]], index
entities = {}
for schema, _, update in messages["/map"]:
    assert schema == "foxglove.SceneUpdate"
    for deletion in update["deletions"]:
        entities.pop(deletion["id"], None)
    for entity in update["entities"]:
        entities[entity["id"]] = entity
stable = {}
for entity in entities.values():
    facts = {pair["key"]: pair["value"] for pair in entity["metadata"]}
    if facts["state"] == "stable":
        stable[int(entity["id"])] = (facts["name"], entity["cubes"][0])
assert set(stable) == {o["id"] for o in shown["objects"]}, (set(stable), shown["objects"])
for known in shown["objects"]:
    name, cube = stable[known["id"]]
    assert name == known["name"]
    assert [cube["pose"]["position"][k] for k in "xyz"] == known["center"]
    assert [cube["size"][k] for k in "xyz"] == known["size"]
    assert [cube["pose"]["orientation"][k] for k in "wxyz"] == known["quat_wxyz"]
print(f"{len(frames)} frames, {len(stable)} objects")

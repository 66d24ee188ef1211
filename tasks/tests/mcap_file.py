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
    "/camera/head/associations": "dsm.Associations",
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
# Detections are taken for objects that the map then knows, one to one.
taken, unknown = 0, 0
for (_, stamp, message), found in zip(messages["/camera/head/associations"], detections):
    objects = [item["object"] for item in message["items"]]
    places = [item["detection"] for item in message["items"]]
    assert len(set(objects)) == len(objects) and len(set(places)) == len(places)
    assert [item["name"] for item in message["items"]] == [found["items"][place]["name"] for place in places]
    put = {e["id"] for _, when, update in messages["/map"] if when == stamp for e in update["entities"]}
    gone = {d["id"] for _, when, update in messages["/map"] if when == stamp for d in update["deletions"]}
    # Some are merged into others before the map gets them.
    unknown += len({str(o) for o in objects} - put - gone)
    taken += len(objects)
assert taken > 10 and unknown <= taken / 4, (taken, unknown)
# The base stands in a frame's footprint, and its way is all its poses.
for frame, (_, _, base) in zip(frames, messages["/base"]):
    place, _ = frame["carrier"]["footprint"]
    assert [base["pose"]["position"][k] for k in "xy"] == place
[(schema, _, path)] = messages["/path"]
assert schema == "foxglove.PosesInFrame" and path["poses"] == [m[2]["pose"] for m in messages["/base"]]
# What was sent: the robot looks around.
for topic, schema in {
    "/command/base": "dsm.BaseCommand",
    "/command/arm": "foxglove.JointStates",
    "/command/head": "foxglove.JointStates",
}.items():
    sent = messages[topic]
    assert sent and all(m[0] == schema for m in sent), (topic, len(sent))
    stamps = [m[1] for m in sent]
    assert stamps == sorted(set(stamps)), topic
    plain = [{k: v for k, v in m[2].items() if k != "timestamp"} for m in sent]
    assert all(a != b for a, b in zip(plain, plain[1:])), topic
joints = {j["name"] for m in messages["/command/arm"] for j in m[2]["joints"]}
assert "arm_1_joint" in joints and "head_pan_joint" not in joints, joints
speeds = [abs(m[2]["turn_rad_per_s"]) + abs(m[2]["forward_m_per_s"]) for m in messages["/command/base"]]
assert 0 < max(speeds) < 3, max(speeds)
margins = [m for m in messages["/margins"]]
assert all(m[0] == "dsm.Margins" for m in margins)
# Ten a second.
assert abs(len(margins) - (margins[-1][1] - margins[0][1]) / 1e8) < 3, len(margins)
assert any(m[2]["clearance_m"] is not None for m in margins)
said = [m[2]["message"] for m in messages["/log"]]
assert said[0].startswith("step 0"), said
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

"""Reads what `dsm map export` wrote with the libraries that others use, and holds it against `dsm map show --json`.

Usage: exchange.py FOLDER; the folder holds map.{json,ply,glb,csv,dsg.json} and shown.json. Writes again.dsg.json.
"""

import csv
import json
import math
import struct
import sys
from pathlib import Path

import plyfile
import pygltflib
import spark_dsg

folder = Path(sys.argv[1])
shown = json.loads((folder / "shown.json").read_text())
objects = {o["id"]: o for o in shown["objects"]}
points = json.loads((folder / "points.json").read_text())


def close(a, b, tolerance=1e-6):
    return len(a) == len(b) and all(abs(x - y) <= tolerance for x, y in zip(a, b))


def same(a, b):
    """Equal, numbers up to the precision in which some are kept."""
    if isinstance(a, dict):
        return isinstance(b, dict) and a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list):
        return isinstance(b, list) and len(a) == len(b) and all(map(same, a, b))
    return abs(a - b) <= 1e-6 if isinstance(a, float) else a == b


# PLY: each point belongs to its object and lies where it lay.
vertices = plyfile.PlyData.read(folder / "map.ply")["vertex"]
assert len(vertices) == sum(len(p) for p in points.values()), len(vertices)
for identity, expected in points.items():
    own = [v for v in vertices if v["instance"] == int(identity)]
    assert len(own) == len(expected), identity
    for vertex, point in zip(own, expected):
        assert close([vertex[k] for k in "xyz"], point[:3]), (identity, vertex, point)
        assert [int(vertex[k]) for k in ("red", "green", "blue")] == point[3:], (identity, vertex, point)

# glTF: named nodes with poses; the points, moved by their node, lie where they lay.
gltf = pygltflib.GLTF2().load(str(folder / "map.glb"))
blob = gltf.binary_blob()
root = gltf.nodes[gltf.scenes[gltf.scene].nodes[0]]
assert close(root.rotation, [-math.sqrt(0.5), 0, 0, math.sqrt(0.5)])
assert len(root.children) == len(objects)
assert same(root.extras["rooms"], shown["rooms"]) and same(root.extras["relations"], shown["relations"])


def read(accessor, width, code):
    a = gltf.accessors[accessor]
    start = gltf.bufferViews[a.bufferView].byteOffset
    size = struct.calcsize(f"<{width}{code}")
    return [struct.unpack_from(f"<{width}{code}", blob, start + i * size) for i in range(a.count)]


def rotate(q, p):
    x, y, z, w = q
    t = [2 * (y * p[2] - z * p[1]), 2 * (z * p[0] - x * p[2]), 2 * (x * p[1] - y * p[0])]
    c = [y * t[2] - z * t[1], z * t[0] - x * t[2], x * t[1] - y * t[0]]
    return [p[i] + w * t[i] + c[i] for i in range(3)]


def srgb(light):
    c = 12.92 * light if light <= 0.0031308 else 1.055 * light ** (1 / 2.4) - 0.055
    return round(255 * c)


for child in root.children:
    node = gltf.nodes[child]
    known = objects[node.extras["id"]]
    assert node.name == known["name"] and same(node.extras, known)
    assert close(node.translation, known["center"])
    w, x, y, z = known["quat_wxyz"]
    assert close(node.rotation, [x, y, z, w])
    primitives = gltf.meshes[node.mesh].primitives
    expected = points[str(known["id"])]
    assert len(primitives) == (2 if expected else 1)
    if expected:
        places = read(primitives[0].attributes.POSITION, 3, "f")
        colors = read(primitives[0].attributes.COLOR_0, 4, "H")
        assert len(places) == len(expected)
        for place, color, point in zip(places, colors, expected):
            moved = [a + b for a, b in zip(rotate(node.rotation, place), node.translation)]
            assert close(moved, point[:3], 1e-5), (moved, point)
            assert [srgb(c / 65535) for c in color[:3]] == point[3:], (color, point)
    corners = read(primitives[-1].attributes.POSITION, 3, "f")
    extent = [max(c[i] for c in corners) - min(c[i] for c in corners) for i in range(3)]
    assert len(corners) == 8 and close(extent, known["size"], 1e-6)

# CSV.
rows = list(csv.DictReader((folder / "map.csv").open(newline="")))
assert len(rows) == len(objects)
for row in rows:
    known = objects[int(row["id"])]
    assert row["name"] == known["name"] and row["room"] == (known["room"] or "")
    assert close([float(row[k]) for k in ("x_m", "y_m", "z_m")], known["center"])
    assert close([float(row[k]) for k in ("size_x_m", "size_y_m", "size_z_m")], known["size"])
    assert close([float(row[k]) for k in ("qw", "qx", "qy", "qz")], known["quat_wxyz"])

# JSON.
assert json.loads((folder / "map.json").read_text()) == shown

# spark_dsg: objects, rooms, boxes, names; then saved again by the library.
graph = spark_dsg.DynamicSceneGraph.load(str(folder / "map.dsg.json"))
layers = {"OBJECTS": [], "ROOMS": []}
for name, nodes in layers.items():
    nodes.extend(graph.get_layer(name).nodes)
assert len(layers["OBJECTS"]) == len(objects) and len(layers["ROOMS"]) == len(shown["rooms"])
for node in layers["OBJECTS"]:
    known = objects[node.id.category_id]
    a = node.attributes
    assert a.name == known["name"] and close(a.position, known["center"])
    assert close(a.bounding_box.dimensions, known["size"], 1e-6)
    assert close(a.bounding_box.world_P_center, known["center"], 1e-5)
    w, x, y, z = known["quat_wxyz"]
    column = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]
    assert close([row[0] for row in a.bounding_box.world_R_center], column, 1e-5)
    labels = graph.get_labelspace(2, 0)
    assert labels.get_category(a.semantic_label) == known["name"] if hasattr(labels, "get_category") else True
for node in layers["ROOMS"]:
    assert node.attributes.name == next(r["name"] for r in shown["rooms"] if r["id"] == node.id.category_id)
related = {frozenset((r["from"], r["to"])) for r in shown["relations"]}
drawn = {
    frozenset((spark_dsg.NodeSymbol(e.source).category_id, spark_dsg.NodeSymbol(e.target).category_id))
    for e in graph.get_layer("OBJECTS").edges
}
assert drawn == related, (drawn, related)
graph.save(str(folder / "again.dsg.json"), False)
print(f"{len(objects)} objects, {len(vertices)} points, {len(drawn)} edges")

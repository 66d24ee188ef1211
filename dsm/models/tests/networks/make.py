"""Makes the small networks and the golden values of tests/networks.rs: `python3 make.py`, with numpy and onnx.

Each network has the inputs and outputs of a real one, with its true shapes, and a few arithmetic nodes instead of weights.
The goldens come from numpy alone: pre- and post-processing are written a second time here, from the papers' and the
libraries' descriptions, and the networks are evaluated by formulas, not by an ONNX runtime. Where onnxruntime is installed,
`make.py --check` holds the formulas to it, and the resizing to Pillow.
"""

import json
import pathlib
import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

HERE = pathlib.Path(__file__).parent
F32, I64 = TensorProto.FLOAT, TensorProto.INT64


# A picture that everybody can draw: smooth, with edges, unlike in all three colours.
def picture(width, height):
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    red = (x * 255) // max(width - 1, 1)
    green = (y * 255) // max(height - 1, 1)
    blue = ((x // 16 + y // 16) % 2) * 180 + (x * y) % 64
    return np.stack([red, green, blue], axis=-1).astype(np.uint8)


# Pillow's resampling: a kernel as wide as the larger of source and target pixel, weights of each target pixel summing to 1,
# across first, then down, in whole numbers of 8 bits after each.
def weights(size, target, kernel, support):
    scale = size / target
    filterscale = max(scale, 1.0)
    reach = support * filterscale
    matrix = np.zeros((target, size))
    for place in range(target):
        center = (place + 0.5) * scale
        first, last = max(int(center - reach + 0.5), 0), min(int(center + reach + 0.5), size)
        row = np.array([kernel((j - center + 0.5) / filterscale) for j in range(first, last)])
        matrix[place, first:last] = row / row.sum()
    return matrix


def tent(x):
    return max(0.0, 1.0 - abs(x))


def cubic(x, a=-0.5):
    x = abs(x)
    if x < 1.0:
        return ((a + 2.0) * x - (a + 3.0)) * x * x + 1.0
    return (((x - 5.0) * x + 8.0) * x - 4.0) * a if x < 2.0 else 0.0


def resize(image, width, height, kernel, support):
    if image.shape[:2] == (height, width):
        return image
    whole = lambda values: np.clip(np.floor(values + 0.5), 0, 255)
    across = weights(image.shape[1], width, kernel, support)
    down = weights(image.shape[0], height, kernel, support)
    # Pillow leaves out a direction that does not change.
    out = image.astype(float)
    if image.shape[1] != width:
        out = whole(np.einsum("xw,hwc->hxc", across, out))
    if image.shape[0] != height:
        out = whole(np.einsum("yh,hwc->ywc", down, out))
    return out.astype(np.uint8)


def bilinear(image, width, height):
    return resize(image, width, height, tent, 1.0)


def bicubic(image, width, height):
    return resize(image, width, height, cubic, 2.0)


def planes(image, mean, deviation):
    values = (image.astype(np.float32) / 255.0 - np.array(mean, np.float32)) / np.array(deviation, np.float32)
    return values.transpose(2, 0, 1)


IMAGENET = ([0.485, 0.456, 0.406], [0.229, 0.224, 0.225])
HALF = ([0.5] * 3, [0.5] * 3)


def letterbox(image, side):
    height, width = image.shape[:2]
    scale = min(side / width, side / height)
    small = bilinear(image, int(np.floor(width * scale + 0.5)), int(np.floor(height * scale + 0.5)))
    left, top = (side - small.shape[1]) // 2, (side - small.shape[0]) // 2
    square = np.full((side, side, 3), 114, np.uint8)
    square[top : top + small.shape[0], left : left + small.shape[1]] = small
    return square, scale, left, top


def dino(image):
    height, width = image.shape[:2]
    shorter = min(width, height)
    around = bicubic(image, width * 256 // shorter, height * 256 // shorter)
    left, top = (around.shape[1] - 224) // 2, (around.shape[0] - 224) // 2
    return planes(around[top : top + 224, left : left + 224], *IMAGENET)


def siglip(image):
    return planes(bicubic(image, 224, 224), *HALF)


def sam(image, side=1024):
    return planes(bilinear(image, side, side), *IMAGENET)


# Networks.
def constant(name, values):
    return numpy_helper.from_array(np.asarray(values), name)


def save(name, nodes, inputs, outputs, constants):
    value = lambda port: helper.make_tensor_value_info(port[0], port[1], port[2])
    graph = helper.make_graph(nodes, name, [value(p) for p in inputs], [value(p) for p in outputs], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], producer_name="dsm")
    model.ir_version = 8
    onnx.checker.check_model(model)
    onnx.save(model, HERE / f"{name}.onnx")


def node(kind, inputs, outputs, **attributes):
    return helper.make_node(kind, inputs, outputs, **attributes)


def mixing(rows, columns, seed):
    return np.random.default_rng(seed).normal(0, 1, (rows, columns)).astype(np.float32)


CLIP_FREQUENCIES = np.linspace(0.01, 1.3, 512, dtype=np.float32)
SIGLIP_FREQUENCIES = np.linspace(0.01, 1.1, 768, dtype=np.float32)
MIX = {"yolo": mixing(3, 512, 1), "dino": mixing(3, 384, 2), "siglip": mixing(3, 768, 3)}


def text_network(name, output, frequencies, tokens, mask):
    """Sum over the tokens of sin(token * frequency)."""
    nodes = [node("Cast", ["input_ids"], ["f"], to=F32), node("Unsqueeze", ["f", "last"], ["column"])]
    inputs = [("input_ids", I64, ["n", tokens])]
    constants = [constant("last", np.array([2])), constant("frequencies", frequencies[None, None, :]), constant("one", np.array([1]))]
    nodes += [node("Mul", ["column", "frequencies"], ["angle"]), node("Sin", ["angle"], ["waves"])]
    waves = "waves"
    if mask:
        inputs.append(("attention_mask", I64, ["n", tokens]))
        nodes += [
            node("Cast", ["attention_mask"], ["m"], to=F32),
            node("Unsqueeze", ["m", "last"], ["mask"]),
            node("Mul", ["waves", "mask"], ["kept"]),
        ]
        waves = "kept"
    nodes.append(node("ReduceSum", [waves, "one"], [output], keepdims=0))
    save(name, nodes, inputs, [(output, F32, ["n", len(frequencies)])], constants)


def text_feature(ids, frequencies, mask=None):
    waves = np.sin(np.asarray(ids, np.float32)[:, None] * frequencies)
    if mask is not None:
        waves = waves * np.asarray(mask, np.float32)[:, None]
    return waves.sum(axis=0)


def unit(vector):
    return vector / np.linalg.norm(vector)


def pool(image, size):
    channels, height, width = image.shape
    return image.reshape(channels, height // size, size, width // size, size).mean(axis=(2, 4))


def yolo_network(name, names, columns):
    """Mean colours of squares of 8, 16 and 32 pixels, told by their likeness to a text; a square is its own box."""
    nodes, parts = [], []
    for size in (8, 16, 32):
        nodes += [
            node("AveragePool", ["images"], [f"pool{size}"], kernel_shape=[size, size], strides=[size, size]),
            node("Reshape", [f"pool{size}", "flat"], [f"row{size}"]),
        ]
        parts.append(f"row{size}")
    nodes += [
        node("Concat", parts, ["places"], axis=2),
        node("Transpose", ["places"], ["colors"], perm=[0, 2, 1]),
        node("MatMul", ["colors", "mix"], ["features"]),
        node("Transpose", ["text_features"], ["text"], perm=[0, 2, 1]),
        node("MatMul", ["features", "text"], ["likeness"]),
        node("Sigmoid", ["likeness"], ["scores"]),
    ]
    constants = [constant("flat", np.array([1, 3, -1])), constant("mix", MIX["yolo"])]
    # Corners, from the numbers of rows and columns.
    lists = []
    for size in (8, 16, 32):
        count = 640 // size
        line = (np.arange(count, dtype=np.float32) * size)[None, :]
        constants.append(constant(f"x{size}", line.reshape(1, count, 1)))
        constants.append(constant(f"y{size}", line.reshape(count, 1, 1)))
        constants.append(constant(f"grid{size}", np.array([count, count, 1])))
        for axis in ("x", "y"):
            nodes.append(node("Expand", [f"{axis}{size}", f"grid{size}"], [f"{axis}all{size}"]))
        first = node("Concat", [f"xall{size}", f"yall{size}"], [f"first{size}"], axis=2)
        nodes += [first, node("Reshape", [f"first{size}", "pairs"], [f"corner{size}"])]
        constants.append(constant(f"size{size}", np.array(size, np.float32)))
        if columns:
            constants.append(constant(f"half{size}", np.array(size / 2, np.float32)))
            nodes += [
                node("Add", [f"corner{size}", f"half{size}"], [f"start{size}"]),
                node("Mul", [f"corner{size}", "zero"], [f"none{size}"]),
                node("Add", [f"none{size}", f"size{size}"], [f"end{size}"]),
            ]
        else:
            nodes += [
                node("Identity", [f"corner{size}"], [f"start{size}"]),
                node("Add", [f"corner{size}", f"size{size}"], [f"end{size}"]),
            ]
        nodes.append(node("Concat", [f"start{size}", f"end{size}"], [f"box{size}"], axis=2))
        lists.append(f"box{size}")
    constants.append(constant("pairs", np.array([1, -1, 2])))
    if columns:
        constants.append(constant("zero", np.array(0, np.float32)))
    nodes.append(node("Concat", lists, ["boxes"], axis=1))
    inputs = [("images", F32, [1, 3, 640, 640]), ("text_features", F32, [1, names, 512])]
    outputs = [("scores", F32, [1, 8400, names]), ("boxes", F32, [1, 8400, 4])]
    if columns:
        nodes += [
            node("Concat", ["boxes", "scores"], ["rows"], axis=2),
            node("Transpose", ["rows"], ["output0"], perm=[0, 2, 1]),
        ]
        outputs = [("output0", F32, [1, "rows", 8400])]
    save(name, nodes, inputs, outputs, constants)


def yolo(image, texts):
    """Scores and corners of all places."""
    colors, boxes = [], []
    for size in (8, 16, 32):
        colors.append(pool(image, size).reshape(3, -1).T)
        count = 640 // size
        y, x = np.divmod(np.arange(count * count), count)
        start = np.stack([x, y], axis=1).astype(np.float32) * size
        boxes.append(np.concatenate([start, start + size], axis=1))
    likeness = np.concatenate(colors) @ MIX["yolo"] @ texts.T
    return 1.0 / (1.0 + np.exp(-likeness)), np.concatenate(boxes)


def overlap(a, b):
    area = lambda c: max(c[2] - c[0], 0) * max(c[3] - c[1], 0)
    both = area((max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3])))
    return both / (area(a) + area(b) - both)


def keep_best(candidates, most_overlap, most):
    kept = []
    for one in sorted(candidates, key=lambda one: -one[1])[:1000]:
        if len(kept) < most and all(overlap(one[0], surer[0]) <= most_overlap for surer in kept):
            kept.append(one)
    return kept


def find_boxes(image, texts, count, least, most_overlap, most):
    square, scale, left, top = letterbox(image, 640)
    scores, boxes = yolo(planes(square, [0] * 3, [1] * 3), texts)
    height, width = image.shape[:2]
    candidates = []
    for score, box in zip(scores, boxes):
        name = int(np.argmax(score))
        if score[name] < least or name >= count:
            continue
        corners = [
            float(np.clip((box[0] - left) / scale, 0, width)),
            float(np.clip((box[1] - top) / scale, 0, height)),
            float(np.clip((box[2] - left) / scale, 0, width)),
            float(np.clip((box[3] - top) / scale, 0, height)),
        ]
        if corners[2] - corners[0] >= 1 and corners[3] - corners[1] >= 1:
            candidates.append((corners, float(score[name]), name))
    return keep_best(candidates, most_overlap, most)


def sam_networks():
    """Features are mean colours, mixed; a mask is how far inside of the box a place lies, and a little of the colours."""
    nodes, constants = [], []
    for name, size, channels in (("high_res_feats_0", 4, 32), ("high_res_feats_1", 8, 64), ("image_embed", 16, 256)):
        constants.append(constant(f"mix{size}", mixing(channels, 3, size)[:, :, None, None]))
        nodes += [
            node("AveragePool", ["image"], [f"pool{size}"], kernel_shape=[size, size], strides=[size, size]),
            node("Conv", [f"pool{size}", f"mix{size}"], [name], kernel_shape=[1, 1], strides=[1, 1], pads=[0, 0, 0, 0]),
        ]
    outputs = [("high_res_feats_0", F32, [1, 32, 256, 256]), ("high_res_feats_1", F32, [1, 64, 128, 128])]
    outputs.append(("image_embed", F32, [1, 256, 64, 64]))
    save("sam2_encoder", nodes, [("image", F32, [1, 3, 1024, 1024])], outputs, constants)

    line = (np.arange(256, dtype=np.float32) * 4 + 2)
    constants = [
        constant("x", line.reshape(1, 1, 1, 256)),
        constant("y", line.reshape(1, 1, 256, 1)),
        constant("flat", np.array([1, 4, 1, 1])),
        constant("small", np.array(0.02, np.float32)),
        constant("steps", np.array([0.25, 1.0, 0.5], np.float32).reshape(1, 3, 1, 1)),
        constant("expected", np.array([[0.3, 0.9, 0.6]], np.float32)),
        constant("double", np.array([1, 1, 2, 2], np.float32)),
        constant("quadruple", np.array([1, 1, 4, 4], np.float32)),
    ]
    nodes = [
        node("Reshape", ["point_coords", "flat"], ["corners"]),
        node("Split", ["corners"], ["x0", "y0", "x1", "y1"], axis=1),
        node("Sub", ["x", "x0"], ["right_of"]),
        node("Sub", ["x1", "x"], ["left_of"]),
        node("Sub", ["y", "y0"], ["below"]),
        node("Sub", ["y1", "y"], ["above"]),
        node("Min", ["right_of", "left_of", "below", "above"], ["inside"]),
        node("ReduceMean", ["high_res_feats_0"], ["high"], axes=[1]),
        node("ReduceMean", ["high_res_feats_1"], ["middle"], axes=[1]),
        node("ReduceMean", ["image_embed"], ["low"], axes=[1]),
        node("Resize", ["middle", "", "double"], ["middle_large"], mode="nearest", nearest_mode="floor",
             coordinate_transformation_mode="asymmetric"),
        node("Resize", ["low", "", "quadruple"], ["low_large"], mode="nearest", nearest_mode="floor",
             coordinate_transformation_mode="asymmetric"),
        node("Add", ["high", "middle_large"], ["two"]),
        node("Add", ["two", "low_large"], ["looks"]),
        node("Mul", ["mask_input", "has_mask_input"], ["given_mask"]),
        node("Add", ["inside", "looks"], ["one"]),
        node("Add", ["one", "given_mask"], ["masked"]),
        node("Mul", ["masked", "steps"], ["masks"]),
        node("ReduceSum", ["point_labels"], ["labels"], keepdims=0),
        node("Mul", ["labels", "small"], ["bonus"]),
        node("Sub", ["expected", "bonus"], ["iou_predictions"]),
    ]
    inputs = [
        ("image_embed", F32, [1, 256, 64, 64]),
        ("high_res_feats_0", F32, [1, 32, 256, 256]),
        ("high_res_feats_1", F32, [1, 64, 128, 128]),
        ("point_coords", F32, [1, "points", 2]),
        ("point_labels", F32, [1, "points"]),
        ("mask_input", F32, [1, 1, 256, 256]),
        ("has_mask_input", F32, [1]),
    ]
    save("sam2_decoder", nodes, inputs, [("masks", F32, [1, 3, 256, 256]), ("iou_predictions", F32, [1, 3])], constants)


def sam_masks(image, corners):
    """Logits of three masks and what is expected of them."""
    height, width = image.shape[:2]
    scale = np.array([1024 / width, 1024 / height, 1024 / width, 1024 / height], np.float32)
    x0, y0, x1, y1 = np.array(corners, np.float32) * scale
    line = np.arange(256, dtype=np.float32) * 4 + 2
    x, y = line[None, :], line[:, None]
    inside = np.minimum(np.minimum(x - x0, x1 - x), np.minimum(y - y0, y1 - y))
    seen = sam(image)
    looks = np.zeros((256, 256), np.float32)
    for size, channels in ((4, 32), (8, 64), (16, 256)):
        mean = np.tensordot(mixing(channels, 3, size).mean(axis=0), pool(seen, size), axes=1)
        looks += np.kron(mean, np.ones((size // 4, size // 4), np.float32))
    masks = (inside + looks)[None] * np.array([0.25, 1.0, 0.5], np.float32)[:, None, None]
    return masks, np.array([0.3, 0.9, 0.6]) - 0.02 * 5.0


def enlarge(logits, width, height):
    def between(length, small):
        at = np.clip((np.arange(length) + 0.5) * small / length - 0.5, 0, small - 1)
        first = np.floor(at).astype(int)
        return first, np.minimum(first + 1, small - 1), (at - first).astype(np.float32)

    left, right, along = between(width, logits.shape[1])
    above, below, down = between(height, logits.shape[0])
    line = lambda rows: logits[rows][:, left] * (1 - along) + logits[rows][:, right] * along
    return line(above) * (1 - down)[:, None] + line(below) * down[:, None]


def dino_network():
    nodes = [
        node("AveragePool", ["pixel_values"], ["pool"], kernel_shape=[14, 14], strides=[14, 14]),
        node("Reshape", ["pool", "flat"], ["row"]),
        node("Transpose", ["row"], ["patches"], perm=[0, 2, 1]),
        node("MatMul", ["patches", "mix"], ["features"]),
        node("Abs", ["features"], ["sizes"]),
        node("ReduceMean", ["sizes"], ["mean"], axes=[1]),
        node("Concat", ["mean", "features"], ["last_hidden_state"], axis=1),
    ]
    constants = [constant("flat", np.array([0, 3, -1])), constant("mix", MIX["dino"])]
    inputs = [("pixel_values", F32, ["batch", 3, "height", "width"])]
    save("dinov2", nodes, inputs, [("last_hidden_state", F32, ["batch", 257, 384])], constants)


def siglip_networks():
    nodes = [
        node("AveragePool", ["pixel_values"], ["pool"], kernel_shape=[16, 16], strides=[16, 16]),
        node("Reshape", ["pool", "flat"], ["row"]),
        node("Transpose", ["row"], ["patches"], perm=[0, 2, 1]),
        node("MatMul", ["patches", "mix"], ["last_hidden_state"]),
        node("Abs", ["last_hidden_state"], ["sizes"]),
        node("ReduceMean", ["sizes"], ["pooler_output"], axes=[1], keepdims=0),
    ]
    constants = [constant("flat", np.array([0, 3, -1])), constant("mix", MIX["siglip"])]
    outputs = [("last_hidden_state", F32, ["batch", 196, 768]), ("pooler_output", F32, ["batch", 768])]
    save("siglip_image", nodes, [("pixel_values", F32, ["batch", 3, 224, 224])], outputs, constants)
    text_network("siglip_text", "pooler_output", SIGLIP_FREQUENCIES, 64, mask=False)


def minilm_network():
    """Each word by itself: its number, and where the sentence is not filled up."""
    nodes = [
        node("Cast", ["input_ids"], ["f"], to=F32),
        node("Cast", ["attention_mask"], ["m"], to=F32),
        node("Cast", ["token_type_ids"], ["t"], to=F32),
        node("Mul", ["f", "m"], ["kept"]),
        node("Add", ["kept", "t"], ["sum"]),
        node("Unsqueeze", ["sum", "last"], ["column"]),
        node("Mul", ["column", "frequencies"], ["angle"]),
        node("Sin", ["angle"], ["last_hidden_state"]),
    ]
    frequencies = np.linspace(0.01, 1.2, 384, dtype=np.float32)
    constants = [constant("last", np.array([2])), constant("frequencies", frequencies[None, None, :])]
    inputs = [(name, I64, ["batch", "words"]) for name in ("input_ids", "attention_mask", "token_type_ids")]
    save("minilm", nodes, inputs, [("last_hidden_state", F32, ["batch", "words", 384])], constants)
    return frequencies


# Tokenizers of few words: each word has one number.
WORDS = ["apple", "mug", "red", "blue", "table", "this", "is", "a", "photo", "of", "white", "shelf"]


def tokenizer(name, first, last, start):
    vocabulary = {"[UNK]": 0}
    for word in ([first] if first else []) + [last]:
        vocabulary[word] = len(vocabulary)
    for word in WORDS:
        vocabulary[word] = len(vocabulary) + start
    special = [w for w in ["[UNK]", first, last] if w]
    piece = lambda word: {"SpecialToken": {"id": word, "type_id": 0}}
    single = ([piece(first)] if first else []) + [{"Sequence": {"id": "A", "type_id": 0}}, piece(last)]
    ids = {w: {"id": w, "ids": [vocabulary[w]], "tokens": [w]} for w in special if w != "[UNK]"}
    added = [
        {"id": vocabulary[w], "content": w, "single_word": False, "lstrip": False, "rstrip": False, "normalized": False, "special": True}
        for w in special
    ]
    document = {
        "version": "1.0",
        "truncation": None,
        "padding": None,
        "added_tokens": added,
        "normalizer": {"type": "Lowercase"},
        "pre_tokenizer": {"type": "Whitespace"},
        "post_processor": {"type": "TemplateProcessing", "single": single, "pair": single, "special_tokens": ids},
        "decoder": None,
        "model": {"type": "WordLevel", "vocab": vocabulary, "unk_token": "[UNK]"},
    }
    (HERE / f"{name}.tokenizer.json").write_text(json.dumps(document, indent=1) + "\n")
    return vocabulary


def tokens(vocabulary, first, last, text):
    ids = [vocabulary.get(word, 0) for word in text.lower().split()]
    return ([vocabulary[first]] if first else []) + ids + [vocabulary[last]]


def padded(ids, length, filler):
    return ids[:length] + [filler] * (length - len(ids))


def sampled(values, count=64):
    """Every n-th value of a large list."""
    flat = np.asarray(values).reshape(-1)
    places = np.linspace(0, flat.size - 1, min(count, flat.size)).astype(int)
    return {"length": int(flat.size), "places": places.tolist(), "values": [round(float(v), 6) for v in flat[places]]}


def runs(mask):
    flat = np.concatenate([[False], mask.reshape(-1), [False]]).astype(np.int8)
    edges = np.flatnonzero(np.diff(flat))
    return int(mask.sum()), edges[:8].tolist()


def main():
    golden = {}
    sizes = [(640, 480), (320, 200), (97, 143)]
    golden["prepared"] = []
    for width, height in sizes:
        image = picture(width, height)
        square, scale, left, top = letterbox(image, 640)
        golden["prepared"].append({
            "size": [width, height],
            "letterbox": {"scale": scale, "left": left, "top": top, "pixels": sampled(square, 100)},
            "sam2": sampled(sam(image), 100),
            "dinov2": sampled(dino(image), 100),
            "siglip": sampled(siglip(image), 100),
        })

    clip = tokenizer("clip", "<|startoftext|>", "<|endoftext|>", 100)
    line = tokenizer("siglip", None, "</s>", 10)
    bert = tokenizer("minilm", "[CLS]", "[SEP]", 50)
    text_network("clip_text", "text_embeds", CLIP_FREQUENCIES, 77, mask=True)
    yolo_network("yolo_world", "names", columns=False)
    yolo_network("yolo_world_columns", 4, columns=True)
    sam_networks()
    dino_network()
    siglip_networks()
    frequencies = minilm_network()

    def clip_feature(text):
        ids = tokens(clip, "<|startoftext|>", "<|endoftext|>", text)
        mask = padded([1] * len(ids), 77, 0)
        return unit(text_feature(padded(ids, 77, clip["<|endoftext|>"]), CLIP_FREQUENCIES, mask))

    def siglip_feature(text):
        return unit(text_feature(padded(tokens(line, None, "</s>", text), 64, 1), SIGLIP_FREQUENCIES))

    def minilm_feature(text):
        ids = tokens(bert, "[CLS]", "[SEP]", text)
        return unit(np.sin(np.array(ids, np.float32)[:, None] * frequencies).mean(axis=0))

    golden["clip"] = [{"text": t, "feature": sampled(clip_feature(t))} for t in ("red apple", "mug", " ")]
    golden["siglip_text"] = [
        {"text": t, "canonical": c, "feature": sampled(siglip_feature(c))}
        for t, c in (("Red  APPLE!", "red apple"), ("This is a photo of white shelf.", "this is a photo of white shelf"))
    ]
    golden["minilm"] = [{"text": t, "feature": sampled(minilm_feature(t))} for t in ("red apple on a table", "mug")]

    image = picture(320, 200)
    seen = dino(image)
    patches = np.abs(pool(seen, 14).reshape(3, -1).T @ MIX["dino"])
    golden["dinov2"] = sampled(unit(patches.mean(axis=0)))
    patches = np.abs(pool(siglip(image), 16).reshape(3, -1).T @ MIX["siglip"])
    golden["siglip_image"] = sampled(unit(patches.mean(axis=0)))

    names = ["red apple", "mug", "white shelf", "blue table", "red mug"]
    texts = np.stack([clip_feature(name) for name in names])
    filler = np.stack([clip_feature(name) for name in names[:4]]), np.stack([clip_feature(n) for n in names[4:] + [" "] * 3])
    golden["boxes"] = []
    for width, height in sizes:
        image = picture(width, height)
        found = find_boxes(image, texts, 5, 0.55, 0.2, 12)
        # The other way of exporting has four places: five names need two runs, and of each the likeliest counts.
        both = []
        for part, chunk in enumerate(filler):
            many = find_boxes(image, chunk, [4, 1][part], 0.55, 1.0, 100000)
            both += [(c, s, n + 4 * part) for c, s, n in many]
        golden["boxes"].append({
            "size": [width, height],
            "together": [{"corners": c, "score": round(s, 6), "name": n} for c, s, n in found],
            "in_parts": [{"corners": c, "score": round(s, 6), "name": n} for c, s, n in keep_best(both, 0.2, 12)],
        })

    golden["masks"] = []
    for width, height in sizes:
        image = picture(width, height)
        for corners in ([0.2 * width, 0.3 * height, 0.7 * width, 0.8 * height], [0, 0, width / 3, height / 4]):
            masks, expected = sam_masks(image, corners)
            best = int(np.argmax(expected))
            area, first = runs(enlarge(masks[best], width, height) > 0)
            golden["masks"].append({
                "size": [width, height],
                "corners": [round(float(c), 4) for c in corners],
                "expected": round(float(expected[best]), 6),
                "area": area,
                "edges": first,
            })

    lines = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in golden.items()]
    (HERE / "golden.json").write_text("{\n" + ",\n".join(lines) + "\n}\n")
    if "--check" in sys.argv:
        check(names, texts)


def check(names, texts):
    import onnxruntime
    from PIL import Image

    def run(name, inputs):
        session = onnxruntime.InferenceSession(str(HERE / f"{name}.onnx"), providers=["CPUExecutionProvider"])
        return session.run(None, inputs)

    for width, height in [(640, 480), (320, 200), (97, 143)]:
        image = picture(width, height)
        for target in [(224, 224), (1024, 1024), (256, 200)]:
            for ours, theirs in ((bilinear, Image.BILINEAR), (bicubic, Image.BICUBIC)):
                pillow = np.asarray(Image.fromarray(image).resize(target, theirs)).astype(int)
                assert np.abs(ours(image, *target).astype(int) - pillow).max() <= 1, (width, height, target)
        square = planes(letterbox(image, 640)[0], [0] * 3, [1] * 3).astype(np.float32)
        scores, boxes = run("yolo_world", {"images": square[None], "text_features": texts[None].astype(np.float32)})
        ours = yolo(square, texts)
        assert np.abs(scores[0] - ours[0]).max() < 1e-4 and np.abs(boxes[0] - ours[1]).max() == 0
        (rows,) = run("yolo_world_columns", {"images": square[None], "text_features": texts[None, :4].astype(np.float32)})
        assert np.abs(rows[0, 4:].T - ours[0][:, :4]).max() < 1e-4
        assert np.abs(rows[0, 2:4] - (ours[1][:, 2:] - ours[1][:, :2]).T).max() == 0
        features = dict(zip(["high_res_feats_0", "high_res_feats_1", "image_embed"], run("sam2_encoder", {"image": sam(image)[None].astype(np.float32)})))
        corners = [0.2 * width, 0.3 * height, 0.7 * width, 0.8 * height]
        scale = np.array([1024 / width, 1024 / height] * 2, np.float32)
        prompt = (np.array(corners, np.float32) * scale).reshape(1, 2, 2)
        given = features | {
            "point_coords": prompt,
            "point_labels": np.array([[2, 3]], np.float32),
            "mask_input": np.zeros((1, 1, 256, 256), np.float32),
            "has_mask_input": np.zeros(1, np.float32),
        }
        masks, expected = run("sam2_decoder", given)
        ours = sam_masks(image, corners)
        assert np.abs(masks[0] - ours[0]).max() < 1e-2 and np.abs(expected[0] - ours[1]).max() < 1e-5
    print("the formulas are those of the networks, the resizing is Pillow's")


if __name__ == "__main__":
    main()

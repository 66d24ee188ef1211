"""Makes minilm_reference.json, the features of some sentences by all-MiniLM-L6-v2 (int8) in Python:

    python3 minilm_reference.py MODEL.onnx TOKENIZER.json

with numpy, onnxruntime and tokenizers. tests/minilm.rs says where both files come from.
"""

import json
import pathlib
import sys

import numpy as np
import onnxruntime
from tokenizers import Tokenizer

SENTENCES = [
    "mug",
    "cup",
    "wardrobe",
    "computer desk",
    "a white shelf with a white cabinet",
    "The red apple on the kitchen table, left of the bottle.",
    "remote control",
    "Sitzbank im Flur",
    "ÉCLAIR & café-au-lait, 2 of them!",
    "something to drink from",
    "pneumonoultramicroscopicsilicovolcanoconiosis",
    "chair " * 300,
]


def main(model, tokenizer):
    words = Tokenizer.from_file(tokenizer)
    words.no_padding()
    words.enable_truncation(max_length=256)
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    lines = []
    for sentence in SENTENCES:
        ids = np.array([words.encode(sentence).ids], np.int64)
        given = {"input_ids": ids, "attention_mask": np.ones_like(ids), "token_type_ids": np.zeros_like(ids)}
        given = {port.name: given[port.name] for port in session.get_inputs()}
        mean = session.run(None, given)[0][0].mean(axis=0)
        feature = mean / np.linalg.norm(mean)
        lines.append(json.dumps({"text": sentence, "feature": [round(float(value), 5) for value in feature]}))
    target = pathlib.Path(__file__).parent / "minilm_reference.json"
    target.write_text("[\n" + ",\n".join(lines) + "\n]\n")


if __name__ == "__main__":
    main(*sys.argv[1:])

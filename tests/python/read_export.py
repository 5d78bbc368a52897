#!/usr/bin/env python3
"""Runs exported networks with onnxruntime, step by step as a robot's program would.

Each FOLDER holds samples.json, a list of samples with null for what is missing and "inf" or "-inf" for what is infinite, and
models, *.onnx. Each model is checked by onnx's own checker, shapes included, and run over the samples. What it predicts is
written beside it, as NAME.json: {"mean": [...], "variance": [...] or null, "note": what the metadata say}.

Exit code 0: all models were run. 1: the checker or the runtime refused one, or it is not as its metadata say.
"""

import json
import sys
from pathlib import Path

import numpy as np
import onnx
import onnxruntime


def run(path, samples):
    model = onnx.load(path)
    onnx.checker.check_model(model, full_check=True)
    # A warning of the runtime is a fault of the file.
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    note = json.loads(session.get_modelmeta().custom_metadata_map["scrnn"])

    dtype = np.dtype(note["precision"])
    state = np.array(note["start"], dtype)
    if sum(np.prod(part["shape"]) for part in note["state"]) != state.size:
        sys.exit(f"{path}: the parts of the state do not fill it")
    for value in session.get_inputs() + session.get_outputs():
        if value.type != {"float64": "tensor(double)", "float32": "tensor(float)"}[note["precision"]]:
            sys.exit(f"{path}: {value.name} is {value.type}")
    has_variance = [value.name for value in session.get_outputs()] == ["mean", "variance", "state_after"]

    means, variances = [], []
    for sample in samples.astype(dtype):
        before = state.copy()
        out = session.run(None, {"sample": sample, "state": state})
        if not np.array_equal(before, state):
            sys.exit(f"{path}: the state that went in was changed")
        state = out[-1]
        means.append(out[0])
        if has_variance:
            variances.append(out[1])
    flat = lambda rows: np.concatenate(rows).astype(float).tolist()
    return {"mean": flat(means), "variance": flat(variances) if has_variance else None, "note": note}


def main(folders):
    print(f"onnx {onnx.__version__}, onnxruntime {onnxruntime.__version__}")
    for folder in map(Path, folders):
        samples = json.loads((folder / "samples.json").read_text())
        samples = np.array([[np.nan if x is None else float(x) for x in sample] for sample in samples])
        for path in sorted(folder.glob("*.onnx")):
            path.with_suffix(".json").write_text(json.dumps(run(str(path), samples)))


if __name__ == "__main__":
    main(sys.argv[1:])

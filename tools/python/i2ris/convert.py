"""Conversion of networks from PyTorch and ONNX to the file for ``i2ris calibrate fit --network FILE``.

Supported: dense layers, GRU, LSTM and causal convolution, with tanh, relu, sigmoid and softplus, in sequence. Everything
else is refused by name. Nothing of PyTorch or ONNX runs in the controller.

A network maps scaled counts to scaled angles, one step per ``step_counts`` of travel (:func:`i2ris.model.steps_by_travel`)::

    x = (counts - input_centre) * input_scale;   angles_deg = output_scale * y + output_centre

and, if the network has learned the residual of a straight line, plus ``skip_gain @ (counts - input_centre)``.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from i2ris_native import ModelError

#: Maximum size of a file, bytes.
MAX_FILE_BYTES = 64 << 20

_KINDS = "dense, GRU, LSTM, causal convolution; tanh, relu, sigmoid, softplus"


def _array(name: str, value: Any) -> np.ndarray:
    array = np.asarray(value)
    if array.dtype not in (np.float32, np.float64):
        raise ModelError(f"{name}: is {array.dtype}, and only float32 and float64 are read: train or convert it in float32")
    if not np.isfinite(array).all():
        raise ModelError(f"{name}: has a number that is not finite")
    return array.astype(np.float64)


def _dense(name: str, weight: Any, bias: Any) -> dict[str, Any]:
    rows = _array(f"{name}.weight", weight)
    return {
        "kind": "dense",
        "weight": rows.tolist(),
        "bias": (np.zeros(len(rows)) if bias is None else _array(f"{name}.bias", bias)).tolist(),
        "activation": "none",
    }


def _conv(name: str, weight: Any, bias: Any, dilation: int) -> dict[str, Any]:
    taps = np.moveaxis(_array(f"{name}.weight", weight), 2, 0)
    return {
        "kind": "conv",
        "taps": taps.tolist(),
        "bias": (np.zeros(taps.shape[1]) if bias is None else _array(f"{name}.bias", bias)).tolist(),
        "dilation": int(dilation),
        "activation": "none",
    }


def _recurrent(kind: str, name: str, w: Any, r: Any, wb: Any, rb: Any) -> dict[str, Any]:
    return {
        "kind": kind,
        "input_weight": _array(f"{name}.weight_ih", w).tolist(),
        "recurrent_weight": _array(f"{name}.weight_hh", r).tolist(),
        "input_bias": _array(f"{name}.bias_ih", wb).tolist(),
        "recurrent_bias": _array(f"{name}.bias_hh", rb).tolist(),
    }


def _activate(layers: list[dict[str, Any]], name: str, activation: str) -> None:
    """The activation belongs to the previous layer; after a recurrent one it becomes a separate layer."""
    if not layers:
        raise ModelError(f"{name}: an activation of the inputs is not known; begin with one of {_KINDS}")
    last = layers[-1]
    if last.get("activation") != "none":
        size = len(last["bias"]) if "bias" in last else len(last["recurrent_weight"][0])
        layers.append(_dense(name, np.eye(size), None))
        last = layers[-1]
    last["activation"] = activation


def _file(
    layers: list[dict[str, Any]],
    *,
    step_counts: float,
    input_centre: Sequence[float],
    input_scale: Sequence[float] | None,
    output_scale: Sequence[float] | None,
    output_centre: Sequence[float],
    skip_gain: Sequence[Sequence[float]] | None,
    outputs: Sequence[str],
    unit: str,
    path: str | Path | None,
) -> dict[str, Any]:
    network: dict[str, Any] = {
        "step_counts": float(step_counts),
        "input_centre": [float(x) for x in input_centre],
        "input_scale": [float(x) for x in input_scale or [1e-3] * len(input_centre)],
        "layers": layers,
        "output_gain": np.diag([float(x) for x in output_scale or [1.0] * len(output_centre)]).tolist(),
        "output_offset": [float(x) for x in output_centre],
    }
    if skip_gain is not None:
        network["skip_gain"] = [[float(x) for x in row] for row in skip_gain]
    file: dict[str, Any] = {
        "format": "i2ris-network",
        "version": 1,
        "inputs": [f"q{motor}_counts" for motor in range(len(input_centre))],
        "outputs": [{"name": name, "unit": unit} for name in outputs],
        "network": network,
    }
    if path is not None:
        Path(path).write_text(json.dumps(file))
    return file


def from_torch(
    module: Any,
    *,
    step_counts: float,
    input_centre: Sequence[float] = (0.0, 0.0),
    input_scale: Sequence[float] | None = None,
    output_scale: Sequence[float] | None = None,
    output_centre: Sequence[float] = (0.0, 0.0),
    skip_gain: Sequence[Sequence[float]] | None = None,
    outputs: Sequence[str] = ("pitch", "yaw"),
    unit: str = "deg",
    path: str | Path | None = None,
) -> dict[str, Any]:
    """The network of a ``torch.nn`` module, or of a sequence; writes it to ``path`` if one is given.

    Scales that are not given are 0.001 per count and 1 deg.

    Known modules: ``Sequential`` and lists of ``Linear``, ``GRU``, ``LSTM``, ``Conv1d`` (causal: pad on the left only,
    ``ConstantPad1d((k, 0), 0)`` before it), ``Tanh``, ``ReLU``, ``Sigmoid``, ``Softplus``, ``Identity``.
    """
    from torch import nn

    layers: list[dict[str, Any]] = []
    activations = {nn.Tanh: "tanh", nn.ReLU: "relu", nn.Sigmoid: "sigmoid", nn.Softplus: "softplus"}
    pad = 0

    def numbers(tensor: Any) -> Any:
        return None if tensor is None else tensor.detach().cpu().numpy()

    def add(name: str, part: Any) -> None:
        nonlocal pad
        if isinstance(part, nn.Sequential | nn.ModuleList) or (not isinstance(part, nn.Module) and isinstance(part, Iterable)):
            for index, inner in enumerate(part):
                add(f"{name}[{index}]", inner)
        elif isinstance(part, nn.Identity) or (isinstance(part, nn.Dropout) and not part.training):
            pass
        elif isinstance(part, nn.Linear):
            layers.append(_dense(name, numbers(part.weight), numbers(part.bias)))
        elif isinstance(part, nn.GRU | nn.LSTM):
            kind = type(part).__name__
            if part.bidirectional or not part.bias or part.proj_size:
                raise ModelError(f"{name}: a {kind} that is bidirectional, projected or without bias is not known")
            for layer in range(part.num_layers):
                names = (f"weight_ih_l{layer}", f"weight_hh_l{layer}", f"bias_ih_l{layer}", f"bias_hh_l{layer}")
                layers.append(_recurrent(kind.lower(), name, *(numbers(getattr(part, n)) for n in names)))
        elif isinstance(part, nn.ConstantPad1d):
            if part.padding[1] != 0 or part.value != 0:
                raise ModelError(f"{name}: pads {part.padding} with {part.value}; a causal convolution pads zeros on the left")
            pad = part.padding[0]
        elif isinstance(part, nn.Conv1d):
            needed = (part.kernel_size[0] - 1) * part.dilation[0]
            if part.stride != (1,) or part.groups != 1 or part.padding != (0,) or pad != needed:
                raise ModelError(f"{name}: not a causal convolution: stride 1, one group, and {needed} zeros on the left")
            pad = 0
            layers.append(_conv(name, numbers(part.weight), numbers(part.bias), part.dilation[0]))
        elif type(part) in activations:
            if isinstance(part, nn.Softplus) and part.beta != 1:
                raise ModelError(f"{name}: Softplus with beta = {part.beta} is not known")
            _activate(layers, name, activations[type(part)])
        else:
            raise ModelError(f"{name}: {type(part).__name__} is not known; there are {_KINDS}")

    add("module", module)
    return _file(
        layers, step_counts=step_counts, input_centre=input_centre, input_scale=input_scale, output_scale=output_scale,
        output_centre=output_centre, skip_gain=skip_gain, outputs=outputs, unit=unit, path=path,
    )  # fmt: skip


def from_onnx(
    file: str | Path,
    *,
    step_counts: float,
    input_centre: Sequence[float] = (0.0, 0.0),
    input_scale: Sequence[float] | None = None,
    output_scale: Sequence[float] | None = None,
    output_centre: Sequence[float] = (0.0, 0.0),
    skip_gain: Sequence[Sequence[float]] | None = None,
    outputs: Sequence[str] = ("pitch", "yaw"),
    unit: str = "deg",
    path: str | Path | None = None,
) -> dict[str, Any]:
    """The network of an ONNX file whose nodes follow one after the other: Gemm, MatMul and Add, GRU, LSTM, Conv with Pad,
    Tanh, Relu, Sigmoid, Softplus, and nodes that only reorder axes (Transpose, Squeeze, Unsqueeze, Reshape, Identity)."""
    import onnx
    from onnx import numpy_helper
    from onnx.reference import ReferenceEvaluator

    size = Path(file).stat().st_size
    if size > MAX_FILE_BYTES:
        raise ModelError(f"{file}: has {size >> 20} MB; at most {MAX_FILE_BYTES >> 20} MB are read")
    graph = onnx.load(str(file)).graph
    known = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    layers: list[dict[str, Any]] = []
    activations = {"Tanh": "tanh", "Relu": "relu", "Sigmoid": "sigmoid", "Softplus": "softplus"}
    pad = 0
    for node in graph.node:
        name = node.name or node.op_type
        options = {option.name: onnx.helper.get_attribute_value(option) for option in node.attribute}
        weights = [known[i] for i in node.input if i in known]
        if node.op_type == "Constant":
            known[node.output[0]] = numpy_helper.to_array(options["value"])
        elif node.op_type in ("Transpose", "Squeeze", "Unsqueeze", "Reshape", "Identity", "Shape", "Gather", "Slice", "Concat", "Cast", "Expand", "ConstantOfShape"):
            # Constants, such as the width of a padding.
            if all(name in known for name in node.input if name):
                values: list[Any] = list(ReferenceEvaluator(node).run(None, {name: known[name] for name in node.input if name}))
                known.update(zip(node.output, values, strict=True))
        elif node.op_type == "Gemm":
            weight = weights[0] if options.get("transB", 0) else weights[0].T
            layers.append(_dense(name, weight, weights[1] if len(weights) > 1 else None))
        elif node.op_type == "MatMul":
            layers.append(_dense(name, weights[0].T, None))
        elif node.op_type == "Add" and layers and layers[-1]["kind"] == "dense" and weights:
            layers[-1]["bias"] = (np.array(layers[-1]["bias"]) + _array(name, weights[0])).tolist()
        elif node.op_type in ("GRU", "LSTM"):
            layers.append(_onnx_recurrent(node, name, options, known))
        elif node.op_type == "Pad":
            pads = known.get(node.input[1]) if len(node.input) > 1 else None
            if pads is None or len(pads) != 6 or pads[5] != 0:
                raise ModelError(f"{name}: a causal convolution pads zeros on the left only")
            pad = int(pads[2])
        elif node.op_type == "Conv":
            kernel, dilation = weights[0].shape[-1], options.get("dilations", [1])[0]
            left, right = options.get("pads", [0, 0])
            if pad + left != (kernel - 1) * dilation or right or options.get("group", 1) != 1:
                raise ModelError(f"{name}: not a causal convolution: it needs one group, and zeros padded on the left only")
            pad = 0
            layers.append(_conv(name, weights[0], weights[1] if len(weights) > 1 else None, dilation))
        elif node.op_type in activations:
            _activate(layers, name, activations[node.op_type])
        else:
            raise ModelError(f"{name}: {node.op_type} is not known; there are {_KINDS}")
    return _file(
        layers, step_counts=step_counts, input_centre=input_centre, input_scale=input_scale, output_scale=output_scale,
        output_centre=output_centre, skip_gain=skip_gain, outputs=outputs, unit=unit, path=path,
    )  # fmt: skip


def _onnx_recurrent(node: Any, name: str, options: dict[str, Any], known: dict[str, np.ndarray]) -> dict[str, Any]:
    kind = node.op_type
    usual = {"GRU": [b"Sigmoid", b"Tanh"], "LSTM": [b"Sigmoid", b"Tanh", b"Tanh"]}[kind]
    w, r, b = (known[i][0] for i in node.input[1:4])
    size = r.shape[1]
    if options.get("direction", b"forward") != b"forward" or options.get("activations", usual) != usual:
        raise ModelError(f"{name}: a {kind} with other directions or activations is not known")
    if kind == "GRU" and not options.get("linear_before_reset", 0):
        raise ModelError(f"{name}: a GRU with linear_before_reset = 0 is not known; PyTorch has 1")
    # Order in ONNX: update, reset, new and input, output, forget, cell.
    order = {"GRU": [1, 0, 2], "LSTM": [0, 2, 3, 1]}[kind]

    def gates(rows: np.ndarray) -> np.ndarray:
        return np.concatenate([rows[gate * size : (gate + 1) * size] for gate in order])

    half = len(b) // 2
    return _recurrent(kind.lower(), name, gates(w), gates(r), gates(b[:half]), gates(b[half:]))

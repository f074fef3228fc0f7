"""A baseline of the benchmark: the Prandtl-Ishlinskii operator of the textbooks, fitted by least squares.

Each motor has a sum of plays with weights that are not negative (K. Kuhnen, 2003), and the angles are a straight line of
the two sums::

    v_m = sum_j w_mj play_rj(q_m),      angles = G v + c

The model is a ``gmr-play`` of one component without a residual, so that the controller runs it like any other.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from i2ris.benchmark import Floats, Recording
from i2ris.model import Calibration, Model

#: Half-widths of the plays, counts.
THRESHOLDS = np.array([0.0, 10, 20, 30, 40, 55, 70, 90, 115, 145, 185, 240, 320])
_ROUNDS = 30


def plays(counts: Floats) -> Floats:
    """The plays of every motor along a path that begins without tension: rows, motors, thresholds."""
    states = np.repeat(counts[0][:, None], len(THRESHOLDS), axis=1)
    found = np.empty((len(counts), *states.shape))
    for row, position in enumerate(counts):
        states = np.clip(states, position[:, None] - THRESHOLDS, position[:, None] + THRESHOLDS)
        found[row] = states
    return found


def _not_negative(squares: Floats, products: Floats, start: Floats) -> Floats:
    """The least squares of weights that are not negative, one weight after the other."""
    weights = start.copy()
    for _ in range(500):
        for k in range(len(weights)):
            weights[k] = max(0.0, weights[k] + (products[k] - squares[k] @ weights) / squares[k, k])
    return weights


def _metrics(errors: Floats, truth: Floats) -> list[dict[str, Any]]:
    squares, spread = (errors**2).mean(axis=0), np.ptp(truth, axis=0)
    fits = zip(1 - squares / truth.var(axis=0), np.sqrt(squares), spread, np.abs(errors).T, strict=True)
    return [
        {"training": {"r2": r2, "rmsd": rmsd, "nrmsd": rmsd / width, "mae": size.mean(), "max": size.max()}}
        for r2, rmsd, width, size in fits
    ]


def fit(path: Path, robot_id: str) -> Model:
    """Fits the operator to a recording."""
    file = Calibration("linear", robot_id=robot_id).fit(path).model_.to_dict()
    recording = Recording.read(path)
    seen = np.isfinite(recording.angles_deg).all(axis=1)
    table, angles = plays(recording.counts)[seen], recording.angles_deg[seen]
    weights = np.ones((2, len(THRESHOLDS))) / len(THRESHOLDS)
    for _ in range(_ROUNDS):
        sums = np.einsum("rmj,mj->rm", table, weights)
        inputs = np.column_stack([sums, np.ones(len(sums))])
        solution = np.linalg.lstsq(inputs, angles, rcond=None)[0]
        gain, offset = solution[:2].T, solution[2]
        # All weights at once, with the present gain.
        columns = (table[:, None] * gain[None, :, :, None]).reshape(2 * len(table), -1)
        wanted = (angles - offset).reshape(-1)
        found = _not_negative(columns.T @ columns, columns.T @ wanted, weights.reshape(-1)).reshape(weights.shape)
        # A strictly increasing sum has an inverse.
        found[:, 0] = np.maximum(found[:, 0], 0.01 * found.sum(axis=1))
        weights = found / found.sum(axis=1, keepdims=True)
    sums = np.einsum("rmj,mj->rm", table, weights)
    errors = angles - sums @ gain.T - offset
    centre, spread = sums.mean(axis=0), np.cov(sums.T)
    below = np.column_stack([gain @ spread, gain @ spread @ gain.T + np.cov(errors.T)])
    turns = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    directions = np.column_stack([np.cos(turns), np.sin(turns)])
    corners = sums[np.unique((sums @ directions.T).argmax(axis=0))]
    order = np.argsort(np.arctan2(*(corners - centre).T[::-1]))
    file["family"] = {
        "kind": "gmr-play",
        "plays": {"thresholds_counts": [THRESHOLDS.tolist()] * 2, "weights": weights.tolist(), "planar_thresholds_counts": []},
        "mixture": {
            "weights": [1.0],
            "means": [[*centre, *(gain @ centre + offset)]],
            "covariances": [np.vstack([np.column_stack([spread, spread @ gain.T]), below]).tolist()],
        },
        "virtual_hull": {"corners": corners[order].tolist()},
    }
    file["metrics"] = _metrics(errors, angles)
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "model.json")
        target.write_text(json.dumps(file))
        return Model.load(target)

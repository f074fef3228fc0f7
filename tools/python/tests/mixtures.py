"""Writes mixtures.json: scikit-learn's mixtures of the tables that the test `mixtures` of the benchmarks writes.

    mkdir /tmp/tables
    I2RIS_MIXTURE_TABLES=/tmp/tables cargo test --locked --workspace --test mixtures
    python tools/python/tests/mixtures.py /tmp/tables

Full covariances, the best of 20 starts, standardised columns; scikit-learn 1.9.1, numpy 2.4.6.
Of every table and number of components: the mean log-likelihood per row used for training, nats,
and the RMS length of the regression error on the held-out rows.
"""

import json
import sys
from pathlib import Path

import numpy as np
from sklearn.mixture import GaussianMixture

COMPONENTS = (1, 2, 3, 5, 8, 12, 20)


def regression(mixture, counts, inputs):
    """The conditional mean of the outputs, standardised."""
    logs, means = [], []
    for weight, mean, covariance in zip(mixture.weights_, mixture.means_, mixture.covariances_):
        inner, away = covariance[:counts, :counts], inputs - mean[:counts]
        solved = np.linalg.solve(inner, away.T).T
        logs.append(np.log(weight) - 0.5 * ((away * solved).sum(axis=1) + np.linalg.slogdet(inner)[1]))
        means.append(mean[counts:] + solved @ covariance[:counts, counts:])
    shares = np.exp(logs - np.max(logs, axis=0))
    return np.einsum("kr,kro->ro", shares / shares.sum(axis=0), np.array(means))


def figures(path):
    counts, *lines = path.read_text().split("\n")
    counts, rows = int(counts), np.array([[float(cell) for cell in line.split(",")] for line in lines])
    held_out = np.isin(10 * np.arange(len(rows)) // len(rows), (1, 6))
    centre, deviation = rows[~held_out].mean(axis=0), rows[~held_out].std(axis=0)
    training, test = ((part - centre) / deviation for part in (rows[~held_out], rows[held_out]))
    found = {}
    for components in COMPONENTS:
        mixture = GaussianMixture(components, n_init=20, random_state=1, max_iter=500).fit(training)
        error = (regression(mixture, counts, test[:, :counts]) - test[:, counts:]) * deviation[counts:]
        likelihood = mixture.score(training) - np.log(deviation).sum()
        found[components] = round(float(likelihood), 4), round(float(np.sqrt((error**2).sum(axis=1).mean())), 4)
    return found


tables = {path.name: figures(path) for path in sorted(Path(sys.argv[1]).iterdir())}
Path(__file__).with_name("mixtures.json").write_text(json.dumps(tables, indent=1) + "\n")

"""Measures scikit-learn's GaussianMixture and the Python package gmr beside ours, in one run, on one core.

    pip install numpy scikit-learn gmr
    python3 tools/bench/peers.py

The same rows, the same number of components, the same starts, the same rule to stop; predictions from the same mixture at
the same places. Prints ratios: above 1 we are faster. "per call" lets numpy work on all rows at once and one at a time.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np  # noqa: E402  (after the number of threads is set)
from gmr import GMM  # noqa: E402
from sklearn.cluster import kmeans_plusplus  # noqa: E402
from sklearn.exceptions import ConvergenceWarning  # noqa: E402
from sklearn.mixture import GaussianMixture  # noqa: E402
import warnings  # noqa: E402

ROWS, STARTS = 10_000, 10
TOLERANCE, ITERATIONS, REGULARISATION = 1e-5, 500, 1e-6
REPOSITORY = Path(__file__).resolve().parents[2]


def recording(random):
    """Standardised rows: two counts on a path with many turns, two angles behind them by a gap."""
    t = 0.1 * np.arange(ROWS)
    counts = np.stack([
        900 * np.sin(0.31 * t) + 600 * np.sin(1.13 * t),
        900 * np.cos(0.23 * t) + 600 * np.sin(0.97 * t),
    ], axis=1)
    behind, lagging = counts.copy(), counts[0].copy()
    for row in range(ROWS):
        lagging = np.clip(lagging, counts[row] - 60, counts[row] + 60)
        behind[row] = lagging
    turned = behind @ np.array([[1, 1], [-1, 1]]) / 1500
    rows = np.hstack([counts, 20 * np.tanh(turned) + 0.1 * random.standard_normal((ROWS, 2))])
    return (rows - rows.mean(axis=0)) / rows.std(axis=0)


def start(rows, components, seed):
    """k-means++ centres, equal weights, and the covariance of all rows over the number of components."""
    means, _ = kmeans_plusplus(rows, components, random_state=seed)
    covariance = np.cov(rows.T) / components
    return {
        "weights": [1 / components] * components,
        "means": means.tolist(),
        "covariances": [covariance.tolist()] * components,
    }


def scikit_learn(rows, starts):
    best, begin = None, time.perf_counter()
    for one in starts:
        fit = GaussianMixture(
            len(one["weights"]), tol=TOLERANCE, reg_covar=REGULARISATION, max_iter=ITERATIONS,
            weights_init=one["weights"], means_init=one["means"],
            precisions_init=np.linalg.inv(np.array(one["covariances"])),
        ).fit(rows)
        likelihood = fit.score(rows)
        if best is None or likelihood > best[0]:
            best = (likelihood, fit)
    return time.perf_counter() - begin, *best


def ours(program, question):
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        json.dump(question, file)
        file.flush()
        answer = subprocess.run([program, "peers", file.name], check=True, capture_output=True, text=True).stdout
    return json.loads(answer)


def predict(mixture, counts):
    """Seconds per prediction of the package gmr, all rows at once and one at a time, and the predictions."""
    peer = GMM(len(mixture["weights"]), np.array(mixture["weights"]), np.array(mixture["means"]),
               np.array(mixture["covariances"]))
    begin = time.perf_counter()
    together = peer.predict(np.array([0, 1]), counts)
    batch = (time.perf_counter() - begin) / len(counts)
    some = counts[:: max(1, len(counts) // 200)]
    begin = time.perf_counter()
    for row in some:
        peer.predict(np.array([0, 1]), row[None, :])
    return batch, (time.perf_counter() - begin) / len(some), together


def main():
    warnings.simplefilter("ignore", ConvergenceWarning)
    build = ["cargo", "build", "--quiet", "--release", "-p", "i2ris-bench"]
    subprocess.run(build, check=True, cwd=REPOSITORY)
    target = Path(os.environ.get("CARGO_TARGET_DIR", REPOSITORY / "target"))
    program = target / "release" / "i2ris-bench"
    rows = recording(np.random.default_rng(1))
    print(f"{ROWS} rows of 4 variables, {STARTS} equal starts, one core; likelihood: mean per row, nats")
    print(f"{'K':>3} {'fit sklearn':>12} {'ours':>8} {'ratio':>6} {'likelihood':>11} {'ours':>9} {'difference':>11}"
          f" {'gmr batch':>10} {'gmr single':>11} {'ours':>8} {'ratios':>14}")
    for components in (3, 10, 20):
        starts = [start(rows, components, seed) for seed in range(STARTS)]
        seconds, likelihood, fit = scikit_learn(rows, starts)
        mixture = {"weights": fit.weights_.tolist(), "means": fit.means_.tolist(),
                   "covariances": fit.covariances_.tolist()}
        found = ours(program, {
            "rows": rows.tolist(), "starts": starts, "mixture": mixture, "tolerance": TOLERANCE,
            "max_iterations": ITERATIONS, "regularisation": REGULARISATION,
        })
        batch, single, predictions = predict(mixture, rows[:, :2])
        apart = np.abs(predictions - np.array(found["predictions"])).max()
        if apart > 1e-6:
            sys.exit(f"the predictions of the package gmr and ours differ by {apart}")
        each = found["prediction_s"] / ROWS
        print(f"{components:>3} {seconds:>10.2f} s {found['fit_s']:>6.2f} s {seconds / found['fit_s']:>6.1f}"
              f" {likelihood:>11.4f} {found['log_likelihood']:>9.4f} {found['log_likelihood'] - likelihood:>+11.4f}"
              f" {1e6 * batch:>7.2f} us {1e6 * single:>8.1f} us {1e6 * each:>5.2f} us"
              f" {batch / each:>6.1f} {single / each:>7.0f}")


if __name__ == "__main__":
    main()

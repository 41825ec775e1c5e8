"""Sobol's indices of a design, computed anew from a sweep's table of runs: address, sweep, result, scale."""

import json
import sys

import numpy as np
import pandas as pd

address, sweep, y, scale = sys.argv[1:]
spec = pd.read_json(f"{address}/api/v1/sweeps/{sweep}", typ="series")["spec"]
names = sorted(spec["sample"]["ranges"])
n, d = spec["sample"]["n"], len(names)
runs = pd.read_csv(f"{address}/api/v1/sweeps/{sweep}/runs.csv").sort_values("run_index")
assert len(runs) == n * (d + 2), (len(runs), n, d)
assert (runs["run_index"] == np.arange(len(runs))).all()

# Which runs are A, which B, and which A with one parameter from B.
points = runs[names].to_numpy().reshape(n, d + 2, d)
a, b = points[:, 0], points[:, -1]
for i in range(d):
    mixed = points[:, 1 + i]
    assert (mixed[:, i] == b[:, i]).all() and (mixed[:, i] != a[:, i]).all(), names[i]
    others = [k for k in range(d) if k != i]
    assert (mixed[:, others] == a[:, others]).all(), names[i]

f = runs[y].to_numpy()
f = np.log(f) if scale == "log" else f
f = f.reshape(n, d + 2)
mean, variance = np.mean(f[:, [0, -1]]), np.var(f[:, [0, -1]])


def estimates(f):
    """First-order indices and total ones: by Saltelli et al. (2010) and by Jansen (1999)."""
    f = f - centre
    fa, fb, mixed = f[:, :1], f[:, -1:], f[:, 1:-1]
    v = np.var(f[:, [0, -1]])
    return np.mean(fb * (mixed - fa), axis=0) / v, np.mean((fa - mixed) ** 2, axis=0) / (2 * v)


centre = f.mean()
first, total = estimates(f)
random = np.random.default_rng(1)
resampled = np.array([estimates(f[random.integers(0, n, n)]) for _ in range(2000)])
ends = np.percentile(resampled, [2.5, 97.5], axis=0)
json.dump(
    {
        "mean": mean,
        "variance": variance,
        "sum_of_first": first.sum(),
        "indices": [
            {
                "parameter": name,
                "first": {"estimate": first[i], "ci95": list(ends[:, 0, i])},
                "total": {"estimate": total[i], "ci95": list(ends[:, 1, i])},
            }
            for i, name in enumerate(names)
        ],
    },
    sys.stdout,
)

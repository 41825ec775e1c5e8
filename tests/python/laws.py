"""Columns and laws of a sweep beside pandas and numpy, which read the sweep's Parquet file: argument is its address."""

import io
import json
import sys
import urllib.parse
import urllib.request

import numpy as np
import pandas as pd

sweep = sys.argv[1]


def get(path, **members):
    query = urllib.parse.urlencode(members)
    with urllib.request.urlopen(f"{sweep}/{path}?{query}") as answer:
        return answer.read()


def ask(path, **members):
    # NaN and Infinity are no JSON, though Python reads them.
    def refuse(name):
        raise ValueError(name)

    return json.loads(get(path, **members), parse_constant=refuse)


runs = pd.read_parquet(io.BytesIO(get("runs.parquet"))).sort_values("run_index").reset_index(drop=True)
assert set(runs.status) >= {"converged", "no_steady_state", "overthick"}, set(runs.status)

names = ["melt_rate_m_per_day", "force_n_per_m", "n_cells", "run_id", "detail"]
told = ask("columns", names=",".join(names))
columns = pd.DataFrame(told["columns"])
assert list(columns) == ["run_index", "status", *names]
assert told["shown"] == told["total"] == len(runs) and told["choice"] == "all"
for name in columns:
    assert (columns[name].isna() == runs[name].isna()).all(), name
    there = runs[name].notna()
    assert (columns[name][there] == runs[name][there]).all(), name

least = runs.sort_values("run_id").head(10).sort_values("run_index")
few = ask("columns", names="run_id", most=10)
assert (few["shown"], few["total"], few["choice"]) == (10, len(runs), "random")
assert few["columns"]["run_index"] == least.run_index.tolist()
assert few["columns"]["run_id"] == least.run_id.tolist()

SPACES = {
    "power_law": (np.log, np.log, np.exp),
    "exponential": (lambda x: x, np.log, np.exp),
    "linear": (lambda x: x, lambda y: y, lambda y: y),
}


def close(got, expected, what, tolerance=1e-9):
    assert np.allclose(got, expected, rtol=tolerance, atol=0), f"{what}: {got} is not {expected}"


def local_slopes(points, others):
    """Slopes between neighbouring x, within runs that agree in all else, and their means at each place."""
    places = sorted(points.x.unique())
    pairs = {}
    sets = points.groupby([others[name] for name in others], dropna=False) if len(others.columns) else [(None, points)]
    for _, members in sets:
        mean = members.groupby("x").y.mean()
        for at, (low, high) in enumerate(zip(places, places[1:])):
            if low in mean and high in mean:
                pairs.setdefault(at, []).append((mean[high] - mean[low]) / (high - low))
    middles = [0.5 * (places[at] + places[at + 1]) for at in sorted(pairs)]
    return middles, [np.mean(pairs[at]) for at in sorted(pairs)]


def check(x, y, model, group_by):
    asked = {"x": x, "y": y, "model": model, **({"group_by": group_by} if group_by else {})}
    laws = ask("laws", **asked)
    forward_x, forward_y, back_y = SPACES[model]
    assert laws["total"] == len(runs) == sum(g["n_runs"] for g in laws["groups"])
    assert laws["shown"] == sum(len(g["points"]["x"]) for g in laws["groups"])
    seen = []
    for group in laws["groups"]:
        if group_by is None:
            members, condition = runs, None
        elif group["from"] is None:
            members, condition = runs[runs[group_by].isna()], f"{group_by} is null"
        else:
            members = runs[(group["from"] <= runs[group_by]) & (runs[group_by] <= group["to"])]
            condition = f"{group['from']!r} <= {group_by} <= {group['to']!r}"
        seen += members.run_index.tolist()
        assert group["n_runs"] == len(members)
        left_out = sum(one["count"] for one in group["left_out"])
        used = members[members.status.isin(["converged", "completed"]) & members[x].notna() & members[y].notna()]
        points = group["points"]
        assert points["run_index"] == used.run_index.tolist()
        assert len(used) + left_out == len(members)
        parameters = ["b", "melt_rate_m_per_day", "upstream_closure", "width_m"]
        differing = [p for p in parameters if p not in (x, y) and used[p].nunique() > 1]
        assert group["also_varies"] == differing, (group["also_varies"], differing)
        if group["fit"] is None:
            assert group["no_fit"] and not points["fitted"] and not points["residual"]
            assert len(used) < 3 or used[x].nunique() == 1
            continue
        fit = group["fit"]
        assert fit["n_used"] == len(used) and fit["left_out"] == group["left_out"]
        across, up = forward_x(used[x].to_numpy()), forward_y(used[y].to_numpy())
        slope, intercept = np.polyfit(across, up, 1)
        close(fit["exponent"]["estimate"], slope, "slope", 1e-7)
        close(fit["prefactor"]["estimate"], back_y(intercept), "prefactor", 1e-6)
        residual = up - (intercept + slope * across)
        error = np.sqrt(residual @ residual / (len(used) - 2) / ((across - across.mean()) ** 2).sum())
        close(fit["exponent"]["standard_error"], error, "standard error", 1e-6)
        scale = np.abs(up).max()
        assert np.allclose(points["residual"], residual, rtol=0, atol=1e-8 * scale)
        close(points["fitted"], back_y(intercept + slope * across), "fitted", 1e-6)
        middles, slopes = local_slopes(pd.DataFrame({"x": across, "y": up}), used[differing].reset_index(drop=True))
        assert np.allclose(group["local_exponent"]["exponent"], slopes, rtol=1e-6, atol=1e-9 * scale)
        close(group["local_exponent"]["x"], np.exp(middles) if model == "power_law" else middles, "middles")
        why = group["no_local_exponent"]
        assert why is None if slopes else "agree in" in why, why
        # A group is what one fit of the same runs gives, bit by bit.
        filtered = {"filter": condition} if condition else {}
        assert ask("fit", x=x, y=y, model=model, **filtered) == fit
    assert sorted(seen) == runs.run_index.tolist(), "each run is in one group"
    return laws


melt, force = "melt_rate_m_per_day", "force_n_per_m"
assert check(melt, force, "power_law", None)["grouping"] == "one group"
each = check(melt, force, "power_law", "width_m")
assert each["grouping"] == "each value"
assert [(g["from"], g["to"]) for g in each["groups"]] == [(3000, 3000), (6000, 6000)]
check(melt, force, "exponential", "b")
check("width_m", "length_m", "linear", None)
bins = check(melt, force, "power_law", "length_m")
assert bins["grouping"] == "bins of about equally many runs"
sizes = [len(g["points"]["x"]) for g in bins["groups"] if g["from"] is not None]
assert len(sizes) == 6 and max(sizes) <= min(sizes) + 1, sizes
assert bins["groups"][-1]["from"] is None and bins["groups"][-1]["n_runs"] == runs.length_m.isna().sum() > 0
check(melt, force, "power_law", melt)
# Runs without a result have no iterations: they make no bin of their own.
check(melt, force, "power_law", "iterations")
# On the whole grid each slope is one that single widths and values of b have.
whole = ask("laws", x=melt, y=force)["groups"][0]
assert whole["also_varies"] == ["b", "upstream_closure", "width_m"], whole["also_varies"]
assert max(whole["local_exponent"]["exponent"]) < 0, whole["local_exponent"]

# Fewer points than runs: the same fits, and the points of least id.
most = ask("laws", x=melt, y=force, group_by="width_m", most=7)
assert most["shown"] == 7 and [g["fit"] for g in most["groups"]] == [g["fit"] for g in each["groups"]]
of_all = [i for g in each["groups"] for i in g["points"]["run_index"]]
shown = sorted(i for g in most["groups"] for i in g["points"]["run_index"])
by_id = runs[runs.run_index.isin(of_all)].sort_values("run_id").head(7)
assert shown == sorted(by_id.run_index), (shown, by_id)
print(len(runs))

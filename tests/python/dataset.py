"""The NetCDF datasets of sweeps, read by netCDF4, h5netcdf and xarray, and held against their Parquet tables bit by bit.

Called with the address of a service and the ids of sweeps.
"""

import os
import subprocess
import sys
import urllib.request

import netCDF4
import numpy as np
import pyarrow.parquet as pq
import xarray as xr


def fetch(address, sweep, name):
    path = f"{sweep}-{name}"
    urllib.request.urlretrieve(f"{address}/api/v1/sweeps/{sweep}/{name}", path)
    return path


def bits(values):
    return np.ascontiguousarray(values, dtype="float64").view("int64")


def assert_same(what, read, stored):
    """Numbers bit by bit; NaN where nothing is stored."""
    gaps = np.array([v is None for v in stored])
    read = np.asarray(read, dtype="float64")
    assert np.isnan(read[gaps]).all(), what
    stored = np.array([v for v in stored if v is not None], dtype="float64")
    assert (bits(read[~gaps]) == bits(stored)).all(), what


def of_runs(ds, table):
    assert ds.run.values.tolist() == table["run_index"].to_pylist()
    checked = 0
    for field in table.schema:
        if field.name in ("run_index", "residual_history", "options"):
            continue
        stored = table[field.name].to_pylist()
        variable = ds[field.name]
        if field.type == "uint64":
            assert variable.values.tolist() == ["" if v is None else str(v) for v in stored], field.name
        elif field.type == "string":
            assert variable.values.tolist() == [v or "" for v in stored], field.name
        else:
            assert_same(field.name, variable.values, stored)
            assert variable.attrs["units"], field.name
        assert variable.attrs["long_name"] == field.metadata[b"meaning"].decode(), field.name
        checked += 1
    flags = ds.status_flag
    names = flags.attrs["flag_meanings"].split()
    assert [names[int(v)] for v in flags.values] == table["status"].to_pylist()
    return checked


def rows_by_run(ds, table):
    """The rows of each run; a run that is there twice has its rows twice, behind each other."""
    rows = {}
    for row in table.to_pylist():
        rows.setdefault(row["run_id"], []).append(row)
    seen = {}
    for run, run_id in enumerate(ds.run_id.values.tolist()):
        of_id = rows.get(run_id, [])
        count = len(of_id) // ds.run_id.values.tolist().count(run_id)
        first = seen.get(run_id, 0)
        seen[run_id] = first + count
        yield run, of_id[first : first + count]


def padded(what, read, stored):
    read = np.asarray(read)
    assert_same(what, read[: len(stored)], stored)
    assert np.isnan(read[len(stored) :]).all(), what


def of_states(ds, table):
    arrays = [f.name for f in table.schema if f.name not in ("run_id", "time_a", "requested")]
    for run, rows in rows_by_run(ds, table):
        for place, row in enumerate(rows):
            at = {"run": run}
            if "snapshot" in ds.sizes:
                at["snapshot"] = place
                time = ds.snapshot_time_a.isel({k: v for k, v in at.items() if k in ds.snapshot_time_a.dims})
                assert time.item() == row["time_a"]
                assert bool(ds.snapshot_requested.isel(at)) == row["requested"]
            else:
                assert place == 0 and row["time_a"] is None
            for name in arrays:
                padded(name, ds[name].isel(at).values, row[name])
            chi = ds.chi_cell if ds.chi_cell.dims == ("cell",) else ds.chi_cell.isel(run=run)
            cells = len(row["cell_x_m"])
            assert np.allclose(chi.values[:cells] * row["node_x_m"][-1], row["cell_x_m"], rtol=1e-14)
        if not rows and "node" in ds.sizes:
            assert np.isnan(ds.velocity_m_per_a.isel(run=run).values).all()


def of_series(ds, table):
    names = [f.name for f in table.schema if f.name not in ("run_id", "time_a")]
    for run, rows in rows_by_run(ds, table):
        if rows:
            times = ds.time_a if ds.time_a.dims == ("time_a",) else ds.time_a.isel(run=run)
            padded("time_a", times.values, [row["time_a"] for row in rows])
        for name in names if "time_a" in ds.variables else []:
            padded(name, ds[f"series_{name}"].isel(run=run).values, [row[name] for row in rows])


def check(address, sweep):
    path = fetch(address, sweep, "ensemble.nc")
    with netCDF4.Dataset(path) as file:
        assert file.data_model == "NETCDF4" and file.Conventions == "CF-1.11"
        assert file["force_n_per_m"].filters()["zlib"]
    ds = xr.open_dataset(path, engine="netcdf4").load()
    assert ds.identical(xr.open_dataset(path, engine="h5netcdf").load())
    assert ds.attrs["melange_sweep_id"] == sweep
    table = {name: pq.read_table(fetch(address, sweep, f"{name}.parquet")) for name in ("runs", "profiles", "series")}
    columns = of_runs(ds, table["runs"])
    of_states(ds, table["profiles"])
    of_series(ds, table["series"])
    checker = os.path.join(os.path.dirname(sys.executable), "compliance-checker")
    report = subprocess.run([checker, "--test=cf:1.11", path], capture_output=True, text=True)
    assert "All tests passed!" in report.stdout, report.stdout + report.stderr
    sizes = " ".join(f"{name}={size}" for name, size in sorted(ds.sizes.items()))
    print(f"{ds.title}: {columns} columns, {sizes}")


for sweep in sys.argv[2:]:
    check(sys.argv[1], sweep)

"""Runs a figure's script and holds what it drew against the figure's CSV, number by number.

Usage: redraw.py SCRIPT CSV. Prints how many layers and numbers were compared.
"""

import csv
import os
import sys

os.environ["MPLBACKEND"] = "Agg"
import numpy as np

script, table = sys.argv[1:]
drawn = {}
exec(compile(open(script, encoding="utf-8").read(), script, "exec"), drawn)
ax = drawn["ax"]


def number(field):
    """A number; none for what does not exist, or is a word of an axis of words."""
    try:
        return float(field)
    except ValueError:
        return np.nan


with open(table, newline="", encoding="utf-8") as lines:
    head, *rows = csv.reader(lines)


def same(got, expected, name):
    """The same numbers, in whatever order; what does not exist is nothing."""
    got, expected = (np.array(a, dtype=float).reshape(-1, 2) for a in (got, expected))
    told = ~np.isnan(expected).all(axis=0)
    got, expected = got[:, told], expected[:, told]
    got, expected = (a[~np.isnan(a).any(axis=1)] for a in (got, expected))
    assert got.shape == expected.shape and got.size > 0, (name, got.shape, expected.shape)
    got, expected = (a[np.lexsort(a.T)] for a in (got, expected))
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-300, err_msg=name)
    return got.size


def compare(name, rows, artists):
    """Holds the artists of a layer against its rows: x, y, lower, upper."""
    kind = type(artists[0]).__name__
    if kind == "QuadMesh":
        shown = np.ma.filled(artists[0].get_array().astype(float), np.nan)
        assert shown.size == len(rows), (name, shown.shape, len(rows))
        return shown.size
    if kind == "FillBetweenPolyCollection" or kind == "PolyCollection":
        corners = np.concatenate([path.vertices for artist in artists for path in artist.get_paths()])
        for edge in rows[:, 2:].T:
            for x, y in zip(rows[:, 0], edge):
                assert np.isclose(corners, [x, y], rtol=1e-9).all(axis=1).any(), (name, x, y)
        return rows[:, 2:].size
    if not np.isnan(rows[:, 2]).all():
        # Bars: the marks come first, then their ends.
        middles = [artist for artist in artists if hasattr(artist, "get_xydata") and len(artist.get_xydata()) == len(rows)]
        ends = np.concatenate([np.concatenate(a.get_segments()) for a in artists if hasattr(a, "get_segments")])
        for edge in rows[:, 2:].T:
            assert all(np.isclose(ends, end, rtol=1e-9).any() for end in edge[~np.isnan(edge)]), name
        return same(places(middles[0]), rows[:, :2], name) + rows[:, 2:].size
    if kind == "Line2D" and np.isnan(rows[:, :2]).any(axis=1).all():
        # A line from edge to edge has one coordinate only.
        along = 0 if np.isnan(rows[0, 1]) else 1
        assert all(np.allclose(line.get_xydata()[:, along], rows[0, along]) for line in artists), name
        return 1
    return same(np.concatenate([places(artist) for artist in artists]), rows[:, :2], name)


def places(artist):
    """Coordinates of a curve's or of single points."""
    if hasattr(artist, "get_xydata"):
        return artist.get_xydata()
    return np.ma.filled(artist.get_offsets().astype(float), np.nan)


if head[0] == "run":
    columns = [10.0**c if log else c for c, log in zip(drawn["columns"], drawn["is_log"])]
    expected = np.array([[number(field) for field in row[1:]] for row in rows])
    np.testing.assert_allclose(np.transpose(columns), expected, rtol=1e-9)
    layers, compared = len(columns), expected.size
else:
    assert head[0] == "layer" and head[3:5] == ["lower", "upper"], head
    by_name = {}
    for row in rows:
        by_name.setdefault(row[0], []).append([number(field) for field in row[1:5]])
    artists = {}
    for artist in [*ax.lines, *ax.collections]:
        artists.setdefault(artist.get_gid(), []).append(artist)
    for name in by_name:
        assert name in artists, f"{name!r} was not drawn; there are {list(artists)}"
    layers = len(by_name)
    compared = sum(compare(name, np.array(rows), artists[name]) for name, rows in by_name.items())
    assert ax.get_xlabel() and ax.get_ylabel()

print(f"{layers} layers, {compared} numbers")

"""Opens the files of figures: pictures that are pictures, tables that are tables.

Usage: check_figures.py LIST, a JSON list of figures with the names of their files, beside which the files lie.
Prints a line for each figure.
"""

import csv
import json
import pathlib
import sys
import xml.etree.ElementTree as xml

from PIL import Image

where = pathlib.Path(sys.argv[1])
for figure in json.loads(where.read_text(encoding="utf-8")):
    files = {kind: where.parent / name for kind, name in figure["files"].items()}
    picture = xml.parse(files["SVG"]).getroot()
    assert picture.tag.endswith("svg"), picture.tag
    text = files["SVG"].read_text(encoding="utf-8")
    assert "NaN" not in text and "undefined" not in text, f"{figure['title']}: not a number in its SVG"
    marks = len([e for e in picture.iter() if e.tag.rsplit("}")[-1] in ("path", "circle", "rect", "polygon", "polyline")])
    assert marks > 10, f"{figure['title']} has {marks} marks"
    with Image.open(files["PNG"]) as pixels:
        assert pixels.width >= 4000, pixels.size
        assert all(abs(d - 600) < 0.1 for d in pixels.info["dpi"]), pixels.info
        # Something is drawn, in several colours.
        assert len(pixels.convert("RGB").resize((400, 250)).getcolors(100_000)) > 8
    with files["CSV"].open(newline="", encoding="utf-8") as lines:
        rows = list(csv.reader(lines))
    assert len({len(row) for row in rows}) == 1 and len(rows) > 1, f"{figure['title']}: {len(rows)} rows"
    print(f"{figure['title']}: {marks} marks, {len(rows) - 1} rows")

// What becomes of a figure's data: its table, its script, its colours, its pixels' density.
import { expect, test } from "vitest";
import { csv, table } from "./csv";
import { type Figure, type Parallel, share } from "./figure";
import { edges } from "./layers";
import { crc32, withDensity } from "./png";
import { fileName, python } from "./python";
import { LOOKS, viridis } from "./theme";

const figure: Figure = {
  title: 'Force, "melt" & co.',
  x: { name: "melt rate", unit: "m d-1", log: true },
  y: { name: "force", unit: "N m-1", min: 0 },
  scale: { name: "width", unit: "m", min: 3000, max: 6000 },
  data: { law: "sweeps/1/laws?x=a" },
  notes: ["Showing 2 of 3 runs."],
  layers: [
    { kind: "points", name: "runs", x: [0.5, 1], y: [3, null], ids: [7, 8], values: [3000, 6000] },
    { kind: "curve", name: "fit", x: [0.5, 1], y: [3, 1], python: { x: 'law["x"]', y: 'law["y"]' }, line: "dashed" },
    { kind: "area", name: "band", x: [0.5, 1], lower: [2, 0.5], upper: [4, 1.5], quiet: true },
    { kind: "heat", name: "cells", x: [1, 2], y: [5], z: [[9, null]] },
    { kind: "guide", name: "yield", y: 2 },
  ],
};

test("the table has every number that is drawn, and no other", () => {
  const [head, ...rows] = table(figure);
  expect(head).toEqual(["layer", "melt rate [m d-1]", "force [N m-1]", "lower", "upper", "width [m]", "run"]);
  expect(rows).toHaveLength(2 + 2 + 2 + 2 + 1);
  expect(rows[0]).toEqual(["runs", 0.5, 3, undefined, undefined, 3000, 7]);
  expect(rows[4]).toEqual(["band", 0.5, null, 2, 4, undefined, undefined]);
});

test("CSV quotes what has to be quoted", () => {
  const text = csv({ ...figure, layers: [{ kind: "curve", name: 'a, "b"', x: [1e-20], y: [0.1] }] });
  expect(text.split("\r\n")[1]).toBe('"a, ""b""",1e-20,0.1,,,,');
});

test("the script asks for what is asked for and holds the rest", () => {
  const script = python(figure, "http://here/api/v1");
  expect(script).toContain('os.environ.get("MELANGE_URL", "http://here/api/v1")');
  expect(script).toContain('law = read("sweeps/1/laws?x=a")');
  expect(script).toContain('ax.plot(numbers(law["x"]), numbers(law["y"])');
  expect(script).toContain("numbers([3, None])");
  expect(script).toContain('ax.set_xscale("log")');
  expect(script).toContain("ax.set_ylim(bottom=0)");
  expect(script).not.toMatch(/undefined|NaN|\[object/);
});

test("the script writes whatever names say, and stands whatever titles say", () => {
  const name = '_x of $b$ "c"';
  const script = python(
    { ...figure, title: 'a "b"\ncoding: cp1252 """', x: { name: "$N", unit: "1", categories: ["_$"] }, layers: [{ kind: "curve", name, x: [1], y: [2] }] },
    "http://here/api/v1",
  );
  const lines = script.split("\n");
  expect(lines.slice(0, 4)).toEqual(["# -*- coding: utf-8 -*-", '# a "b" coding: cp1252 """', "# Showing 2 of 3 runs.", ""]);
  expect(script).toContain(`gid=${JSON.stringify(name)}, label=${JSON.stringify(' _x of \\$b\\$ "c"')}`);
  expect(script).toContain('ax.set_xlabel("\\\\$N")');
  expect(script).toContain('[" _\\\\$"]');
});

test("a script of parallel axes has a column for each axis", () => {
  const parallel: Parallel = {
    title: "all",
    axes: [{ name: "b", unit: "1", log: true }, { name: "F", unit: "N m-1" }],
    rows: [[1e4, 5], [1e5, null]],
    ids: [0, 1],
    colored: 1,
    scale: { name: "F", unit: "N m-1", min: 0, max: 5 },
  };
  const script = python(parallel, "http://here/api/v1");
  expect(script).toContain("columns = [numbers([10000, 100000]), numbers([5, None])]");
  expect(table(parallel)).toEqual([["run", "b", "F [N m-1]"], [0, 1e4, 5], [1, 1e5, null]]);
});

test("names of files are plain", () => {
  expect(fileName('Force, "melt" & co.')).toBe("Force-melt-co");
  expect(fileName("…")).toBe("figure");
});

test("places on a scale", () => {
  const scale = { name: "b", unit: "1", min: 1e3, max: 1e5, log: true };
  expect(share(scale, 1e4)).toBeCloseTo(0.5, 12);
  expect(share({ ...scale, log: false }, 1e3)).toBe(0);
  expect(share({ ...scale, min: 5, max: 5 }, 5)).toBe(0.5);
});

test("cells of a heat map meet half way and reach as far beyond", () => {
  expect(edges([1, 2, 4])).toEqual([0.5, 1.5, 3, 5]);
  expect(edges([3])).toHaveLength(2);
  expect(edges([])).toEqual([]);
});

test("viridis runs from violet to yellow, and stands out from paper and screen", () => {
  expect(viridis(0, "light")).toBe("#440154");
  expect(viridis(1, "dark")).toBe("#fde725");
  for (const theme of ["light", "dark"] as const) {
    for (let i = 0; i <= 20; i += 1) {
      expect(contrast(viridis(i / 20, theme), LOOKS[theme].paper)).toBeGreaterThan(1.3);
    }
  }
});

test("what is written and drawn with lines has the contrast that WCAG asks for", () => {
  for (const theme of ["light", "dark"] as const) {
    const { paper, ink, faint, force, quasiStatic, fit, ice } = LOOKS[theme];
    for (const text of [ink, faint]) expect(contrast(text, paper)).toBeGreaterThan(4.5);
    for (const line of [force, quasiStatic, fit]) expect(contrast(line, paper)).toBeGreaterThan(3);
    expect(contrast(ice, paper)).toBeGreaterThan(2);
  }
});

/** Ratio of contrast, WCAG 2.1. */
function contrast(a: string, b: string): number {
  const light = (hex: string): number => {
    const [r = 0, g = 0, bl = 0] = [1, 3, 5].map((i) => {
      const c = parseInt(hex.slice(i, i + 2), 16) / 255;
      return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * r + 0.7152 * g + 0.0722 * bl;
  };
  const [x, y] = [light(a), light(b)];
  return (Math.max(x, y) + 0.05) / (Math.min(x, y) + 0.05);
}

test("a picture says how many dots an inch has", async () => {
  // CRC-32 of "123456789", the check value of the algorithm.
  expect(crc32(new TextEncoder().encode("123456789"))).toBe(0xcbf43926);
  const picture = new Blob([new Uint8Array(33 + 12)]);
  const bytes = new Uint8Array(await (await withDensity(picture, 600)).arrayBuffer());
  expect(bytes).toHaveLength(33 + 21 + 12);
  const chunk = new DataView(bytes.buffer, 33, 21);
  expect([chunk.getUint32(0), chunk.getUint32(8), chunk.getUint8(16)]).toEqual([9, 23622, 1]);
});

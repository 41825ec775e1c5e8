// Choosing runs evenly, and reading a choice off an address.
import { expect, test } from "vitest";
import { drawnText, evenly, exampleOf, readRuns, spread, stage, varied, variedIn } from "./choice";

test("runs are read off an address, what is no index is left out", () => {
  expect(readRuns("3,7, 9,3,x,-1,1.5")).toEqual([3, 7, 9]);
  expect(readRuns(undefined)).toEqual([]);
  expect(readRuns("")).toEqual([]);
});

test("places are evenly spread, with both ends", () => {
  expect(evenly(51, 3)).toEqual([0, 25, 50]);
  expect(evenly(3, 24)).toEqual([0, 1, 2]);
  expect(evenly(5, 1)).toEqual([2]);
  expect(evenly(0, 4)).toEqual([]);
});

test("of a grid the middle runs are taken, one for each value", () => {
  const grid = Array.from({ length: 900 }, (_, index) => ({ index, value: Math.floor(index / 30), others: [index % 30] }));
  const chosen = spread(grid, 24);
  expect(chosen).toHaveLength(24);
  expect(new Set(chosen.map((i) => i % 30))).toEqual(new Set([14]));
  expect(chosen[0]).toBe(14);
  expect(chosen.at(-1)).toBe(29 * 30 + 14);
});

test("in a grid everything else stays as in the middle, with gaps where that has no state", () => {
  const widths = [6000, 4000, 5000];
  const grid = Array.from({ length: 30 }, (_, index) => ({
    index, value: Math.floor(index / 6), others: [widths[index % 3], ["open", "closed"][index % 2]], isDrawn: index !== 14 && index % 3 !== 0,
  }));
  expect(spread(grid, 24)).toEqual([2, 8, 20, 26]);
  // A width of which nothing can be drawn is not chosen.
  const narrow = grid.map((run) => ({ ...run, isDrawn: run.others[0] === 4000 }));
  expect(new Set(spread(narrow, 24).map((i) => narrow[i]?.others[0]))).toEqual(new Set([4000]));
});

test("a random sample is spread over one of its parameters", () => {
  const sample = Array.from({ length: 100 }, (_, index) => ({ index, value: (37 * index) % 100, others: [(59 * index) % 100] }));
  const chosen = spread(sample, 6);
  expect(chosen.map((i) => sample[i]?.value)).toEqual([0, 20, 40, 59, 79, 99]);
});

test("pairs of a Saltelli design are no grid", () => {
  const pairs = Array.from({ length: 40 }, (_, index) => ({ index, value: index, others: [Math.floor(index / 2)] }));
  expect(spread(pairs, 8)).toHaveLength(8);
  const two = Array.from({ length: 6 }, (_, index) => ({ index, value: index % 2, others: [Math.floor(index / 2)] }));
  expect(spread(two, 8)).toEqual([2, 3]);
});

test("while runs come in, those that are drawn stay", () => {
  const grid = Array.from({ length: 30 }, (_, index) => ({ index, value: Math.floor(index / 3), others: [index % 3] }));
  const first = spread(grid.slice(0, 9), 6);
  expect(first).toEqual([1, 4, 7]);
  const then = spread(grid.slice(0, 15), 6, first);
  expect(then).toEqual([1, 4, 7, 10, 13]);
  expect(spread(grid, 5, then)).toEqual(then);
  expect(spread(grid, 6, then)).toHaveLength(6);
});

test("few values share the places among their runs", () => {
  const rows = Array.from({ length: 84 }, (_, index) => ({ index, value: index % 4 }));
  expect(spread(rows, 24)).toHaveLength(24);
  expect(spread(rows.slice(0, 2), 24)).toEqual([0, 1]);
  expect(spread([{ index: 5, value: null }, { index: 1, value: 2 }], 24)).toEqual([1, 5]);
});

test("many runs are looked at in fiftieths, and at their end", () => {
  expect(stage(7, 20, false)).toBe(7);
  expect(stage(10_100, 100_000, false)).toBe(stage(11_900, 100_000, false));
  expect(stage(99_999, 100_000, true)).toBe(99_999);
});

test("what varies stands in the document where the service does not tell", () => {
  const spec = {
    axes: [{ parameter: "b" }, { zip: [{ parameter: "width_m" }, { parameter: "d_m" }] }, { option: "upstream_closure" }],
  };
  expect(variedIn(spec)).toEqual(["b", "width_m", "d_m"]);
  expect(variedIn({ sample: { ranges: { mu_s: [0.2, 0.4] } } })).toEqual(["mu_s"]);
  expect(variedIn({ table: { columns: ["A"] } })).toEqual(["A"]);
  expect(varied({ spec, varies: [{ parameter: "A" }] })).toEqual(["A"]);
  expect(varied({ spec, varies: [] })).toEqual(["b", "width_m", "d_m"]);
});

test("an example of a condition is one that runs meet, about what else varies", () => {
  const grid = { b: [1, 1, 1, 2, 2, 2], width_m: [4000, 5000, 6000, 4000, 5000, 6000] };
  expect(exampleOf(grid, ["b", "width_m"], "b")).toBe("width_m = 5000");
  const sample = { b: [1, 2, 3, 4, 5, 6], width_m: [4100, 5200, 6300, 4400, 5500, 6600] };
  expect(exampleOf(sample, ["b", "width_m"], "b")).toBe("5200 <= width_m <= 5500");
  expect(exampleOf(sample, ["b"], "b")).toBe("3 <= b <= 4");
  expect(exampleOf({ b: [1, 2.34567, 2.34568, 4] }, ["b"], "b")).toBe("2.34567 <= b <= 2.34568");
  expect(exampleOf({ b: [1, 2.34567, 3.45678, 4] }, ["b"], "b")).toBe("2.35 <= b <= 3.46");
  expect(exampleOf({}, [], "b")).toBe("run_index < 100");
});

test("what is not drawn is said", () => {
  expect(drawnText(3, 3)).toBe("Showing the 3 runs that were chosen.");
  expect(drawnText(100, 130)).toBe("Showing the first 100 of 130 runs that were chosen: no more are drawn at once.");
});

// Choosing runs evenly, and reading a choice off an address.
import { expect, test } from "vitest";
import { evenly, exampleOf, readRuns, spread, stage, varied, variedIn } from "./choice";

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
  const grid = Array.from({ length: 900 }, (_, index) => ({ index, value: Math.floor(index / 30) }));
  const chosen = spread(grid, 24);
  expect(chosen).toHaveLength(24);
  expect(new Set(chosen.map((i) => i % 30))).toEqual(new Set([15]));
  expect(chosen[0]).toBe(15);
  expect(chosen.at(-1)).toBe(29 * 30 + 15);
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

test("an example of a condition is about what else varies", () => {
  const varies = [{ parameter: "b", min: 1, max: 2 }, { parameter: "width_m", min: 3000, max: 6000 }];
  expect(exampleOf({ varies }, "b")).toBe("4430 <= width_m <= 4580");
  expect(exampleOf({}, "b")).toBe("width_m = 4000");
});

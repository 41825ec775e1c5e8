// Grids stay grids, samples are binned, and no run is lost.
import { expect, test } from "vitest";
import { cells, ends } from "./cells";

test("a grid has a cell for each pair of values, also where runs have no number", () => {
  const x = [1, 1, 2, 2, 3];
  const y = [10, 20, 10, 20, 10];
  const got = cells(x, y, [1, 2, 3, null, 5], false, false);
  expect(got.isGrid).toBe(true);
  expect([got.x, got.y]).toEqual([[1, 2, 3], [10, 20]]);
  expect(got.mean).toEqual([[1, 3, 5], [2, null, null]]);
  expect(got.without).toEqual([[0, 0, 0], [0, 1, 0]]);
});

test("a third parameter is averaged", () => {
  const got = cells([1, 1, 2, 2], [5, 5, 5, 5], [1, 3, 4, 8], false, false);
  expect(got.mean).toEqual([[2, 6]]);
  expect(got.count).toEqual([[2, 2]]);
});

test("a sample is binned, by factors where asked", () => {
  const n = 1000;
  const u = Array.from({ length: n }, (_, i) => (i * 0.618034) % 1);
  const v = Array.from({ length: n }, (_, i) => 10 ** ((i * 0.754878) % 1));
  const got = cells(u, v, u.map((_, i) => (i % 10 === 0 ? null : 7)), false, true);
  expect(got.isGrid).toBe(false);
  expect(got.x.length).toBe(10);
  const total = [...got.count, ...got.without].flat().reduce((a, b) => a + b, 0);
  expect(total).toBe(n);
  expect(got.mean.flat().every((m) => m === 7)).toBe(true);
  const [first = 0, second = 0, third = 0] = got.y;
  expect(third / second).toBeCloseTo(second / first, 8);
});

test("ends leave gaps out", () => {
  expect(ends([[null, 3], [1, null]])).toEqual([1, 3]);
  expect(ends([[null]])).toBeUndefined();
});

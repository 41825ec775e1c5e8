// Ranges to text and back, to rows and to filters.
import { expect, test } from "vitest";
import { filterOf, readRanges, within, writeRanges } from "./brush";

test("what is written can be read", () => {
  const ranges = { width_m: [3000, 4000.25] as [number, number], b: null, x: [-1e-7, 2e9] as [number, number] };
  const text = writeRanges(ranges);
  expect(text).toBe("width_m:3000..4000.25,x:-1e-7..2000000000");
  expect(readRanges(text)).toEqual({ width_m: [3000, 4000.25], x: [-1e-7, 2e9] });
  expect(writeRanges({ b: null })).toBeUndefined();
  expect(readRanges("b:2..1,nonsense,c:a..b")).toEqual({ b: [1, 2] });
  expect(readRanges(undefined)).toEqual({});
});

test("rows lie within all ranges or outside", () => {
  const rows = [[1, 5], [2, null], [3, 6]];
  expect(within(rows, [null, null])).toEqual([true, true, true]);
  expect(within(rows, [[1, 2], null])).toEqual([true, true, false]);
  expect(within(rows, [[1, 3], [5, 6]])).toEqual([true, false, true]);
});

test("the service is told the same", () => {
  expect(filterOf({ width_m: [3000, 4000], b: null })).toBe("3000 <= width_m <= 4000");
  expect(filterOf({ width_m: [3000, 4000] }, 'a = 1 or b = "x"')).toBe('(a = 1 or b = "x") and 3000 <= width_m <= 4000');
  expect(filterOf({}, " a = 1 ")).toBe("a = 1");
  expect(filterOf({}, " ")).toBeUndefined();
});

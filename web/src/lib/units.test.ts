// Speeds by the day or the year; all else as it is stored.
import { expect, test } from "vitest";
import { quotient, scaled, shownIn } from "./units";

test("speeds follow the switch, both ways", () => {
  const perDay = shownIn("m a-1", "m_per_day");
  expect(perDay.unit).toBe("m d-1");
  expect(6000 * perDay.factor).toBeCloseTo(16.4271, 4);
  const perYear = shownIn("m d-1", "m_per_a");
  expect(perYear.unit).toBe("m a-1");
  expect(0.6 * perYear.factor).toBeCloseTo(219.15, 10);
  expect(shownIn("m a-1", "m_per_a")).toEqual({ unit: "m a-1", factor: 1 });
  expect(shownIn("m d-1", "m_per_day")).toEqual({ unit: "m d-1", factor: 1 });
});

test("other units stay", () => {
  for (const unit of ["m", "1", "N m-1", "a-1", "m3 a-1"]) {
    for (const speed of ["m_per_a", "m_per_day"] as const) expect(shownIn(unit, speed)).toEqual({ unit, factor: 1 });
  }
});

test("a number that does not exist is not made one", () => {
  expect(scaled([1, null, 3], 2)).toEqual([2, null, 6]);
});

test.each([
  ["N m-1", "m d-1", "N m-2 d"],
  ["1", "m a-1", "m-1 a"],
  ["m", "m", "1"],
  ["m3", "m", "m2"],
  ["N m-1", "1", "N m-1"],
])("%s over %s is %s", (over, under, expected) => expect(quotient(over, under)).toBe(expected));

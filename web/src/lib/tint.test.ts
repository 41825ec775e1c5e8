// Colours and names of several runs.
import { expect, test } from "vitest";
import { tints } from "./tint";

const melt = { key: "melt_rate_m_per_day", name: "melt rate", unit: "m a-1", factor: 365.25, meaning: "" };

test("few runs are named by the number that tells them apart, in its shown unit", () => {
  const { scale, of } = tints([{ index: 4, value: 1 }, { index: 7, value: 2 }], melt);
  expect(scale).toMatchObject({ min: 365.25, max: 730.5, quiet: true });
  expect(of.get(7)).toEqual({ name: "melt rate 730.5 m a⁻¹", value: 730.5, quiet: false });
});

test("many are read off the scale, and one alone has none", () => {
  const many = Array.from({ length: 12 }, (_, index) => ({ index, value: index }));
  expect(tints(many, melt).of.get(3)?.quiet).toBe(true);
  expect(tints(many.slice(0, 1), melt)).toMatchObject({ scale: undefined });
});

test("runs that do not differ in the number are told apart as runs", () => {
  const { scale, of } = tints([{ index: 0, value: 1 }, { index: 1, value: 1 }], melt);
  expect(scale?.name).toBe("run");
  expect(of.get(1)?.name).toBe("run 1");
});

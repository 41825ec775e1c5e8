// The overlay's layers, units, notes and Python.
import { expect, test } from "vitest";
import type { Dictionary, Fit } from "../api";
import type { Laws } from "../api/analysis";
import { overlay } from "./overlay";

const dictionary = {
  parameters: [{ name: "melt_rate_m_per_day", unit: "m d-1", meaning: "", default: 0.6, min: 0, max: 100 }],
  scalars: [{ name: "force_n_per_m", unit: "N m-1", meaning: "" }],
} as unknown as Dictionary;

const laws = (x: number[], total: number): Laws => ({
  x: "melt_rate_m_per_day", y: "force_n_per_m", model: "power_law", group_by: null, residual_meaning: "", grouping: "one group", shown: x.length, total,
  groups: [
    {
      from: null, to: null, n_runs: total, no_fit: null, left_out: [], also_varies: [],
      fit: { band: { x: [1, 2], y: [3, 4], lower: [], upper: [] } } as unknown as Fit,
      points: { run_index: x.map((_, i) => i), x, y: x.map((v) => 10 * v), fitted: [], residual: [] },
      local_exponent: { x: [], exponent: [] }, no_local_exponent: "there are no two runs of different x",
    },
  ],
});

test("each ensemble has its points and its law", () => {
  const figure = overlay(
    [{ id: "a", name: "one", laws: laws([1, 2], 2) }, { id: "b", name: "two", laws: undefined }, { id: "c", name: "three", laws: laws([0.5], 9) }],
    "melt_rate_m_per_day", "force_n_per_m", "power_law", dictionary, "m_per_a",
  );
  expect(figure.layers.map((l) => [l.kind, l.name])).toEqual([
    ["points", "one"], ["points", "three"], ["curve", "one, law"], ["curve", "three, law"],
  ]);
  expect(figure.x).toEqual({ name: "melt rate", unit: "m a-1", log: true });
  expect(figure.layers[0]).toMatchObject({ x: [365.25, 730.5], python: { x: '[v if v is None else 365.25 * v for v in laws_1["groups"][0]["points"]["x"]]', y: 'laws_1["groups"][0]["points"]["y"]' } });
  expect(Object.keys(figure.data ?? {})).toEqual(["laws_1", "laws_3"]);
  expect(figure.notes).toEqual(["Showing 1 of 9 runs of “three”: a random choice that is always the same. The law uses all."]);
});

test("an axis is logarithmic only where all of it can be", () => {
  const figure = overlay([{ id: "a", name: "one", laws: laws([-1, 2], 2) }], "melt_rate_m_per_day", "force_n_per_m", "power_law", dictionary, "m_per_day");
  expect([figure.x.log, figure.y.log]).toEqual([false, false]);
});

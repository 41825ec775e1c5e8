// Figures of transients: courses, loops with their direction, force against thickness.
import { expect, test } from "vitest";
import type { Curve, Scatter } from "../chart/figure";
import { type Transient, constantOf, courseFigure, from, heads, loopFigure, moves, staticFigure } from "./seasons";

const flat = [1, 1, 1, 1];
const series = {
  time_a: [0, 1, 2, 3], melt_rate_m_per_day: [0.6, 0.8, 0.6, 0.4], calving_rate_m_per_a: [6000, 6000, 6000, 6000],
  force_n_per_m: [4, 3, 4, 5], force_quasi_static_n_per_m: [8, 8, 8, 8], thickness_0_m: [2, 1.9, 2, 2.1],
  length_m: flat, velocity_end_m_per_a: flat, volume_m3: flat, terminus_x_m: flat,
};
const run: Transient = { index: 2, runId: "abc", series, tint: { name: "run 2", quiet: false } };
const q = (key: string, factor = 1) => ({ key, name: key, unit: "1", factor, meaning: "" });
const common = { of: "a sweep", scale: undefined };

test("what is forced moves, what is not does not", () => {
  expect(moves(series, "melt_rate_m_per_day")).toBe(true);
  expect(moves(series, "calving_rate_m_per_a")).toBe(false);
  expect(from(series, 2)).toBe(2);
  expect(from(series, undefined)).toBe(0);
});

test("a course is drawn in its shown unit and read anew by the script", () => {
  const figure = courseFigure([run], q("time_a"), q("melt_rate_m_per_day", 2), common);
  const [curve] = figure.layers as Curve[];
  expect(curve?.y).toEqual([1.2, 1.6, 1.2, 0.8]);
  expect(curve?.python?.y).toBe('[2 * v for v in run_2["series"]["melt_rate_m_per_day"]]');
  expect(figure.data).toEqual({ run_2: "runs/abc" });
});

test("a loop starts at its dot, and over the last period at that period's start", () => {
  const [curve, start] = loopFigure([run], q("melt_rate_m_per_day"), q("force_n_per_m"), 1, common).layers as [Curve, Scatter];
  expect(curve.x).toEqual([0.8, 0.6, 0.4]);
  expect(start.x).toEqual([0.8]);
  expect(curve.python?.x).toBe('run_2["series"]["melt_rate_m_per_day"][1:]');
});

test("arrowheads stand along the way, none on what does not move", () => {
  expect(heads([0, 1, 2, 3, 4], [0, 0, 0, 0, 0], 2)).toEqual([0, 2]);
  expect(heads([1, 1], [2, 2], 3)).toEqual([]);
});

test("the parabola has the runs' own constant", () => {
  expect(constantOf([run])).toBe(2);
  const steady = { name: "melt", path: "p", thickness_m: [3, 1], force: [9, 1] };
  const figure = staticFigure([run], q("thickness_0_m"), q("force_n_per_m"), 2, steady, undefined, common);
  const [parabola, states] = figure.layers as [Curve, Curve];
  expect(parabola.y[0]).toBeCloseTo(2 * (parabola.x[0] ?? 0) ** 2, 12);
  expect(states.x).toEqual([1, 3]);
  expect(states.y).toEqual([1, 9]);
});

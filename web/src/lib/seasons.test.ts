// Figures of transients: courses, loops with their direction, force against thickness.
import { expect, test } from "vitest";
import type { Curve, Scatter } from "../chart/figure";
import { type Transient, constantOf, courseFigure, heads, lagText, loopFigure, moves, repeats, staticFigure, usualForcing, within } from "./seasons";

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
});

test("a course is drawn in its shown unit and read anew by the script", () => {
  const figure = courseFigure([run], q("time_a"), q("melt_rate_m_per_day", 2), common);
  const [curve] = figure.layers as Curve[];
  expect(curve?.y).toEqual([1.2, 1.6, 1.2, 0.8]);
  expect(curve?.python?.y).toBe('[v if v is None else 2 * v for v in run_2["series"]["melt_rate_m_per_day"]]');
  expect(figure.data).toEqual({ run_2: "runs/abc" });
});

test("what runs share is drawn once, and in no run's colour", () => {
  const like = (index: number, force_n_per_m = series.force_n_per_m): Transient =>
    ({ ...run, index, series: { ...series, force_n_per_m }, tint: { name: `run ${index}`, value: index, quiet: false } });
  const scale = { name: "run", unit: "1", min: 2, max: 4, log: false };
  const runs = [like(2), like(3, [9, 9, 9, 8]), like(4)];
  const all = courseFigure(runs, q("time_a"), q("melt_rate_m_per_day"), { ...common, scale });
  expect(all.layers).toMatchObject([{ name: "all 3 runs", color: "ink", quiet: false }]);
  expect(all.scale).toBeUndefined();
  const two = courseFigure(runs, q("time_a"), q("force_n_per_m"), { ...common, scale });
  expect(two.layers.map((layer) => layer.name)).toEqual(["run 2, run 4", "run 3"]);
  expect(two.layers[1]).toMatchObject({ value: 3, y: [9, 9, 9, 8] });
  expect(two.scale).toEqual(scale);
});

test("a loop starts at its dot, and over the last period at that period's start", () => {
  const [curve, start] = loopFigure([run], q("melt_rate_m_per_day"), q("force_n_per_m"), new Map([[2, { from_a: 1, to_a: 2 }]]), common).layers as [Curve, Scatter];
  expect(curve.x).toEqual([0.8, 0.6]);
  expect(start.x).toEqual([0.8]);
  expect(curve.python?.x).toBe('run_2["series"]["melt_rate_m_per_day"][1:3]');
});

test("each run has its own last period; one that has none is not drawn", () => {
  const runs = [run, { ...run, index: 5 }, { ...run, index: 7 }];
  const spans = new Map([[2, { from_a: 0, to_a: 1 }], [5, { from_a: 2, to_a: 3 }]]);
  const { layers } = loopFigure(runs, q("melt_rate_m_per_day"), q("force_n_per_m"), spans, common);
  expect(layers.flatMap((layer) => (layer.kind === "curve" ? [[layer.id, layer.x]] : []))).toEqual([[2, [0.6, 0.8]], [5, [0.6, 0.4]]]);
  expect(within(series, { from_a: 1, to_a: 3 })).toEqual([1, 4]);
  expect(within(series, { from_a: 4, to_a: 5 })).toBeUndefined();
  expect(within(series, { from_a: 1.2, to_a: 1.8 })).toBeUndefined();
});

test("loops are drawn against what repeats", () => {
  const forcing = { melt_rate_m_per_day: { table: {} }, calving_rate_m_per_a: { sinusoid: {} } };
  expect(usualForcing(["melt_rate_m_per_day", "calving_rate_m_per_a"], forcing)).toBe("calving_rate_m_per_a");
  expect(usualForcing(["melt_rate_m_per_day", "calving_rate_m_per_a"], {})).toBe("melt_rate_m_per_day");
  expect(usualForcing(["calving_rate_m_per_a", "melt_rate_m_per_day"], { melt_rate_m_per_day: { table: {} } })).toBe("melt_rate_m_per_day");
  expect(usualForcing([], forcing)).toBeUndefined();
  expect(repeats({ pulse: {} })).toBe(true);
  expect(repeats(6000)).toBe(false);
});

test("a lag is after, or before", () => {
  expect(lagText(0.2034)).toBe("0.203 a (74 d)");
  expect(lagText(-0.06714412)).toBe("0.0671 a (25 d) before");
  expect(lagText(-0.06714412, 2.25)).toBe("0.0671 a (25 d) before 2.250 a");
  expect(lagText(0.2034, 1.75)).toBe("0.203 a (74 d) after 1.750 a");
  expect(lagText(null, null)).toBe("–");
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

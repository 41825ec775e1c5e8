// Figures of profiles: what is drawn, where, and how it is named.
import { expect, test } from "vitest";
import type { Area, Curve } from "../chart/figure";
import { type Common, type Drawn, acrossFigure, outline, readChi, roundEnd, scaleOf, speedFigure, thicknessFigure } from "./profiles";

const profile = {
  node_x_m: [0, 1000, 2000],
  cell_x_m: [500, 1500],
  thickness_m: [100, 60],
  velocity_m_per_a: [365.25, 730.5, 1095.75],
  fluidity_per_a: [1, 2],
  mu_w: [0.3, 0.4, 0.5],
};
const transect = { chi: 0.5, x_m: 1000, width_m: 4000, mu_w: 0.4, y_m: [0, 1000, 2000], velocity_m_per_a: [0, 30, 40], fluidity_per_a: [1, 1, 0] };
const run: Drawn = {
  id: 3, name: "run 3", profile, transects: [transect], glacier_m: 600, quiet: false, dashed: false, python: 'profiles["items"][0]',
};
const common: Common = { of: "melt", scale: undefined, speed: "m_per_day", data: {}, notes: [], onPoint: () => undefined };

test("speeds are drawn in the unit at the switch, distances in km", () => {
  const [curve] = speedFigure([run], common).layers as Curve[];
  expect(curve?.x).toEqual([0, 1, 2]);
  expect(curve?.y.map((v) => Number(v?.toFixed(9)))).toEqual([1, 2, 3]);
  expect(curve?.python?.x).toBe('[v if v is None else 0.001 * v for v in profiles["items"][0]["profile"]["node_x_m"]]');
});

test("the outline goes along the surface and back along the base", () => {
  const { x, y } = outline(profile);
  expect(x).toEqual([0, 0.5, 1.5, 2, 2, 1.5, 0.5, 0]);
  expect((y[0] ?? 0) - (y[7] ?? 0)).toBeCloseTo(120, 9);
  expect((y[3] ?? 0) - (y[4] ?? 0)).toBeCloseTo(40, 9);
});

test("a glacier much deeper than the mélange is cut, and that is said", () => {
  const figure = thicknessFigure([run], common);
  const glacier = figure.layers.find((l) => l.kind === "area" && l.name.startsWith("glacier")) as Area;
  expect((glacier.upper[0] ?? 0) - (glacier.lower[0] ?? 0)).toBeCloseTo(600, 9);
  expect(figure.y.min).toBeLessThan(-107);
  expect(figure.notes?.[0]).toContain("535 m below sea level");
  expect(thicknessFigure([{ ...run, glacier_m: 130 }], common).y.min).toBeUndefined();
});

test("the speed across is mirrored at the centre line", () => {
  const [curve] = acrossFigure([run], common).layers as Curve[];
  expect(curve?.x).toEqual([-2, -1, 0, -0, 1, 2]);
  expect(acrossFigure([run], common).title).toContain("χ = 0.5");
  const several = acrossFigure([{ ...run, transects: [transect, { ...transect, chi: 1 }] }], common);
  expect(several.layers.map((l) => l.name)).toEqual(["χ = 0.5", "χ = 1"]);
  expect(several.scale?.max).toBe(1);
});

test("a scale is logarithmic over decades, and leaves few values to the legend", () => {
  expect(scaleOf("b", "1", [1e4, 1e6, null], 1)).toEqual({ name: "b", unit: "1", min: 1e4, max: 1e6, log: true });
  expect(scaleOf("b", "1", [1, 2], 8)?.quiet).toBe(true);
  expect(scaleOf("b", "1", [2, 2], 8)).toBeUndefined();
});

test("places along the mélange are read off a text", () => {
  expect(readChi("0.1, 0.5 1;2,x,-1,0.5")).toEqual([0.1, 0.5, 1]);
});

test("an axis ends where a tick stands, not far past the data", () => {
  for (const length of [0.3, 1, 2.2, 4.7, 5.86, 7, 9.99, 12.05, 15.06, 23, 41, 99, 160]) {
    const end = roundEnd(length);
    expect(end).toBeGreaterThanOrEqual(length);
    expect(end).toBeLessThan(1.35 * length);
  }
  expect(roundEnd(12.05)).toBe(14);
});

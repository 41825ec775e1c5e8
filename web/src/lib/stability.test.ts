// Branches: where they are solid, dashed and broken, and what is marked on them.
import { expect, test } from "vitest";
import type { Branch, CurveRow } from "../../generated/schema";
import type { Curve } from "../chart/figure";
import { branchFigure, foldFigure, growth, isHopf, pieces, wantsLog } from "./stability";

const point = (arclength: number, stable: boolean, more: Partial<CurveRow> = {}): CurveRow => ({
  kind: "point", arclength, stable, control_value: arclength, thickness_0_m: 10 * arclength, has_jumped: false, ...more,
});
const fold = (arclength: number, more: Partial<CurveRow> = {}): CurveRow => ({
  kind: "fold", arclength, control_value: arclength, thickness_0_m: 10 * arclength, has_jumped: false, ...more,
});

test("pieces meet at a fold", () => {
  const rows = [point(0, true), point(1, true), fold(1.5), point(2, false), point(3, false)];
  expect(pieces(rows)).toEqual([{ from: 0, to: 2, isStable: true }, { from: 2, to: 4, isStable: false }]);
});

test("a change of stability without a fold counts the stretch between as unstable", () => {
  expect(pieces([point(0, true), point(1, true), point(2, false), point(3, true)])).toEqual([
    { from: 0, to: 1, isStable: true }, { from: 1, to: 3, isStable: false },
  ]);
});

test("there is a gap where another discrete root takes over", () => {
  const rows = [point(0, true), point(1, true), point(2, true, { has_jumped: true }), point(3, true)];
  expect(pieces(rows)).toEqual([{ from: 0, to: 1, isStable: true }, { from: 2, to: 3, isStable: true }]);
});

test("one point alone is still drawn", () => {
  expect(pieces([point(0, true)])).toEqual([{ from: 0, to: 0, isStable: true }]);
  expect(pieces([])).toEqual([]);
});

const q = (key: string, factor = 1) => ({ key, name: key, unit: "1", factor, meaning: "" });

test("a branch's figure has its pieces, folds and what is looked at", () => {
  const branch: Branch = {
    control: "melt", unit: "m d-1", roots: [], ends: [],
    points: [point(0, true), point(1, true), point(2, false), point(3, false)],
    folds: [fold(1.5)],
    crossings: [{ kind: "crossing", arclengths: [2, 3], bracket: [2, 3], growth_rate_im_per_a: [4, 5] }],
  };
  const figure = branchFigure([{ index: 5, runId: "x", branch, tint: { name: "run 5", quiet: false } }], q("melt", 2), q("thickness_0_m"), {
    of: "a sweep", scale: undefined, at: { run: 5, row: 4 }, isLog: undefined, onPoint: () => undefined,
  });
  const curves = figure.layers.filter((l): l is Curve => l.kind === "curve");
  expect(curves.map((c) => [c.name, c.line, c.x])).toEqual([["stable", "solid", [0, 2, 3]], ["unstable", "dashed", [3, 4, 6]]]);
  const named = figure.layers.filter((l) => l.kind === "points" && !l.quiet);
  expect(named.map((l) => [l.name, l.x])).toEqual([
    ["fold", [3]], ["oscillations begin to grow (Hopf)", [5]], ["end", [0, 6]], ["looked at", [6]],
  ]);
  expect(isHopf(branch.crossings[0] as CurveRow)).toBe(true);
});

test("beyond a fold that is a maximum there is nothing above", () => {
  const folds = {
    control: "melt", unit: "m d-1", second: "width", second_unit: "m", ends: [],
    points: [fold(0, { second_value: 4000, control_value: 0.6, is_maximum: true }), fold(0, { second_value: 7000, control_value: 0.4, is_maximum: true })],
  };
  const figure = foldFigure([{ index: 0, runId: "x", folds, tint: { name: "run 0", quiet: false } }], q("width"), q("melt"), { of: "s", scale: undefined, onPoint: () => undefined });
  expect(figure.layers[0]).toMatchObject({ kind: "area", name: "steady states", upper: [0.6, 0.4] });
});

test("growth rates are told in words", () => {
  expect(growth(-0.5, 0)).toBe("decays e-fold in 2 a");
  expect(growth(36.525, 0)).toBe("grows e-fold in 10 d");
  expect(growth(-36.525, 2 * Math.PI)).toBe("decays e-fold in 10 d, swings in 1 a");
  expect(growth(-2e-8, 0)).toBe("neither grows nor decays");
});

test("a number that spans a decade is drawn logarithmically", () => {
  const run = (points: CurveRow[]) => [{ index: 0, runId: "x", tint: { name: "", quiet: true }, branch: { points, folds: [], crossings: [], roots: [], ends: [] } }];
  expect(wantsLog(run([point(1, true), point(20, true)]), "thickness_0_m")).toBe(true);
  expect(wantsLog(run([point(1, true), point(2, true)]), "thickness_0_m")).toBe(false);
  expect(wantsLog(run([point(0, true), point(2, true)]), "thickness_0_m")).toBe(false);
});

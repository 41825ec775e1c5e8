// Local exponents where some groups have none, and why.
import { expect, test } from "vitest";
import type { LawGroup, Laws } from "../api/analysis";
import { type LawView, hasLocal, localFigure, whyNoLocal } from "./lawfigures";
import type { Quantity } from "./quantities";

const quantity = (key: string, name: string, unit: string): Quantity => ({ key, name, unit, factor: 1, meaning: "" });
const width = quantity("width_m", "width", "m");

const group = (at: number, x: number[], why: string | null): LawGroup => ({
  from: at, to: at, n_runs: 3, fit: null, no_fit: "few", left_out: [], also_varies: ["b"],
  points: { run_index: [], x: [], y: [], fitted: [], residual: [] },
  local_exponent: { x, exponent: x.map(() => -3.5) }, no_local_exponent: why,
});
const laws = (groups: LawGroup[]): Laws => ({
  x: "melt_rate_m_per_day", y: "force_n_per_m", model: "power_law", group_by: "width_m", groups,
  residual_meaning: "", grouping: "each value", shown: 0, total: 6,
});
const view = (of: Laws): LawView => ({
  ensemble: "one", x: quantity("melt_rate_m_per_day", "melt rate", "m d-1"), y: quantity("force_n_per_m", "force", "N m-1"),
  group: width, isLogX: true, isLogY: true, laws: of, path: "laws", onPoint: () => undefined,
});

test("groups without a local exponent are not drawn, and the service says why", () => {
  const some = laws([group(3000, [0.5, 0.6], null), group(4000, [], "no two agree in b")]);
  expect(hasLocal(some)).toBe(true);
  const figure = localFigure(view(some));
  expect(figure.layers.map((layer) => layer.kind)).toEqual(["curve", "points"]);
  expect(figure.notes?.at(-1)).toMatch(/^4.?000 m: no two agree in b\.$/);
  expect(figure.notes).toContain("It is taken between runs that agree in all else, and is their mean.");
  const none = laws([group(3000, [], "no two agree in b"), group(4000, [], "no two agree in b")]);
  expect(hasLocal(none)).toBe(false);
  expect(whyNoLocal(none, width)).toEqual(["No two agree in b."]);
});

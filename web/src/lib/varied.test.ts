// Which parameters vary, and on which axes.
import { expect, test } from "vitest";
import { areWide, isLogarithmic, variedOf } from "./varied";

test("what the service tells counts, the melt rate first", () => {
  const varies = [{ parameter: "b", min: 1, max: 2 }, { parameter: "d_m", min: 1, max: 2 }, { parameter: "melt_rate_m_per_day", min: 1, max: 2 }];
  expect(variedOf({ spec: {}, varies }).map((v) => v.parameter)).toEqual(["melt_rate_m_per_day", "b", "d_m"]);
});

test("an older sweep is read by its document", () => {
  const spec = {
    axes: [
      { zip: [{ parameter: "width_m", linspace: [3000, 6000, 4] }, { parameter: "b", values: [1e4] }] },
      { parameter: "melt_rate_m_per_day", logspace: [0.5, 1, 9] },
    ],
  } as never;
  expect(variedOf({ spec, varies: [] })).toEqual([
    { parameter: "melt_rate_m_per_day", min: 0.5, max: 1 },
    { parameter: "width_m", min: 3000, max: 6000 },
  ]);
  const sample = { sample: { method: "sobol", n: 8, ranges: { b: { log: [5000, 50_000] }, mu_s: [0.2, 0.4] } } } as never;
  const [b, mu] = variedOf({ spec: sample });
  expect([b?.parameter, b?.max, mu?.min]).toEqual(["b", 50_000, 0.2]);
});

test("axes follow how values are spread", () => {
  const spec = { sample: { ranges: { b: { log: [5000, 50_000] }, mu_s: [0.2, 0.4] } } } as never;
  expect(isLogarithmic(spec, { parameter: "b", min: 5000, max: 50_000 })).toBe(true);
  expect(isLogarithmic(spec, { parameter: "mu_s", min: 0.2, max: 0.4 })).toBe(false);
  expect(isLogarithmic(spec, { parameter: "A", min: 0.01, max: 0.4 })).toBe(true);
  expect(areWide([1, null, 30])).toBe(true);
  expect(areWide([0, 30])).toBe(false);
});

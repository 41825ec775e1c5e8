// Laws in other units: against a fit made anew in those units.
import { expect, test } from "vitest";
import type { Fit, Law } from "../api";
import { consequence, formula, shownLaw } from "./law";

const T = 2.3;

/** Least squares with the service's meaning of the intervals. */
function fit(model: Law, xs: number[], ys: number[]): Fit {
  const isPower = model === "power_law";
  const us = isPower ? xs.map(Math.log) : xs;
  const vs = model === "linear" ? ys : ys.map(Math.log);
  const back = model === "linear" ? (v: number) => v : Math.exp;
  const n = us.length;
  const mean = (a: number[]): number => a.reduce((s, v) => s + v, 0) / n;
  const [mu, mv] = [mean(us), mean(vs)];
  const sxx = us.reduce((s, u) => s + (u - mu) ** 2, 0);
  const slope = us.reduce((s, u, i) => s + (u - mu) * ((vs[i] ?? 0) - mv), 0) / sxx;
  const at = (u: number): number => mv + slope * (u - mu);
  const s2 = us.reduce((s, u, i) => s + ((vs[i] ?? 0) - at(u)) ** 2, 0) / (n - 2);
  const half = (u: number): number => T * Math.sqrt(s2 * (1 / n + (u - mu) ** 2 / sxx));
  const se = Math.sqrt(s2 / sxx);
  return {
    model,
    exponent: { estimate: slope, standard_error: se, ci95: [slope - T * se, slope + T * se] },
    prefactor: { estimate: back(at(0)), standard_error: 0, ci95: [back(at(0) - half(0)), back(at(0) + half(0))] },
    r_squared: 0,
    n_used: n,
    left_out: [],
    interval_meaning: "",
    band: { x: xs, y: us.map((u) => back(at(u))), lower: us.map((u) => back(at(u) - half(u))), upper: us.map((u) => back(at(u) + half(u))) },
  };
}

const xs = [0.5, 0.6, 0.7, 0.85, 1];
const ys = [1.4e7, 8.3e6, 4.9e6, 2.9e6, 1.6e6];
const units = { x: { unit: "m a-1", factor: 365.25 }, y: { unit: "N m-1", factor: 1 } };

test.each<Law>(["power_law", "exponential", "linear"])("%s: converted as if fitted in those units", (model) => {
  const y = { unit: "m d-1", factor: 0.01 };
  const got = shownLaw(fit(model, xs, ys), units.x, y);
  const anew = fit(model, xs.map((v) => v * 365.25), ys.map((v) => v * 0.01));
  const close = (a: number, b: number | undefined): void => expect(a / (b ?? NaN)).toBeCloseTo(1, 8);
  close(got.exponent.estimate, anew.exponent.estimate);
  close(got.exponent.low, anew.exponent.ci95[0]);
  close(got.exponent.high, anew.exponent.ci95[1]);
  close(got.prefactor.estimate, anew.prefactor.estimate);
  close(got.prefactor.low, anew.prefactor.ci95[0]);
  close(got.prefactor.high, anew.prefactor.ci95[1]);
});

test("as stored nothing changes", () => {
  const stored = fit("power_law", xs, ys);
  const got = shownLaw(stored, { unit: "m d-1", factor: 1 }, units.y);
  expect([got.prefactor.low, got.prefactor.high]).toEqual(stored.prefactor.ci95);
  expect(got.exponent.estimate).toBe(stored.exponent.estimate);
});

test("formulas have units that fit", () => {
  const law = { exponent: { estimate: -3.152, low: -4, high: -3 }, prefactor: { estimate: 1.6e6, low: 1, high: 2 } };
  const text = ({ before, number, after }: ReturnType<typeof formula>): string => `${before}|${number}|${after}`;
  expect(text(formula("power_law", "melt rate", "force", units, law))).toBe("force ≈ 1.600 × 10⁶ N m⁻¹ · (melt rate / 1 m a⁻¹)|−3.152|");
  expect(text(formula("exponential", "melt rate", "force", units, law))).toBe("force ≈ 1.600 × 10⁶ N m⁻¹ · exp(|−3.152| m⁻¹ a · melt rate)");
  expect(text(formula("linear", "melt rate", "force", units, law))).toBe("force ≈ 1.600 × 10⁶ N m⁻¹ + (|−3.152| N m⁻² a) · melt rate");
  expect(consequence("power_law", "melt rate", "force", units, law)).toBe("With 10 % more melt rate, force is 25.9 % less.");
});

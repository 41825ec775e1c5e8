// Derivatives read off a result, ranked; runs spread evenly.
import { expect, test } from "vitest";
import { localOf, ranked, spread } from "./local";

const outcome = {
  sensitivities: [
    { quantity: "force_n_per_m", unit: "N m-1", value: 1, log_by_b: 0.5, by_b: 9, log_by_width_m: -4, log_by_width_gradient: null, log_by_A: 0 },
    { quantity: "length_m", unit: "m", value: 1, log_by_b: 7, log_by_width_m: 1, log_by_A: 0, log_by_mu_s: 0.1 },
  ],
} as never;

test("derivatives by parameter", () => {
  const [force] = localOf(outcome);
  expect(force).toEqual({ quantity: "force_n_per_m", by: { b: 0.5, width_m: -4, width_gradient: null, A: 0 } });
  expect(localOf({} as never)).toEqual([]);
});

test("the strongest first, the missing left out", () => {
  expect(ranked(localOf(outcome), "force_n_per_m")).toEqual(["width_m", "b", "mu_s"]);
});

test("both ends stay", () => {
  expect(spread([1, 2, 3], 5)).toEqual([1, 2, 3]);
  expect(spread(Array.from({ length: 101 }, (_, i) => i), 5)).toEqual([0, 25, 50, 75, 100]);
});

// Comparing ensembles: what matches, what is the same, and how far apart the rest lies.
import { expect, test } from "vitest";
import { compare, differences, exponentOf, rows, shared } from "./comparison";

const run = (run_id: string, melt: number, force: number | null) => ({
  run_id,
  regime: "steady",
  upstream_closure: "published",
  melt,
  force,
});

test("runs match by their parameters, whatever their order", () => {
  const first = [run("a", 0.5, 4), run("b", 0.6, 2), run("c", 0.7, null)];
  const second = [run("c", 0.7, null), run("x", 0.6, 2.5), run("a", 0.5, 4)];
  expect(compare(first, second, ["melt"], "force")).toEqual({ matched: 3, same: 2, largest: 0.2 });
});

test("what has other parameters or no force tells no difference", () => {
  expect(compare([run("a", 0.5, 4)], [run("b", 0.51, 4)], ["melt"], "force")).toEqual({
    matched: 0,
    same: 0,
    largest: null,
  });
  expect(compare([run("a", 0.5, null)], [run("b", 0.5, 4)], ["melt"], "force").largest).toBeNull();
  expect(compare([run("a", 0.5, 0)], [run("b", 0.5, 0)], ["melt"], "force").largest).toBe(0);
});

const ENTRIES = [
  { name: "melt_rate_m_per_day", unit: "m d-1", default: 0.6 },
  { name: "width_m", unit: "m", default: 4000 },
  { name: "b", unit: "1", default: 1e4 },
];
const melt = { doc: { regime: "steady", axes: [{ parameter: "melt_rate_m_per_day", linspace: [0.5, 1, 5] }] }, more: { varies: [] } };
const wide = { doc: { regime: "steady", parameters: { width_m: 5000, b: 1e4 }, fjord: { x_m: [0] } }, more: { varies: [] } };

test("ensembles differ in what varies or is fixed otherwise, defaults included", () => {
  expect(differences([melt, wide], ENTRIES, "m_per_day")).toEqual([
    { name: "melt rate (m d⁻¹)", values: ["0.5 to 1", "0.6"] },
    { name: "fjord width W (m)", values: ["4000", "5000"] },
    { name: "fjord", values: ["–", '{ "x_m": [0] }'] },
  ]);
  expect(differences([melt, melt], ENTRIES, "m_per_day")).toEqual([]);
  expect(shared([melt, wide])).toBe("melt_rate_m_per_day");
  expect(shared([wide])).toBeUndefined();
});

test("columns become rows", () => {
  expect(rows({ columns: { run_index: [0, 1], b: [2, null] }, shown: 2, total: 2, choice: "all" })).toEqual([
    { run_index: 0, b: 2 },
    { run_index: 1, b: null },
  ]);
});

test("exponents follow the units that are shown", () => {
  const [x, y] = [{ unit: "m a-1", factor: 365.25 }, { unit: "m d-1", factor: 1 / 365.25 }];
  expect(exponentOf("power_law", x, y)).toEqual({ name: "Exponent", factor: 1 });
  expect(exponentOf("exponential", x, y)).toEqual({ name: "Rate (per m a⁻¹)", factor: 1 / 365.25 });
  expect(exponentOf("linear", x, y)).toEqual({ name: "Slope (m d⁻¹ per m a⁻¹)", factor: 1 / 365.25 / 365.25 });
});

// The form of a sweep: what it does not touch stays, and what it writes is read again.
import { describe, expect, test } from "vitest";
import { type Axis, about, axesOf, axisJson, axisOf, pointsAlong, pointsOf, rangesOf, respaced, varied, withAxis, withPoints, withRanges } from "./axes";
import { PRESETS } from "./presets";
import { type Doc, type Json, at, isAbout, placeText, put, readSpec, typed, typedList, writeSpec } from "./spec";

const RICH: Doc = {
  name: "all of it",
  tags: ["a", "b"],
  priority: 3,
  regime: "transient",
  parameters: { b: 20000, "an odd name": 1e-7 },
  fjord: { x_m: [0, 5000, 40000], width_m: [4000, 4600, 6000], beyond: "constant" },
  melt_shape: { chi: [0, 0.2, 1], factor: [1.5, 1, 0.8] },
  start: { run: "0123" },
  time: { duration_a: 3, output_every_a: 0.01, profiles_at_a: Array.from({ length: 60 }, (_, i) => i / 20), fixed_dt_a: 0.01 },
  forcing: { melt_rate_m_per_day: { sinusoid: { mean: 0.7, amplitude: 0.2, period_a: 1 } }, d_m: { table: { time_a: [0, 1], value: [20, 30] } } },
  calving_law: "steady_feedback",
  options: { lagged: true, upstream_closure: "no_stretching" },
  axes: [
    { parameter: "width_m", linspace: [3000, 7000, 5] },
    { zip: [{ parameter: "A", values: [1, 2] }, { parameter: "mu_s", values: [0.2, 0.3] }] },
    { option: "upstream_closure", values: ["published", "no_stretching"] },
  ],
  unknown: { to: [null, true, "the \"form\" \u2212 and \\ more"] },
};

describe("text", () => {
  test("a document written and read is the same", () => {
    for (const doc of [RICH, {}, { axes: [] }, ...PRESETS.map((p) => p.doc)]) {
      expect(readSpec(writeSpec(doc)).doc).toEqual(doc);
    }
  });

  test("short lists and objects stand on one line, long lists fill lines", () => {
    const text = writeSpec(RICH);
    expect(text).toContain('  "melt_shape": { "chi": [0, 0.2, 1], "factor": [1.5, 1, 0.8] },\n');
    expect(text.split("\n").every((line) => line.length <= 90)).toBe(true);
    expect(text.split("\n").length).toBeLessThan(75);
    expect(writeSpec({})).toBe("{}");
  });

  test("what is no document is told", () => {
    expect(readSpec("{bad").trouble).toMatch(/not JSON/);
    expect(readSpec('{\n  "a": 1,\n  "b" 2,\n  "a long one, so that the place is told": 3\n}').trouble).toMatch(/^The text is not JSON: it cannot be read from line 3 on\./);
    expect(readSpec("").trouble).toMatch(/^The text is not JSON: it ends too early\./);
    expect([readSpec("{bad").isBroken, readSpec('{"seed": 9007199254740993}').isBroken]).toEqual([true, false]);
    expect(readSpec("[1]").trouble).toMatch(/object/);
    expect(readSpec("null").trouble).toMatch(/object/);
  });

  test("a number that would be changed is left to the text", () => {
    expect(readSpec('{"sample": {"seed": 18446744073709551615}}').trouble).toContain("18446744073709551615");
    expect(readSpec('{"sample": {"seed": 9007199254740993}}').trouble).toContain("9007199254740993");
    expect(readSpec('{"sample": {"seed": 9007199254740992}}').trouble).toBeUndefined();
    expect(readSpec('{"name": "12345678901234567890"}').trouble).toBeUndefined();
    expect(readSpec('{"parameters": {"b": 12345.678901234567890}}').trouble).toBeUndefined();
  });
});

describe("places", () => {
  test("putting what is there changes nothing", () => {
    const walk = (value: Json, path: (string | number)[]): void => {
      if (path.length > 0) expect(put(RICH, path, value)).toEqual(RICH);
      if (Array.isArray(value)) value.forEach((v, i) => walk(v, [...path, i]));
      else if (typeof value === "object" && value !== null) for (const [name, v] of Object.entries(value)) walk(v, [...path, name]);
    };
    walk(RICH, []);
  });

  test("a change leaves everything else, its order too", () => {
    const changed = put(RICH, ["parameters", "b"], 30000);
    expect(Object.keys(changed)).toEqual(Object.keys(RICH));
    expect(at(changed, ["parameters", "b"])).toBe(30000);
    expect(put(changed, ["parameters", "b"], 20000)).toEqual(RICH);
    expect(at(RICH, ["parameters", "b"])).toBe(20000);
  });

  test("what is taken away takes empty objects along", () => {
    expect(put({ options: { sensitivities: true } }, ["options", "sensitivities"], undefined)).toEqual({});
    expect(put({ a: { b: { c: 1 } }, d: 2 }, ["a", "b", "c"], undefined)).toEqual({ d: 2 });
    expect(put({ axes: [1, 2] }, ["axes", 0], undefined)).toEqual({ axes: [2] });
    expect(put({ axes: [1] }, ["axes", 0], undefined)).toEqual({});
    expect(put({}, ["a", "b"], undefined)).toEqual({});
  });

  test("names of JavaScript's own are names like others", () => {
    expect(at({}, ["constructor"])).toBeUndefined();
    expect(at({}, ["parameters", "toString"])).toBeUndefined();
  });

  test("places are named as the service names them", () => {
    expect(placeText(["axes", 0, "linspace"])).toBe("axes[0].linspace");
    expect(isAbout("axes[0].linspace", ["axes", 0])).toBe(true);
    expect(isAbout("axes[10].linspace", ["axes", 1])).toBe(false);
    expect(isAbout("parameters.b", ["parameters", "b"])).toBe(true);
    expect(isAbout("parameters.bb", ["parameters", "b"])).toBe(false);
    expect(isAbout(undefined, ["axes"])).toBe(false);
  });
});

test("numbers as they are typed", () => {
  expect(["1e4", " 0.5 ", "−0.02", ".5", "5.", "+3"].map(typed)).toEqual([1e4, 0.5, -0.02, 0.5, 5, 3]);
  expect(["", "1e", "0x10", "Infinity", "1e999", "1,5", "one"].map(typed)).toEqual(Array(7).fill(undefined));
  expect(typedList("1, 2 3;4")).toEqual([1, 2, 3, 4]);
  expect(typedList("1, two")).toBeUndefined();
  expect(typedList("")).toEqual([]);
});

describe("axes", () => {
  const axes: Axis[] = [
    { kind: "linspace", parameter: "b", from: 1, to: 2, points: 3 },
    { kind: "logspace", parameter: "b", from: 1, to: 100, points: 3 },
    { kind: "values", parameter: "b", values: [1, 2] },
    { kind: "closures", values: ["published"] },
  ];

  test("what is written is read", () => {
    for (const axis of axes) expect(axisOf(axisJson(axis) ?? null)).toEqual(axis);
  });

  test("what the form does not know stays as it is", () => {
    const others: Json[] = [
      { zip: [] }, { parameter: "b" }, { parameter: "b", linspace: [1, 2] }, { parameter: "b", linspace: [1, 2, 3], values: [1] },
      { parameter: "b", values: [1, "two"] }, { option: "other", values: ["x"] }, 3, null, { parameter: 1, values: [2] },
    ];
    for (const other of others) expect(axisOf(other).kind).toBe("other");
    expect(withAxis(RICH, 1, axisOf(at(RICH, ["axes", 1]) ?? null))).toBe(RICH);
    expect(axesOf({ axes: "b" })).toBeUndefined();
    expect(axesOf(RICH)?.[1]).toMatchObject({ kind: "other", together: [{ parameter: "A", points: "1, 2" }, { parameter: "mu_s", points: "0.2, 0.3" }] });
  });

  test("a changed axis leaves the others", () => {
    const first = axesOf(RICH)?.[0];
    expect(first).toEqual({ kind: "linspace", parameter: "width_m", from: 3000, to: 7000, points: 5 });
    const changed = withAxis(RICH, 0, { kind: "values", parameter: "width_m", values: [1, 2] });
    expect(at(changed, ["axes", 1])).toEqual(at(RICH, ["axes", 1]));
    expect(at(changed, ["axes", 0])).toEqual({ parameter: "width_m", values: [1, 2] });
  });

  test("other spacing keeps the range", () => {
    const [lin, log, values] = axes as [Axis, Axis, Axis];
    expect(respaced(lin, "values")).toEqual({ kind: "values", parameter: "b", values: [1, 1.5, 2] });
    expect(respaced(log, "values")).toEqual({ kind: "values", parameter: "b", values: [1, 10, 100] });
    expect(respaced(values, "logspace")).toEqual({ kind: "logspace", parameter: "b", from: 1, to: 2, points: 2 });
    expect(respaced(lin, "logspace")).toEqual({ ...lin, kind: "logspace" });
    expect(axes.map(pointsAlong)).toEqual([3, 3, 2, 1]);
  });
});

describe("samples", () => {
  const ranges = [{ parameter: "b", isLog: true, from: 1e4, to: 1e6 }, { parameter: "d_m", isLog: false, from: 10, to: 50 }];
  const doc: Doc = { sample: { method: "saltelli", n: 256, seed: 1, ranges: { b: { log: [1e4, 1e6] }, d_m: [10, 50] } } };

  test("ranges are read and written", () => {
    expect(rangesOf(doc)).toEqual(ranges);
    expect(withRanges(doc, ranges)).toEqual(doc);
    expect(rangesOf({ sample: { ranges: { b: "wide" } } })).toBeUndefined();
    expect(rangesOf({ sample: { ranges: { b: { log: [1, 2], more: 1 } } } })).toBeUndefined();
  });

  test("points become a sample and back", () => {
    const first = { parameter: "width_m", isLog: false, from: 1, to: 2 };
    const grid: Doc = { parameters: { A: 1 }, axes: [{ parameter: "b", logspace: [1e4, 1e6, 7] }], fjord: { x_m: [] } };
    const sample = withPoints(grid, "sample", first);
    expect(pointsOf(sample)).toBe("sample");
    expect(rangesOf(sample)).toEqual([ranges[0]]);
    expect(sample["fjord"]).toEqual({ x_m: [] });
    const back = withPoints(sample, "axes", first);
    expect(axesOf(back)).toEqual([{ kind: "logspace", parameter: "b", from: 1e4, to: 1e6, points: 51 }]);
    expect(withPoints(back, "one", first)).toEqual({ parameters: { A: 1 }, fjord: { x_m: [] } });
    expect(withPoints({ parameters: { width_m: 5, A: 1 } }, "axes", first)).toEqual({
      parameters: { A: 1 },
      axes: [{ parameter: "width_m", linspace: [1, 2, 51] }],
    });
  });

  test("what the points set is known for every form of them", () => {
    expect(varied(RICH)).toEqual(["width_m", "A", "mu_s"]);
    expect(varied(doc)).toEqual(["b", "d_m"]);
    expect(varied({ table: { columns: ["b", "upstream_closure"], rows: [] } })).toEqual(["b"]);
    expect(pointsOf({ axes: [], sample: {} })).toBe("mixed");
    expect(pointsOf({})).toBe("one");
  });

  test("an ordinary range lies within what is permitted", () => {
    expect(about(4000, 10, 1e6)).toEqual([3000, 5000]);
    expect(about(0, -1, 1)).toEqual([-0.02, 0.02]);
    expect(about(0, 0, 1e6)).toEqual([0, 1e5]);
    expect(about(10, 9, 11)).toEqual([9, 11]);
  });
});

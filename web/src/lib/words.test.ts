// Sizes, times, counts, filters of buttons, and ensembles in words.
import { expect, test } from "vitest";
import type { Counts } from "../api";
import { design, fixedFacts, plain, rangeFacts, ranges } from "./about";
import { hasTerm, marked, quoted, terms, toggled } from "./finding";
import { ageText, bytesText, durationText, neverSolved, outcomes, outcomesText, several } from "./words";

test("bytes and durations have two or three digits", () => {
  expect([0, 999, 1000, 12_345_678, 999_600_000, 3e12].map(bytesText)).toEqual(["0 B", "999 B", "1.0 kB", "12 MB", "1.0 GB", "3.0 TB"]);
  expect([0.2, 5, 100, 7200, 90_000, 400_000, 4e6].map(durationText)).toEqual([
    "less than a second", "5 s", "2 min", "2.0 h", "25 h", "4.6 days", "46 days",
  ]);
});

test("ages are told in words, also where clocks differ", () => {
  const now = Date.parse("2026-11-22T12:00:00Z");
  const ago = (seconds: number): string => ageText(new Date(now - seconds * 1000).toISOString(), now);
  expect([-30, 5, 90, 3 * 3600 + 5, 26 * 3600, 5 * 86_400, 100 * 86_400, 900 * 86_400].map(ago)).toEqual([
    "just now", "just now", "1 min ago", "3 h ago", "yesterday", "5 days ago", "3 months ago", "2 years ago",
  ]);
});

test("outcomes leave out what there is none of", () => {
  const none: Counts = {
    total: 0, queued: 0, running: 0, converged: 0, completed: 0, collapsed: 0, no_steady_state: 0, no_fold: 0, overthick: 0,
    fjord_closed: 0, failed: 0, cancelled: 0,
  };
  const counts = { ...none, total: 95_500, converged: 95_488, no_steady_state: 10, failed: 2 };
  expect(outcomes(counts).map((o) => o.kind)).toEqual(["solved", "verdict", "failed"]);
  expect(outcomesText(counts)).toBe("95,488 converged, 10 no steady state, 2 failed");
  expect([several(1, "run"), several(1200, "run")]).toEqual(["1 run", "1,200 runs"]);
});

test("a button's term goes in and comes out again", () => {
  const term = `tag = ${quoted('a "b" and c')}`;
  const both = toggled("total > 3", term);
  expect(both).toBe('total > 3 and tag = "a ""b"" and c"');
  expect(hasTerm(both, term)).toBe(true);
  expect(toggled(both, term)).toBe("total > 3");
  expect(toggled("", term)).toBe(term);
  expect(toggled(term, term)).toBe("");
});

test("an or stays together", () => {
  expect(toggled('a = 1 or b = "x and y"', "failed > 0")).toBe('(a = 1 or b = "x and y") and failed > 0');
  expect(terms('(a = 1 and b = 2) AND c ~ "and" and not d = 3')).toEqual(["(a = 1 and b = 2)", 'c ~ "and"', "not d = 3"]);
  expect(toggled("(a = 1 or b = 2)", "failed > 0")).toBe("(a = 1 or b = 2) and failed > 0");
});

test("a refused filter is marked where it is refused, or behind its end", () => {
  expect(marked("a𝒳c", 2)).toEqual(["a", "𝒳", "c"]);
  expect(marked("ab", 3)).toEqual(["ab", " ", ""]);
});

const ENTRIES = [
  { name: "melt_rate_m_per_day", unit: "m d-1", default: 0.6 },
  { name: "b", unit: "1", default: 1e4 },
  { name: "width_m", unit: "m", default: 4000 },
];

test("an ensemble in words", () => {
  const doc = {
    regime: "steady", parameters: { b: 2e4, width_m: 4000 }, length_m: 12000, melt_shape: "u_shaped",
    axes: [{ parameter: "melt_rate_m_per_day", linspace: [0.5, 1, 51] }, { parameter: "d_m", values: [10, 5] }],
  };
  const list = ranges(doc, { varies: [] });
  expect(list).toEqual([{ parameter: "melt_rate_m_per_day", min: 0.5, max: 1 }, { parameter: "d_m", min: 5, max: 10 }]);
  expect(rangeFacts(list, ENTRIES, "m_per_day")[0]).toEqual({ name: "melt rate (m d⁻¹)", value: "0.5 to 1" });
  expect(rangeFacts(list, ENTRIES, "m_per_a")[0]?.value).toBe("182.63 to 365.25");
  expect(fixedFacts(doc, ENTRIES, "m_per_day")).toEqual([
    { name: "b", value: "20000" },
    { name: "length L", value: "12000 m" },
    { name: "melt shape", value: "u shaped" },
  ]);
  expect(design(doc)).toBe("a grid of 2 axes");
  expect(ranges(doc, { varies: [{ parameter: "b", min: 1, max: 2 }] })).toEqual([{ parameter: "b", min: 1, max: 2 }]);
  expect([plain(-0.02), plain(1e7), plain(0)]).toEqual(["−0.02", "1.00 × 10⁷", "0"]);
});

test("what a cancelled ensemble left is said", () => {
  expect(neverSolved(86, 100)).toBe("86 of 100 runs were never solved: the ensemble was cancelled.");
  expect(neverSolved(1, 1)).toBe("1 of 1 run was never solved: the ensemble was cancelled.");
});

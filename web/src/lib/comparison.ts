// Ensembles beside each other: in what they differ, which of their runs are the same, and how far those with equal
// parameters lie apart.
import type { Law, Run, Sweep } from "../api";
import type { Columns } from "../api/analysis";
import { plain, ranges, summary } from "./about";
import { label, unitText } from "./numbers";
import { type Doc, isObject } from "./spec";
import { type Speed, shownIn } from "./units";

export interface Comparison {
  /** Runs of the first with a run of the second that has equal parameters. */
  matched: number;
  /** Of these, how many are the same run: solved once, or bit by bit the same question. */
  same: number;
  /** Largest relative difference of the force of matched runs; null if none has two forces. */
  largest: number | null;
}

/** Compares runs by parameters; the force tells how far they lie apart. */
export function compare(
  first: Run[],
  second: Run[],
  parameters: string[],
  force: string,
): Comparison {
  const key = (run: Run): string =>
    JSON.stringify([run["regime"], run["upstream_closure"], ...parameters.map((p) => run[p])]);
  const others = new Map(second.map((run) => [key(run), run]));
  let matched = 0;
  let same = 0;
  let largest: number | null = null;
  for (const run of first) {
    const other = others.get(key(run));
    if (!other) continue;
    matched += 1;
    if (run["run_id"] === other["run_id"]) same += 1;
    const [a, b] = [run[force], other[force]];
    if (typeof a !== "number" || typeof b !== "number") continue;
    const scale = Math.max(Math.abs(a), Math.abs(b));
    const difference = scale === 0 ? 0 : Math.abs(a - b) / scale;
    largest = Math.max(largest ?? 0, difference);
  }
  return { matched, same, largest };
}

/** Runs as rows, from their columns. */
export function rows({ columns }: Columns): Run[] {
  const entries = Object.entries(columns);
  const n = entries[0]?.[1].length ?? 0;
  return Array.from({ length: n }, (_, i) => Object.fromEntries(entries.map(([name, values]) => [name, values[i] ?? null])));
}

/** An ensemble as it is compared. */
export interface Compared {
  doc: Doc;
  more: Pick<Sweep, "varies">;
}

interface Known {
  name: string;
  unit: string;
  default: number;
}

/** A row of what ensembles differ in: a text for each of them. */
export interface Difference {
  name: string;
  values: string[];
}

/** In which parameters and other members ensembles differ. */
export function differences(ensembles: Compared[], entries: Known[], speed: Speed): Difference[] {
  const varying = ensembles.map(({ doc, more }) => new Map(ranges(doc, more).map((r) => [r.parameter, r])));
  const given = ensembles.map(({ doc }) => (isObject(doc["parameters"]) ? doc["parameters"] : {}));
  const names = [...new Set([...entries.map((e) => e.name), ...given.flatMap(Object.keys), ...varying.flatMap((v) => [...v.keys()])])];
  const parameters = names.map((name): Difference => {
    const entry = entries.find((e) => e.name === name);
    const { unit, factor } = shownIn(entry?.unit ?? "1", speed);
    const text = (value: number): string => plain(value * factor);
    const values = ensembles.map((_, i) => {
      const range = varying[i]?.get(name);
      if (range) return range.min === null || range.max === null ? "varies" : `${text(range.min)} to ${text(range.max)}`;
      const value = given[i]?.[name] ?? entry?.default;
      return typeof value === "number" ? text(value) : "–";
    });
    return { name: label({ name, unit }, name), values };
  });
  const members = [...new Set(ensembles.flatMap(({ doc }) => Object.keys(doc)))].filter((name) => !OWN_ROWS.has(name));
  const others = members.map((name): Difference => ({
    name: name.replaceAll("_", " "),
    values: ensembles.map(({ doc }) => (doc[name] === undefined ? "–" : summary(name, doc[name]))),
  }));
  return [...parameters, ...others].filter(({ values }) => new Set(values).size > 1);
}

/** Members that have rows of their own, or that say nothing of the runs. */
const OWN_ROWS = new Set(["name", "tags", "priority", "force", "regime", "parameters", "axes", "sample", "table"]);

/** What a law's exponent is called, and what it is multiplied by where axes are shown in other units. */
export function exponentOf(model: Law, x: { unit: string; factor: number }, y: { unit: string; factor: number }): { name: string; factor: number } {
  const per = unitText(x.unit);
  switch (model) {
    case "power_law":
      return { name: "Exponent", factor: 1 };
    case "exponential":
      return { name: per ? `Rate (per ${per})` : "Rate", factor: 1 / x.factor };
    case "linear": {
      const units = [unitText(y.unit), per && `per ${per}`].filter((t) => t !== "").join(" ");
      return { name: units ? `Slope (${units})` : "Slope", factor: y.factor / x.factor };
    }
  }
}

/** The parameter that most of them vary. */
export function shared(ensembles: Compared[]): string | undefined {
  const counts = new Map<string, number>();
  for (const { doc, more } of ensembles) {
    for (const { parameter } of ranges(doc, more)) counts.set(parameter, (counts.get(parameter) ?? 0) + 1);
  }
  return [...counts].sort((a, b) => b[1] - a[1])[0]?.[0];
}

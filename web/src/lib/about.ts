// What an ensemble is, in words: which parameters vary and over what, what is fixed to something else than its
// default, and what else its document says.
import type { Sweep } from "../api";
import { axesOf, rangesOf, varied } from "./axes";
import { label, show, unitText, words_of } from "./numbers";
import { type Doc, type Json, at, isObject, oneLineOf } from "./spec";
import { type Speed, shownIn } from "./units";

interface Known {
  name: string;
  unit: string;
  default?: number;
}

export interface Fact {
  name: string;
  value: string;
}

export interface VariedRange {
  parameter: string;
  min: number | null;
  max: number | null;
}

/** Parameters that vary, with their ranges: as the service knows them, or else as the document says. */
export function ranges(doc: Doc, more: Pick<Sweep, "varies">): VariedRange[] {
  if (more.varies.length > 0) return more.varies;
  const known = new Map<string, [number, number]>();
  for (const axis of axesOf(doc) ?? []) {
    if (axis.kind === "values") known.set(axis.parameter, [Math.min(...axis.values), Math.max(...axis.values)]);
    if (axis.kind === "linspace" || axis.kind === "logspace") known.set(axis.parameter, [axis.from, axis.to]);
  }
  for (const range of rangesOf(doc) ?? []) known.set(range.parameter, [range.from, range.to]);
  return varied(doc).map((parameter) => {
    const [min, max] = known.get(parameter) ?? [null, null];
    return { parameter, min, max };
  });
}

/** A quantity with its unit, speeds as they are shown. */
export function quantity(value: number | null, unit: string, speed: Speed): string {
  const shown = shownIn(unit, speed);
  const text = unitText(shown.unit);
  return value === null ? "–" : `${plain(value * shown.factor)}${text ? ` ${text}` : ""}`;
}

/** A number that somebody wrote: as short as it is. */
export function plain(value: number): string {
  const size = Math.abs(value);
  if (value !== 0 && (size >= 1e6 || size < 1e-3)) return show(value, 3);
  return String(Number(value.toPrecision(5))).replace("-", "−");
}

/** The ranges in words: "melt rate from 0.5 to 1 m d⁻¹". */
export function rangeFacts(list: VariedRange[], entries: Known[], speed: Speed): Fact[] {
  return list.map(({ parameter, min, max }) => {
    const entry = entries.find((e) => e.name === parameter);
    const shown = shownIn(entry?.unit ?? "1", speed);
    const name = label(entry && { ...entry, unit: shown.unit }, parameter);
    if (min === null || max === null) return { name, value: "varies" };
    return { name, value: `${plain(min * shown.factor)} to ${plain(max * shown.factor)}` };
  });
}

/** Members of a document that have a place of their own. */
const ELSEWHERE = new Set(["name", "tags", "priority", "regime", "parameters", "axes", "sample", "table", "force"]);

/** What is fixed, but for parameters at their default. */
export function fixedFacts(doc: Doc, entries: Known[], speed: Speed): Fact[] {
  const parameters = isObject(doc["parameters"]) ? doc["parameters"] : {};
  const given = Object.entries(parameters).flatMap(([name, value]): Fact[] => {
    const entry = entries.find((e) => e.name === name);
    if (typeof value !== "number" || value === entry?.default) return [];
    return [{ name: words_of(name), value: quantity(value, entry?.unit ?? unitOf(name), speed) }];
  });
  const others = Object.entries(doc).flatMap(([name, value]): Fact[] =>
    ELSEWHERE.has(name) ? [] : [{ name: words_of(name), value: summary(name, value) }],
  );
  return [...given, ...others];
}

/** The unit that a name ends in, where no dictionary tells it. */
function unitOf(name: string): string {
  if (name.endsWith("_m2_per_a")) return "m2 a-1";
  if (name.endsWith("_m3")) return "m3";
  return name.endsWith("_m") ? "m" : "1";
}

/** A member of a document in a few words. */
export function summary(name: string, value: Json): string {
  if (typeof value === "number") return quantity(value, unitOf(name), "m_per_a");
  if (typeof value === "string") return value.replaceAll("_", " ");
  if (name === "forcing" && isObject(value)) {
    return Object.entries(value).map(([of, course]) => `${words_of(of)}: ${isObject(course) ? Object.keys(course).join() : ""}`).join("; ");
  }
  const text = oneLineOf(value);
  return text.length > 90 ? `${text.slice(0, 88)} …` : text;
}

/** How the points were chosen: "a grid of 12 × 7", "1,024 points of a Sobol sequence". */
export function design(doc: Doc): string {
  if (doc["table"] !== undefined) return "a table of points";
  const method = at(doc, ["sample", "method"]);
  if (typeof method === "string") return `a sample: ${method.replaceAll("_", " ")}`;
  const axes = doc["axes"];
  if (!Array.isArray(axes) || axes.length === 0) return "one run";
  return axes.length === 1 ? "one axis" : `a grid of ${axes.length} axes`;
}

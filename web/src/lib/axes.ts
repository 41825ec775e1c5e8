// The points of a sweep as a form shows them: axes and samples, each read from the document and written back to it.
import { type Doc, type Json, at, isObject, oneLineOf, put } from "./spec";

export type Spacing = "linspace" | "logspace";

/** An axis as the form knows it; `other` is shown and left as it is. */
export type Axis =
  | { kind: Spacing; parameter: string; from: number; to: number; points: number }
  | { kind: "values"; parameter: string; values: number[] }
  | { kind: "closures"; values: string[] }
  /** `together`: parameters that move together, each with its points in words. */
  | { kind: "other"; text: string; together?: { parameter: string; points: string }[] };

/** Where a sweep's points come from. */
export type Points = "one" | "axes" | "sample" | "table" | "mixed";

export function pointsOf(doc: Doc): Points {
  const given = (["axes", "sample", "table"] as const).filter((name) => doc[name] !== undefined && doc[name] !== null);
  return given.length > 1 ? "mixed" : (given[0] ?? "one");
}

/** The axes of a document; undefined where what stands there is no list. */
export function axesOf(doc: Doc): Axis[] | undefined {
  const axes = doc["axes"];
  if (axes === undefined) return [];
  return Array.isArray(axes) ? axes.map(axisOf) : undefined;
}

export function axisOf(value: Json): Axis {
  const text = oneLineOf(value);
  const other: Axis = { kind: "other", text };
  if (isObject(value) && Array.isArray(value["zip"]) && value["zip"].length > 0) {
    const together = value["zip"].map((inner) => inWords(axisOf(inner)));
    if (together.every((axis) => axis !== undefined)) return { kind: "other", text, together };
  }
  if (!isObject(value) || Object.keys(value).length !== 2) return other;
  const { parameter, option, values } = value;
  if (option === "upstream_closure" && isList(values, isText)) return { kind: "closures", values };
  if (!isText(parameter)) return other;
  if (isList(values, isNumber)) return { kind: "values", parameter, values };
  for (const kind of ["linspace", "logspace"] as const) {
    const ends = value[kind];
    if (!isList(ends, isNumber) || ends.length !== 3) continue;
    const [from = 0, to = 0, points = 0] = ends;
    return { kind, parameter, from, to, points };
  }
  return other;
}

/** A parameter's points in words. */
function inWords(axis: Axis): { parameter: string; points: string } | undefined {
  if (axis.kind === "other" || axis.kind === "closures") return undefined;
  const { parameter } = axis;
  if (axis.kind === "values") return { parameter, points: axis.values.join(", ") };
  return { parameter, points: `${axis.from} to ${axis.to}, ${axis.points} points${axis.kind === "logspace" ? ", even in the logarithm" : ""}` };
}

/** An axis as it is written; none for what the form does not know. */
export function axisJson(axis: Axis): Json | undefined {
  switch (axis.kind) {
    case "linspace":
    case "logspace":
      return { parameter: axis.parameter, [axis.kind]: [axis.from, axis.to, axis.points] };
    case "values":
      return { parameter: axis.parameter, values: axis.values };
    case "closures":
      return { option: "upstream_closure", values: axis.values };
    case "other":
      return undefined;
  }
}

/** The document with one axis changed. */
export function withAxis(doc: Doc, index: number, axis: Axis): Doc {
  const json = axisJson(axis);
  return json === undefined ? doc : put(doc, ["axes", index], json);
}

/** An axis with other spacing, over the same range. */
export function respaced(axis: Axis, kind: Spacing | "values"): Axis {
  if (axis.kind === "closures" || axis.kind === "other" || axis.kind === kind) return axis;
  const { parameter } = axis;
  if (kind === "values") return { kind, parameter, values: axis.kind === "values" ? axis.values : sparse(axis) };
  if (axis.kind !== "values") return { ...axis, kind };
  const { values } = axis;
  const [from, to] = [Math.min(...values), Math.max(...values)];
  const isEmpty = values.length === 0;
  return { kind, parameter, from: isEmpty ? 0 : from, to: isEmpty ? 1 : to, points: Math.max(2, values.length) };
}

/** Most values that are written out when an axis becomes a list. */
const LISTED = 200;

function sparse(axis: Extract<Axis, { kind: Spacing }>): number[] {
  const points = Math.min(LISTED, Math.max(1, Math.round(axis.points)));
  const isLog = axis.kind === "logspace" && axis.from > 0 && axis.to > 0;
  const [low, high] = isLog ? [Math.log(axis.from), Math.log(axis.to)] : [axis.from, axis.to];
  return Array.from({ length: points }, (_, i) => {
    if (i === 0) return axis.from;
    if (i === points - 1) return axis.to;
    const place = low + ((high - low) * i) / (points - 1);
    return Number((isLog ? Math.exp(place) : place).toPrecision(10));
  });
}

/** Points of an axis; none for what the form does not know. */
export function pointsAlong(axis: Axis): number | undefined {
  switch (axis.kind) {
    case "linspace":
    case "logspace":
      return axis.points;
    case "values":
    case "closures":
      return axis.values.length;
    case "other":
      return undefined;
  }
}

/** A range that a sample draws from. */
export interface Range {
  parameter: string;
  isLog: boolean;
  from: number;
  to: number;
}

/** The ranges of a sample; undefined where one of them is written in a way the form does not know. */
export function rangesOf(doc: Doc): Range[] | undefined {
  const ranges = at(doc, ["sample", "ranges"]);
  if (ranges === undefined) return [];
  if (!isObject(ranges)) return undefined;
  const read = Object.entries(ranges).map(([parameter, value]): Range | undefined => {
    const isLog = isObject(value) && Object.keys(value).length === 1 && "log" in value;
    const ends = isLog ? value["log"] : value;
    if (!isList(ends, isNumber) || ends.length !== 2) return undefined;
    const [from = 0, to = 0] = ends;
    return { parameter, isLog, from, to };
  });
  return read.every((range) => range !== undefined) ? read : undefined;
}

/** The document with these ranges. */
export function withRanges(doc: Doc, ranges: Range[]): Doc {
  const written = ranges.map(({ parameter, isLog, from, to }): [string, Json] => [
    parameter,
    isLog ? { log: [from, to] } : [from, to],
  ]);
  const sample = isObject(doc["sample"]) ? doc["sample"] : {};
  return { ...doc, sample: { ...sample, ranges: Object.fromEntries(written) } };
}

/** Parameters that the points set. */
export function varied(doc: Doc): string[] {
  const names: string[] = [];
  const add = (value: Json | undefined): void => {
    if (!isObject(value)) return;
    if (isText(value["parameter"])) names.push(value["parameter"]);
    if (Array.isArray(value["zip"])) value["zip"].forEach(add);
  };
  if (Array.isArray(doc["axes"])) doc["axes"].forEach(add);
  const ranges = at(doc, ["sample", "ranges"]);
  if (isObject(ranges)) names.push(...Object.keys(ranges));
  const columns = at(doc, ["table", "columns"]);
  if (isList(columns, isText)) names.push(...columns.filter((name) => name !== "upstream_closure"));
  return [...new Set(names)];
}

/** An ordinary range about a value, within what is permitted. */
export function about(value: number, min: number, max: number): [number, number] {
  if (value === 0 && min < 0) return [Math.max(min, -0.02), Math.min(max, 0.02)];
  if (value === 0) return [min, Math.min(max, 1e5)];
  const [low, high] = [0.75 * value, 1.25 * value].map((v) => Number(v.toPrecision(3)));
  return [Math.max(min, low ?? min), Math.min(max, high ?? max)];
}

/**
 * The document with its points from somewhere else. What it had in another form is taken over where it can be;
 * parameters that the points set are no longer given beside them.
 */
export function withPoints(doc: Doc, wanted: "one" | "axes" | "sample", first: Range): Doc {
  const ranges = pointsOf(doc) === "sample" ? (rangesOf(doc) ?? []) : (axesOf(doc) ?? []).flatMap(rangeOf);
  const taken = ranges.length > 0 ? ranges : [first];
  const bare = ["axes", "sample", "table"].reduce((d, name) => put(d, [name], undefined), doc);
  if (wanted === "one") return bare;
  const alone = taken.reduce((d, range) => put(d, ["parameters", range.parameter], undefined), bare);
  if (wanted === "sample") {
    return withRanges({ ...alone, sample: { method: "sobol", n: 256, seed: 1, ranges: {} } }, taken);
  }
  const points = taken.length === 1 ? 51 : taken.length === 2 ? 11 : 5;
  const axes = taken.map(({ parameter, isLog, from, to }): Json => ({ parameter, [isLog ? "logspace" : "linspace"]: [from, to, points] }));
  return { ...alone, axes };
}

function rangeOf(axis: Axis): Range[] {
  if (axis.kind === "closures" || axis.kind === "other") return [];
  const { parameter } = axis;
  if (axis.kind === "values") {
    if (axis.values.length < 2) return [];
    return [{ parameter, isLog: false, from: Math.min(...axis.values), to: Math.max(...axis.values) }];
  }
  return [{ parameter, isLog: axis.kind === "logspace", from: axis.from, to: axis.to }];
}

const isText = (value: Json | undefined): value is string => typeof value === "string";
const isNumber = (value: Json | undefined): value is number => typeof value === "number";
const isList = <T extends Json>(value: Json | undefined, is: (item: Json) => item is T): value is T[] =>
  Array.isArray(value) && value.every(is);

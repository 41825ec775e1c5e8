// A sweep's document and the form that edits it. The text is the truth: the form reads members out of it and puts
// single members back, so that what it does not show stays as it is.

export type Json = null | boolean | number | string | Json[] | { [name: string]: Json };
export type Doc = { [name: string]: Json };
/** Where a member stands: `["axes", 0, "linspace"]`. */
export type Path = (string | number)[];

/** What a text says. */
export type Reading =
  | { doc: Doc; trouble?: undefined; isBroken?: undefined }
  /** Broken is what the service could not read either. */
  | { doc?: undefined; trouble: string; isBroken: boolean };

/** Reads a text as a sweep's document; what cannot be kept exactly is not read. */
export function readSpec(text: string): Reading {
  let value: Json;
  try {
    value = JSON.parse(text) as Json;
  } catch (error) {
    return { trouble: whyBroken(text, error instanceof Error ? error.message : ""), isBroken: true };
  }
  if (!isObject(value)) return { trouble: "A sweep is a JSON object: { … }.", isBroken: true };
  const long = inexact(text);
  if (long !== undefined) return { trouble: `The form cannot keep the number ${long} exactly; edit the text.`, isBroken: false };
  return { doc: value };
}

/** What browsers tell in their own ways, as one sentence: where a text ceases to be JSON. */
function whyBroken(text: string, message: string): string {
  const [, line] = /line (\d+)/.exec(message) ?? [];
  const [, position] = /position (\d+)/.exec(message) ?? [];
  const at = line ?? (position === undefined ? undefined : String(text.slice(0, Number(position)).split("\n").length));
  if (at !== undefined) return `The text is not JSON: it cannot be read from line ${at} on. A comma, a quote or a bracket may be missing or too many.`;
  const isShort = /end of/.test(message);
  return `The text is not JSON${isShort ? ": it ends too early" : ""}. A comma, a quote or a bracket may be missing or too many.`;
}

/** A whole number with more digits than a number of this page has, such as a large seed. */
function inexact(text: string): string | undefined {
  const outside = text.replace(/"(?:[^"\\]|\\.)*"/g, '""');
  return outside.match(/(?<![\d.eE])-?\d{16,}(?![\d.eE])/g)?.find((digits) => String(BigInt(digits)) !== exact(Number(digits)));
}

const exact = (value: number): string => BigInt(value).toString();

export const isObject = (value: Json | undefined): value is { [name: string]: Json } =>
  typeof value === "object" && value !== null && !Array.isArray(value);

/** Longest list or object that stands on one line. */
const LINE = 58;

/** A document as text: short lists and objects on one line. */
export function writeSpec(value: Json, indent = ""): string {
  const short = oneLineOf(value);
  const isTop = indent === "" && isObject(value);
  if (!isTop && indent.length + short.length <= LINE) return short;
  const deeper = `${indent}  `;
  if (Array.isArray(value) && value.length > 0) {
    // Long lists of numbers fill lines.
    if (value.every((v) => typeof v !== "object" || v === null)) return `[\n${filled(value.map(oneLineOf), deeper)}\n${indent}]`;
    return `[\n${value.map((v) => deeper + writeSpec(v, deeper)).join(",\n")}\n${indent}]`;
  }
  if (isObject(value) && Object.keys(value).length > 0) {
    const members = Object.entries(value).map(([name, v]) => `${deeper}${JSON.stringify(name)}: ${writeSpec(v, deeper)}`);
    return `{\n${members.join(",\n")}\n${indent}}`;
  }
  return short;
}

export function oneLineOf(value: Json): string {
  if (Array.isArray(value)) return `[${value.map(oneLineOf).join(", ")}]`;
  if (!isObject(value)) return JSON.stringify(value);
  const members = Object.entries(value).map(([name, v]) => `${JSON.stringify(name)}: ${oneLineOf(v)}`);
  return members.length > 0 ? `{ ${members.join(", ")} }` : "{}";
}

function filled(items: string[], indent: string): string {
  const lines: string[] = [];
  let line = indent;
  items.forEach((item, i) => {
    const next = i + 1 < items.length ? `${item},` : item;
    if (line !== indent && line.length + 1 + next.length > LINE) {
      lines.push(line);
      line = indent;
    }
    line += line === indent ? next : ` ${next}`;
  });
  return [...lines, line].join("\n");
}

/** What stands at a place. */
export function at(doc: Doc, path: Path): Json | undefined {
  let value: Json | undefined = doc;
  for (const step of path) {
    if (Array.isArray(value)) value = value[step as number];
    else if (isObject(value) && Object.hasOwn(value, step)) value = value[step];
    else return undefined;
  }
  return value;
}

/** The document with something else at a place; undefined takes it away, and objects that this leaves empty. */
export function put(doc: Doc, path: Path, value: Json | undefined): Doc {
  const [step, ...rest] = path;
  if (step === undefined) return doc;
  return (put_(doc, step, rest, value) ?? {}) as Doc;
}

function put_(into: Json | undefined, step: string | number, rest: Path, value: Json | undefined): Json | undefined {
  const inside = (old: Json | undefined): Json | undefined => {
    const [next, ...others] = rest;
    return next === undefined ? value : put_(old, next, others, value);
  };
  if (typeof step === "number") {
    const list = Array.isArray(into) ? [...into] : [];
    const item = inside(list[step]);
    if (item === undefined) list.splice(step, 1);
    else list[step] = item;
    return list.length > 0 ? list : undefined;
  }
  const object: Doc = isObject(into) ? { ...into } : {};
  const member = inside(Object.hasOwn(object, step) ? object[step] : undefined);
  if (member === undefined) Reflect.deleteProperty(object, step);
  else object[step] = member;
  return Object.keys(object).length > 0 ? object : undefined;
}

/** A text, or nothing. */
export const textOf = (value: Json | undefined): string => (typeof value === "string" ? value : "");

/** A place as the service names it in a refusal: `axes[0].linspace`. */
export const placeText = (path: Path): string =>
  path.map((step, i) => (typeof step === "number" ? `[${step}]` : i === 0 ? step : `.${step}`)).join("");

/** Whether a refusal of a field is about what stands at a place: itself, something within it, or all around it. */
export function isAbout(field: string | undefined, path: Path): boolean {
  if (field === undefined) return false;
  const place = placeText(path);
  return field === place || field.startsWith(`${place}.`) || field.startsWith(`${place}[`);
}

/** A number as it is typed; undefined for nothing and for what is none. */
export function typed(text: string): number | undefined {
  const plain = text.trim().replace("−", "-");
  if (!/^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$/.test(plain)) return undefined;
  const value = Number(plain);
  return Number.isFinite(value) ? value : undefined;
}

/** Several numbers with commas or blanks between them; undefined if one is none. */
export function typedList(text: string): number[] | undefined {
  const values = text.split(/[\s,;]+/).filter((part) => part !== "").map(typed);
  return values.every((v) => v !== undefined) ? values : undefined;
}

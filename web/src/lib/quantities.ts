// Quantities by their names in the interface: what they are called, and in which unit the page shows them.
import { unitText, words_of } from "./numbers";
import { type Speed, shownIn } from "./units";

interface Entry {
  name: string;
  unit: string;
  meaning: string;
}

interface Dictionary {
  parameters: Entry[];
  scalars: Entry[];
  provenance?: Entry[];
  controls?: { name: string; unit: string }[];
  series?: Entry[];
}

/** Units where neither dictionary nor name tell one. */
const SERIES: Record<string, string> = { time_a: "a" };

export interface Quantity {
  /** In the interface. */
  key: string;
  /** On the page. */
  name: string;
  /** As it is shown. */
  unit: string;
  /** What a stored number is multiplied by to be shown. */
  factor: number;
  meaning: string;
}

/** A quantity of the dictionary as the page shows it. */
export function quantity(dictionary: Dictionary, key: string, speed: Speed): Quantity {
  const { parameters, scalars, provenance = [], series = [], controls = [] } = dictionary;
  const entry: { unit: string; meaning?: string } | undefined =
    [...parameters, ...scalars, ...provenance, ...series].find((e) => e.name === key) ?? controls.find((e) => e.name === key);
  const { unit, factor } = shownIn(entry?.unit ?? SERIES[key] ?? "1", speed);
  return { key, name: words_of(key), unit, factor, meaning: entry?.meaning ?? "" };
}

/** A stored number with its name and unit, as in "melt rate 0.6 m d⁻¹". */
export function told(q: Quantity, value: number | null | undefined): string {
  if (value === null || value === undefined) return `${q.name} –`;
  const number = Number((value * q.factor).toPrecision(4));
  const size = Math.abs(number);
  const text = size >= 1e6 || (size > 0 && size < 1e-3) ? number.toExponential(3) : String(number);
  return `${q.name} ${text.replace("-", "−")} ${unitText(q.unit)}`.trim();
}

/** A text with a capital, for the beginning of a title. */
export const capital = (text: string): string => text.charAt(0).toUpperCase() + text.slice(1);

/** A Python expression with its numbers multiplied. */
export const timesPython = (expression: string, factor: number): string =>
  factor === 1 ? expression : `[v if v is None else ${factor} * v for v in ${expression}]`;

/** A sentence of the service with the names in it put into words, and their numbers as they are shown. */
export function plain(text: string, dictionary: Dictionary, speed: Speed): string {
  const known = new Set([...dictionary.parameters, ...dictionary.scalars, ...(dictionary.controls ?? [])].map((entry) => entry.name));
  // Names of one word, such as b, may be words of the sentence.
  return text.replace(/\b([a-zA-Z]\w*_\w+)\b(?:( = | reaches its bound )(-?[\d.]+(?:e[+-]?\d+)?(?![\w.])))?/g, (whole, name: string, between?: string, number?: string) => {
    if (!known.has(name)) return whole;
    const q = quantity(dictionary, name, speed);
    if (between === undefined || number === undefined) return q.name;
    return told({ ...q, name: q.name + between.trimEnd() }, Number(number));
  });
}

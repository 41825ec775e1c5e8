// A quantity of the interface as the page shows it: what it is called, and in which unit.
import type { Dictionary } from "../api";
import { quantity as known } from "./quantities";
import type { Shown, Speed } from "./units";

export interface Quantity extends Shown {
  /** As stored. */
  name: string;
  words: string;
}

/** A parameter, a number of the result, or another column of the table of runs. */
export function quantity(dictionary: Dictionary, name: string, speed: Speed): Quantity {
  const { name: words, unit, factor } = known(dictionary, name, speed);
  return { name, words, unit, factor };
}

/** The same with a capital, for the beginning of a title. */
export const capital = (text: string): string => text.charAt(0).toUpperCase() + text.slice(1);

/** A Python expression with its numbers multiplied. */
export const timesPython = (expression: string, factor: number): string =>
  factor === 1 ? expression : `[v if v is None else ${factor} * v for v in ${expression}]`;

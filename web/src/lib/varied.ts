// Which parameters an ensemble varies, and whether they are spread by factors or by steps.
import type { Spec } from "../api";

/** A parameter that differs between runs, with its ends. */
export interface Varied {
  parameter: string;
  min: number;
  max: number;
}

/** An axis of a sweep as its document has it. */
interface Axis {
  parameter?: string;
  linspace?: number[];
  logspace?: number[];
  values?: (number | string)[];
  zip?: Axis[];
}

/** Greatest over least value from which a quantity is drawn on a logarithmic axis. */
const WIDE = 20;
/** What is looked at first, if it varies. */
const FIRST = ["melt_rate_m_per_day", "width_m", "b"];

const axesOf = (spec: Spec): Axis[] => (spec.axes ?? []).flatMap((axis) => ("zip" in axis ? (axis.zip as Axis[]) : [axis as Axis]));

/** Parameters that vary, the ones that are looked at first in front. What the service tells counts; a sweep of which it
 *  knows no ranges is read by its document. */
export function variedOf(sweep: { spec: Spec; varies?: Varied[] }): Varied[] {
  const told = sweep.varies ?? [];
  const found = told.length > 0 ? told : fromSpec(sweep.spec);
  const rank = ({ parameter }: Varied): number => (FIRST.indexOf(parameter) + FIRST.length + 1) % (FIRST.length + 1);
  return [...found].sort((a, b) => rank(a) - rank(b));
}

function fromSpec(spec: Spec): Varied[] {
  const found: Varied[] = [];
  const add = (parameter: string, values: number[]): void => {
    const [min, max] = [values.reduce((a, b) => Math.min(a, b), Infinity), values.reduce((a, b) => Math.max(a, b), -Infinity)];
    if (max > min) found.push({ parameter, min, max });
  };
  for (const axis of axesOf(spec)) {
    const values = axis.linspace?.slice(0, 2) ?? axis.logspace?.slice(0, 2) ?? axis.values ?? [];
    if (axis.parameter !== undefined) add(axis.parameter, values.filter((v) => typeof v === "number"));
  }
  for (const [parameter, range] of Object.entries(ranges(spec))) add(parameter, Array.isArray(range) ? range : (range.log ?? []));
  return found;
}

type Ranges = Record<string, number[] | { log?: number[] }>;
const ranges = (spec: Spec): Ranges => (spec.sample as { ranges?: Ranges } | null | undefined)?.ranges ?? {};

/** Whether a document spreads a parameter by factors. */
function isSpread(spec: Spec, parameter: string): boolean {
  const range = ranges(spec)[parameter];
  const sampled = range !== undefined && !Array.isArray(range) && range.log !== undefined;
  return sampled || axesOf(spec).some((axis) => axis.parameter === parameter && axis.logspace !== undefined);
}

/** Whether a quantity's axis is logarithmic by itself. */
export const isWide = (min: number, max: number): boolean => min > 0 && max / min >= WIDE;

/** The same of values. */
export function areWide(values: (number | null)[]): boolean {
  let [min, max] = [Infinity, -Infinity];
  for (const value of values) {
    if (value === null) continue;
    min = Math.min(min, value);
    max = Math.max(max, value);
  }
  return isWide(min, max);
}

/** Whether a parameter's axis follows its logarithm. */
export function isLogarithmic(spec: Spec, varied: Varied): boolean {
  return varied.min > 0 && (isSpread(spec, varied.parameter) || isWide(varied.min, varied.max));
}

/** Whether the runs are points of a grid rather than of a sample or a table. */
export const isGrid = (spec: Spec): boolean => (spec.axes ?? []).length > 0;

// Colours of several runs by one of their numbers: places on a scale, and names for the legend where they are few.
import type { Scale } from "../chart/figure";
import { scaleOf } from "./profiles";
import { type Quantity, told } from "./quantities";

/** Values that a legend names; more are read off a scale. */
const LEGEND = 8;

export interface Tint {
  name: string;
  /** Place on the scale. */
  value?: number;
  /** Not named in the legend. */
  quiet: boolean;
}

/** Runs by number, and what colours each; without a scale where there is nothing to tell apart. */
export function tints(
  runs: { index: number; value: number | null }[],
  q: Quantity | undefined,
): { scale: Scale | undefined; of: Map<number, Tint> } {
  const shown = (value: number | null): number | null => (value === null || !q ? null : value * q.factor);
  const byQuantity = q && runs.length > 1 ? scaleOf(q.name, q.unit, runs.map((run) => shown(run.value)), LEGEND) : undefined;
  const indices = runs.map((run) => run.index);
  // Several runs that nothing tells apart are told apart by their numbers.
  const scale = byQuantity ?? (runs.length > 1 ? scaleOf("run", "1", indices, LEGEND) : undefined);
  const of = new Map<number, Tint>();
  for (const { index, value } of runs) {
    const place = byQuantity ? shown(value) : index;
    const name = byQuantity && q ? told(q, value) : `run ${index}`;
    of.set(index, { name, quiet: scale !== undefined && !scale.quiet, ...(scale && place !== null ? { value: place } : {}) });
  }
  return { scale, of };
}

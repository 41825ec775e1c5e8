// Which of many runs are drawn, and how a choice stands in an address.

/** The indices that a text such as "3,7,9" names, each once. */
export function readRuns(text: string | undefined): number[] {
  if (text === undefined) return [];
  const indices = text.split(",").map((part) => part.trim()).filter((part) => /^\d+$/.test(part)).map(Number);
  return [...new Set(indices)];
}

/** `count` places among `n`, evenly spread, the ends among them. */
export function evenly(n: number, count: number): number[] {
  if (count >= n) return Array.from({ length: n }, (_, i) => i);
  if (count <= 1) return n > 0 && count === 1 ? [Math.floor(n / 2)] : [];
  return Array.from({ length: count }, (_, i) => Math.round((i * (n - 1)) / (count - 1)));
}

export interface Candidate {
  index: number;
  /** By which runs are spread; null where a run has none. */
  value: number | null;
}

/**
 * Up to `most` runs, evenly spread over their values. Of runs that share a value the middle ones are taken, so that
 * in a grid everything else stays the same; they come by value, then by index.
 */
export function spread(candidates: Candidate[], most: number): number[] {
  const groups = new Map<number | null, number[]>();
  for (const { index, value } of candidates) {
    const group = groups.get(value);
    if (group) group.push(index);
    else groups.set(value, [index]);
  }
  const sorted = [...groups].sort(([a], [b]) => (a ?? Infinity) - (b ?? Infinity)).map(([, group]) => group);
  const each = Math.max(1, Math.floor(most / Math.max(1, sorted.length)));
  return evenly(sorted.length, Math.min(most, sorted.length)).flatMap((place) => {
    const group = (sorted[place] ?? []).toSorted((a, b) => a - b);
    return evenly(group.length, each).map((i) => group[i] ?? 0);
  });
}

/** A number that changes when it is worth asking again: at each run of a few, at each fiftieth of many. */
export function stage(done: number, total: number, isOver: boolean): number {
  return isOver || total <= 50 ? done : Math.floor((50 * done) / total);
}

/** Names of parameters that a sweep's document varies, in its order. */
export function variedIn(spec: unknown): string[] {
  const { axes, sample, table } = (spec ?? {}) as {
    axes?: Axis[] | null;
    sample?: { ranges?: Record<string, unknown> } | null;
    table?: { columns?: string[] } | null;
  };
  const names = [...(axes ?? []).flatMap(ofAxis), ...Object.keys(sample?.ranges ?? {}), ...(table?.columns ?? [])];
  return [...new Set(names)];
}

interface Axis {
  parameter?: string | null;
  zip?: Axis[] | null;
}

function ofAxis(axis: Axis): string[] {
  if (axis.zip) return axis.zip.flatMap(ofAxis);
  return axis.parameter ? [axis.parameter] : [];
}

/** Parameters that vary over a sweep: as the service tells them, or else its document. */
export function varied(sweep: { spec: unknown; varies?: { parameter: string }[] }): string[] {
  const told = (sweep.varies ?? []).map((v) => v.parameter);
  return told.length > 0 ? told : variedIn(sweep.spec);
}

/** A condition that keeps a parameter nearly the same, as an example: the middle twentieth of its range. */
export function exampleOf(sweep: { spec?: unknown; varies?: { parameter: string; min: number; max: number }[] }, but: string): string {
  const one = (sweep.varies ?? []).find((v) => v.parameter !== but);
  if (!one) return "width_m = 4000";
  const [middle, half] = [(one.min + one.max) / 2, (one.max - one.min) / 40];
  const round = (value: number): string => String(Number(value.toPrecision(3)));
  return `${round(middle - half)} <= ${one.parameter} <= ${round(middle + half)}`;
}

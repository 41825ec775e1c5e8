// Two ensembles beside each other: which of their runs are the same, and how far those with equal
// parameters lie apart.

import type { Run } from "./api";

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

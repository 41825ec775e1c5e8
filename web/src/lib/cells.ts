// Runs put into the cells of a map over two quantities: the cells of a grid where the runs form one, else bins.

type Numbers = (number | null)[];

export interface Cells {
  /** Whether the runs form a grid, so that a cell is a value of each quantity. */
  isGrid: boolean;
  /** Centres, rising. */
  x: number[];
  y: number[];
  /** Mean of the runs with a number, row by row of y. */
  mean: Numbers[];
  /** Runs with a number. */
  count: number[][];
  /** Runs without one. */
  without: number[][];
}

/** Most values of a quantity that make a grid. */
const MOST_VALUES = 400;
/** Share of a grid's cells that must have runs. */
const FILLED = 0.3;
/** Runs that a bin should have, and fewest and most bins along a side. */
const [PER_BIN, FEWEST, MOST] = [10, 4, 40];

const distinct = (values: number[]): number[] => [...new Set(values)].sort((a, b) => a - b);

/** Puts runs into cells; logarithmic quantities get bins of equal factors. */
export function cells(x: Numbers, y: Numbers, z: Numbers, isLogX: boolean, isLogY: boolean): Cells {
  const placed = x.flatMap((v, i) => (v === null || y[i] === null || y[i] === undefined ? [] : [{ x: v, y: y[i], z: z[i] ?? null }]));
  const [xs, ys] = [distinct(placed.map((p) => p.x)), distinct(placed.map((p) => p.y))];
  const fits = xs.length <= MOST_VALUES && ys.length <= MOST_VALUES;
  const used = fits ? new Set(placed.map((p) => `${p.x} ${p.y}`)).size : 0;
  const isGrid = fits && used >= FILLED * xs.length * ys.length;
  const side = Math.min(MOST, Math.max(FEWEST, Math.round(Math.sqrt(placed.length / PER_BIN))));
  const columns = isGrid ? ofValues(xs) : bins(xs, side, isLogX);
  const rows = isGrid ? ofValues(ys) : bins(ys, side, isLogY);
  const table = (): number[][] => rows.centres.map(() => columns.centres.map(() => 0));
  const [sum, count, without] = [table(), table(), table()];
  const add = (to: number[][], j: number, i: number, by: number): void => {
    const row = to[j];
    if (row) row[i] = (row[i] ?? 0) + by;
  };
  for (const p of placed) {
    const [i, j] = [columns.of(p.x), rows.of(p.y)];
    add(p.z === null ? without : count, j, i, 1);
    if (p.z !== null) add(sum, j, i, p.z);
  }
  const mean = sum.map((row, j) => row.map((total, i) => (count[j]?.[i] ? total / (count[j][i] ?? 1) : null)));
  return { isGrid, x: columns.centres, y: rows.centres, mean, count, without };
}

interface Classes {
  centres: number[];
  of: (value: number) => number;
}

function ofValues(values: number[]): Classes {
  const places = new Map(values.map((v, i) => [v, i]));
  return { centres: values, of: (v) => places.get(v) ?? 0 };
}

/** Bins of one width, or one factor, between the ends of rising values. */
function bins(values: number[], n: number, isLog: boolean): Classes {
  const logs = isLog && (values[0] ?? 0) > 0;
  const to = logs ? Math.log : (v: number) => v;
  const back = logs ? Math.exp : (v: number) => v;
  const [low, high] = [to(values[0] ?? 0), to(values.at(-1) ?? 1)];
  const width = (high - low) / n || 1;
  return {
    centres: Array.from({ length: n }, (_, i) => back(low + (i + 0.5) * width)),
    of: (v) => Math.min(n - 1, Math.floor((to(v) - low) / width)),
  };
}

/** Least and greatest of the numbers there are. */
export function ends(values: Numbers[]): [number, number] | undefined {
  let [min, max] = [Infinity, -Infinity];
  for (const row of values) {
    for (const value of row) {
      if (value === null) continue;
      min = Math.min(min, value);
      max = Math.max(max, value);
    }
  }
  return min <= max ? [min, max] : undefined;
}

// Transients as figures: numbers over time, loops against the forcing, force against thickness, as in Figs. 7 and 8.
import type { Series } from "../../generated/schema";
import type { Curve, Figure, Layer, Scale } from "../chart/figure";
import type { Quantity } from "./quantities";
import type { Tint } from "./tint";

/** A transient that is drawn. */
export interface Transient {
  index: number;
  runId: string;
  series: Series;
  tint: Tint;
}

export type Column = Exclude<keyof Series, "time_a">;

/** Columns of a series that a parameter forces or a calving law moves. */
export const FORCINGS: Column[] = ["melt_rate_m_per_day", "calving_rate_m_per_a"];
/** Columns that answer. */
export const RESPONSES: Column[] = [
  "force_n_per_m", "force_quasi_static_n_per_m", "thickness_0_m", "length_m", "velocity_end_m_per_a", "volume_m3", "terminus_x_m",
  "melt_rate_m_per_day", "calving_rate_m_per_a",
];

interface Common {
  of: string;
  scale: Scale | undefined;
}

/** What the script calls a run. */
const named = (run: Transient): string => `run_${run.index}`;

/** Whether a column changes at all in a run. */
export const moves = (series: Series, column: Column): boolean => series[column].some((v) => v !== series[column][0]);

/** Rows of a series from a time on; all of them without one. */
export function from(series: Series, time_a: number | undefined): number {
  if (time_a === undefined) return 0;
  const first = series.time_a.findIndex((t) => t >= time_a - 1e-9);
  return Math.max(0, first);
}

function shape(run: Transient): Omit<Curve, "x" | "y" | "python"> {
  const { tint } = run;
  return { kind: "curve", name: tint.name, quiet: tint.quiet, id: run.index, ...(tint.value === undefined ? { color: "force" } : { value: tint.value }) };
}

const times = (values: number[], factor: number): number[] => (factor === 1 ? values : values.map((v) => v * factor));
const column = (run: Transient, q: Quantity, first = 0): string => {
  const list = `${named(run)}["series"]["${q.key}"]${first > 0 ? `[${first}:]` : ""}`;
  return q.factor === 1 ? list : `[${q.factor} * v for v in ${list}]`;
};

function figure(title: string, x: Quantity, y: Quantity, runs: Transient[], layers: Layer[], common: Common): Figure {
  return {
    title: `${title}, ${common.of}`,
    x: { name: x.name, unit: x.unit },
    y: { name: y.name, unit: y.unit },
    layers,
    data: Object.fromEntries(runs.map((run) => [named(run), `runs/${run.runId}`])),
    ...(common.scale ? { scale: common.scale } : {}),
  };
}

const capital = (text: string): string => text.charAt(0).toUpperCase() + text.slice(1);

/** A number over time. */
export function courseFigure(runs: Transient[], time: Quantity, y: Quantity, common: Common, line: "solid" | "dashed" = "solid"): Figure {
  const layers = runs.map((run): Layer => ({
    ...shape(run),
    // One alone needs no name.
    quiet: run.tint.quiet || runs.length === 1,
    line,
    x: run.series.time_a,
    y: times(run.series[y.key as Column], y.factor),
    python: { x: column(run, time), y: column(run, y) },
  }));
  return figure(`${capital(y.name)} over time`, time, y, runs, layers, common);
}

/** One number against another; a dot where it starts, arrowheads the way it goes. */
export function loopFigure(runs: Transient[], x: Quantity, y: Quantity, since: number | undefined, common: Common, arrows = 4): Figure {
  const loops = runs.map((run, i): [Layer, Layer] => {
    const first = from(run.series, since);
    const [xs, ys] = [x, y].map((q) => times(run.series[q.key as Column].slice(first), q.factor));
    const points = { x: xs ?? [], y: ys ?? [] };
    const curve: Layer = {
      ...shape(run), ...points,
      width: 1.6,
      arrows: heads(points.x, points.y, arrows),
      python: { x: column(run, x, first), y: column(run, y, first) },
    };
    const start: Layer = {
      kind: "points", name: "start", quiet: i > 0, size: 9, color: "ink",
      x: points.x.slice(0, 1), y: points.y.slice(0, 1), ids: [run.index],
    };
    return [curve, start];
  });
  const layers = [...loops.map(([curve]) => curve), ...loops.map(([, start]) => start)];
  const title = `${capital(y.name)} against ${x.name}${since === undefined ? "" : " over the last period"}`;
  return figure(title, x, y, runs, layers, common);
}

/** Where arrowheads stand: evenly along the way as it looks, past its start. */
export function heads(x: number[], y: number[], count: number): number[] {
  const extent = (v: number[]): number => v.reduce((a, b) => Math.max(a, b), -Infinity) - v.reduce((a, b) => Math.min(a, b), Infinity) || 1;
  const [wide, high] = [extent(x), extent(y)];
  const way = [0];
  for (let i = 1; i < x.length; i += 1) {
    const step = Math.hypot(((x[i] ?? 0) - (x[i - 1] ?? 0)) / wide, ((y[i] ?? 0) - (y[i - 1] ?? 0)) / high);
    way.push((way.at(-1) ?? 0) + step);
  }
  const total = way.at(-1) ?? 0;
  if (total === 0) return [];
  const places = Array.from({ length: count }, (_, k) => way.findIndex((w) => w >= (total * (k + 0.5)) / count) - 1);
  return [...new Set(places.filter((i) => i >= 0 && i < x.length - 1))];
}

/** Steady states beside transients: thickness at the terminus and force. */
export interface Steady {
  name: string;
  path: string;
  thickness_m: number[];
  force: number[];
}

/** Force against thickness at the terminus, with the quasi-static parabola and steady states. */
export function staticFigure(
  runs: Transient[], thickness: Quantity, force: Quantity, constant: number | undefined, steady: Steady | undefined, since: number | undefined, common: Common,
): Figure {
  const loops = loopFigure(runs, thickness, force, since, common, 1);
  const all = [...runs.flatMap((run) => run.series.thickness_0_m), ...(steady?.thickness_m ?? [])];
  const [low, high] = [0.95 * all.reduce((a, b) => Math.min(a, b), Infinity), 1.05 * all.reduce((a, b) => Math.max(a, b), -Infinity)];
  const x = Array.from({ length: 61 }, (_, i) => low + (i * (high - low)) / 60);
  const parabola: Layer[] = constant === undefined ? [] : [{
    kind: "curve", name: "quasi-static: c·H₀²", color: "quasiStatic", x, y: x.map((h) => constant * h * h),
    python: { x: `np.linspace(${low}, ${high}, 61)`, y: `${constant} * np.linspace(${low}, ${high}, 61) ** 2` },
  }];
  const order = steady ? steady.thickness_m.map((_, i) => i).sort((a, b) => (steady.thickness_m[a] ?? 0) - (steady.thickness_m[b] ?? 0)) : [];
  const states: Layer[] = !steady ? [] : [{
    kind: steady.thickness_m.length <= 200 ? "curve" : "points",
    name: `steady: ${steady.name}`, color: "ink",
    ...(steady.thickness_m.length <= 200 ? { line: "dashed" as const } : { size: 3 }),
    x: order.map((i) => steady.thickness_m[i] ?? null),
    y: order.map((i) => steady.force[i] ?? null),
    python: {
      x: 'sorted(h for h in steady["columns"]["thickness_0_m"] if h is not None)',
      y: '[f for _, f in sorted((h, f) for h, f in zip(steady["columns"]["thickness_0_m"], steady["columns"]["force_n_per_m"]) if h is not None)]',
    },
  }];
  return {
    ...loops,
    title: `Force against thickness at the terminus, ${common.of}`,
    layers: [...parabola, ...states, ...loops.layers],
    data: { ...loops.data, ...(steady ? { steady: steady.path } : {}) },
  };
}

/** c of F/W = c·H₀² as the runs themselves have it, where the dictionary does not tell. */
export function constantOf(runs: Transient[]): number | undefined {
  const series = runs[0]?.series;
  const [force, thickness] = [series?.force_quasi_static_n_per_m[0], series?.thickness_0_m[0]];
  return force !== undefined && thickness ? force / thickness ** 2 : undefined;
}

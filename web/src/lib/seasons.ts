// Transients as figures: numbers over time, loops against the forcing, force against thickness, as in Figs. 7 and 8.
import type { Series } from "../../generated/schema";
import type { Curve, Figure, Layer, Scale } from "../chart/figure";
import { show } from "./numbers";
import { type Quantity, capital, timesPython } from "./quantities";
import type { Tint } from "./tint";
import { scaled } from "./units";

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

/** A stretch of time, as a run's own last whole period. */
export interface Span {
  from_a: number;
  to_a: number;
}

/** Rows of a series within a stretch of time: the first, and the one past the last; none if it has none there. */
export function within(series: Series, { from_a, to_a }: Span): [number, number] | undefined {
  const first = series.time_a.findIndex((t) => t >= from_a - 1e-9);
  const last = series.time_a.findLastIndex((t) => t <= to_a + 1e-9);
  return first < 0 || last < first ? undefined : [first, last + 1];
}

/** Whether a forcing of a sweep's document comes again and again. */
export const repeats = (forcing: unknown): boolean =>
  typeof forcing === "object" && forcing !== null && ("sinusoid" in forcing || "pulse" in forcing);

/** What the loops are drawn against if nothing is asked for: what repeats, or else what is forced, or else what moves. */
export function usualForcing(moving: Column[], forcing: Record<string, unknown>): Column | undefined {
  return moving.find((name) => repeats(forcing[name])) ?? moving.find((name) => name in forcing) ?? moving[0];
}

const DAYS = 365.25;

/** A lag in words, after or before the time that it is counted from; a negative one is before. */
export function lagText(years: number | null | undefined, since_a?: number | null): string {
  if (years == null) return "–";
  const size = Math.abs(years);
  const side = years < 0 ? " before" : since_a == null ? "" : " after";
  return `${show(size, 3)} a (${Math.round(size * DAYS)} d)${side}${since_a == null ? "" : ` ${show(since_a, 4)} a`}`;
}

function shape(run: Transient): Omit<Curve, "x" | "y" | "python"> {
  const { tint } = run;
  return { kind: "curve", name: tint.name, quiet: tint.quiet, id: run.index, ...(tint.value === undefined ? { color: "force" } : { value: tint.value }) };
}

const column = (run: Transient, q: Quantity, [first, end]: [number, number] = [0, Infinity]): string => {
  const isAll = first === 0 && end >= run.series.time_a.length;
  const list = `${named(run)}["series"]["${q.key}"]${isAll ? "" : `[${first}:${end}]`}`;
  return timesPython(list, q.factor);
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

/** Runs whose numbers over time are the same: one curve would hide the other. */
function alike(runs: Transient[], of: Column): Transient[][] {
  const groups = new Map<string, Transient[]>();
  for (const run of runs) {
    const course = JSON.stringify([run.series.time_a, run.series[of]]);
    groups.set(course, [...(groups.get(course) ?? []), run]);
  }
  return [...groups.values()];
}

/** A number over time; what several runs share is drawn once, in no run's colour. */
export function courseFigure(runs: Transient[], time: Quantity, y: Quantity, common: Common, line: "solid" | "dashed" = "solid"): Figure {
  const layers = alike(runs, y.key as Column).flatMap((group): Layer[] => {
    const [run] = group;
    if (!run) return [];
    const shared = group.length === runs.length ? `all ${runs.length} runs` : group.map(({ tint }) => tint.name).join(", ");
    return [{
      ...(group.length > 1 ? { kind: "curve", name: shared, color: "ink" } : shape(run)),
      // One alone needs no name.
      quiet: group.length === 1 && (run.tint.quiet || runs.length === 1),
      line,
      x: run.series.time_a,
      y: scaled(run.series[y.key as Column], y.factor),
      python: { x: column(run, time), y: column(run, y) },
    }];
  });
  const isShared = runs.length > 1 && layers.length === 1;
  return figure(`${capital(y.name)} over time`, time, y, runs, layers, isShared ? { ...common, scale: undefined } : common);
}

/** Stretches of time by run; without them the whole of each run. */
export type Spans = Map<number, Span> | undefined;

/**
 * One number against another; a dot where it starts, arrowheads the way it goes. Of stretches of time each run's own
 * is drawn, and nothing of a run that has none.
 */
export function loopFigure(runs: Transient[], x: Quantity, y: Quantity, spans: Spans, common: Common, arrows = 4): Figure {
  const parts = runs.flatMap((run): { run: Transient; rows: [number, number] }[] => {
    const span = spans?.get(run.index);
    const rows: [number, number] | undefined = spans ? span && within(run.series, span) : [0, run.series.time_a.length];
    return rows ? [{ run, rows }] : [];
  });
  const loops = parts.map(({ run, rows }, i): [Layer, Layer] => {
    const [xs, ys] = [x, y].map((q) => scaled(run.series[q.key as Column].slice(...rows), q.factor));
    const points = { x: xs ?? [], y: ys ?? [] };
    const curve: Layer = {
      ...shape(run), ...points,
      width: 1.6,
      arrows: heads(points.x, points.y, arrows),
      python: { x: column(run, x, rows), y: column(run, y, rows) },
    };
    const start: Layer = {
      kind: "points", name: "start", quiet: i > 0, size: 9, color: "ink",
      x: points.x.slice(0, 1), y: points.y.slice(0, 1), ids: [run.index],
    };
    return [curve, start];
  });
  const layers = [...loops.map(([curve]) => curve), ...loops.map(([, start]) => start)];
  const title = `${capital(y.name)} against ${x.name}${spans ? " over the last period" : ""}`;
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
  runs: Transient[], thickness: Quantity, force: Quantity, constant: number | undefined, steady: Steady | undefined, spans: Spans, common: Common,
): Figure {
  const loops = loopFigure(runs, thickness, force, spans, common, 1);
  const all = [...loops.layers.flatMap((layer) => (layer.kind === "curve" ? layer.x : [])).filter((h) => h !== null), ...(steady?.thickness_m ?? [])];
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

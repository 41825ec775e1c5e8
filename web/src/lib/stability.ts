// Branches of steady states as figures: stable and unstable pieces, folds, changes of stability, ends; and curves of
// folds over two parameters.
import type { Branch, CurveRow, Folds } from "../../generated/schema";
import type { Figure, Layer, Scale, Scatter } from "../chart/figure";
import { type Quantity, timesPython } from "./quantities";
import type { Tint } from "./tint";

/** What a branch may be drawn against its parameter. */
export const HEIGHTS = ["thickness_0_m", "length_m", "force_n_per_m", "force_quasi_static_n_per_m", "volume_m3", "velocity_end_m_per_a"] as const;
export type Height = (typeof HEIGHTS)[number];

export interface BranchRun {
  index: number;
  runId: string;
  branch: Branch;
  tint: Tint;
}

/** A run of rows of one stability, `to` included. */
export interface Piece {
  from: number;
  to: number;
  isStable: boolean;
}

/** Points and folds as they follow each other along the branch. */
export const along = (branch: Branch): CurveRow[] =>
  [...branch.points, ...branch.folds].sort((a, b) => (a.arclength ?? 0) - (b.arclength ?? 0));

/**
 * Where a branch is stable and where not. Pieces meet at folds; where stability changes between two points, the
 * stretch between them counts as unstable; where the branch goes over to another discrete root, there is a gap.
 */
export function pieces(rows: CurveRow[]): Piece[] {
  const found: Piece[] = [];
  let from = 0;
  let isStable: boolean | undefined;
  const close = (to: number): void => {
    if (to > from || rows.length === 1) found.push({ from, to, isStable: isStable ?? true });
  };
  rows.forEach((row, i) => {
    const own = row.kind === "fold" ? undefined : (row.stable ?? isStable);
    if (i > 0 && row.has_jumped) {
      close(i - 1);
      [from, isStable] = [i, own];
    } else if (row.kind === "fold") {
      close(i);
      [from, isStable] = [i, undefined];
    } else if (isStable !== undefined && own !== undefined && own !== isStable) {
      const last = own ? i : i - 1;
      close(last);
      [from, isStable] = [last, own];
    } else {
      isStable ??= own;
    }
  });
  close(rows.length - 1);
  return found;
}

export interface Common {
  of: string;
  scale: Scale | undefined;
  /** The point that is looked at. */
  at: { run: number; row: number } | undefined;
  /** Whether y is drawn logarithmically; as its range asks if not given. */
  isLog: boolean | undefined;
  onPoint: (id: number | string) => void;
}

/** Whether perturbations oscillate where they begin to grow. */
export const isHopf = (crossing: CurveRow): boolean => (crossing.growth_rate_im_per_a ?? []).some((im) => Math.abs(im) > 1e-9);

/** Branches against their parameter. */
export function branchFigure(runs: BranchRun[], x: Quantity, y: Quantity, common: Common): Figure {
  const height = y.key as Height;
  const at = (row: CurveRow): [number | null, number | null] => {
    const [control, value] = [row.control_value, row[height]];
    return [control === undefined ? null : control * x.factor, value === undefined ? null : value * y.factor];
  };
  const points = (name: string, rows: CurveRow[], more: Partial<Scatter> = {}): Layer[] =>
    rows.length === 0 ? [] : [{ kind: "points", name, x: rows.map((r) => at(r)[0]), y: rows.map((r) => at(r)[1]), color: "ink", ...more }];
  const own = (run: BranchRun) => (run.tint.value === undefined ? { color: "force" as const } : { value: run.tint.value });
  const several = runs.length > 1;
  const curves: Layer[] = [];
  const dots: Layer[] = [];
  for (const run of runs) {
    const rows = along(run.branch);
    const all = `sorted(run_${run.index}["branch"]["points"] + run_${run.index}["branch"]["folds"], key=lambda r: r["arclength"])`;
    const parts = pieces(rows);
    const [firstStable, firstUnstable] = [parts.findIndex((p) => p.isStable), parts.findIndex((p) => !p.isStable)];
    parts.forEach(({ from, to, isStable }, i) => {
      const shown = rows.slice(from, to + 1);
      const slice = (name: string): string => `[r.get("${name}") for r in ${all}[${from}:${to + 1}]]`;
      curves.push({
        kind: "curve",
        name: several ? run.tint.name + (isStable ? "" : ", unstable") : isStable ? "stable" : "unstable",
        // One entry for each run, or for each stability of a single one.
        quiet: several ? run.tint.quiet || i !== (firstStable >= 0 ? firstStable : 0) : i !== (isStable ? firstStable : firstUnstable),
        line: isStable ? "solid" : "dashed",
        id: run.index,
        x: shown.map((r) => at(r)[0]),
        y: shown.map((r) => at(r)[1]),
        ...own(run),
        python: { x: timesPython(slice("control_value"), x.factor), y: timesPython(slice(height), y.factor) },
      });
    });
    const kept = rows.map((row, k) => ({ row, k })).filter(({ row }) => row.kind !== "fold");
    dots.push(...points(`points of ${run.tint.name}`, kept.map(({ row }) => row), {
      ids: kept.map(({ k }) => `${run.index}:${k}`), size: 5, quiet: true,
      ...(run.tint.value === undefined ? { color: "force" as const } : { values: kept.map(() => run.tint.value ?? null) }),
    }));
  }
  const every = (of: (branch: Branch) => CurveRow[]): CurveRow[] => runs.flatMap((run) => of(run.branch));
  const folds = every((b) => b.folds);
  const kinks = folds.filter((f) => f.is_on_kink);
  const brackets = kinks.flatMap((fold): Layer[] => {
    const [low, high] = fold.bracket ?? [];
    const value = at(fold)[1];
    if (low === undefined || high === undefined || value === null) return [];
    return [{ kind: "curve", name: "bracket of a fold on a kink", quiet: true, color: "bad", width: 4, x: [low * x.factor, high * x.factor], y: [value, value] }];
  });
  const crossings = runs.flatMap((run) => run.branch.crossings.map((crossing) => ({ crossing, ...middle(run.branch, crossing, height) })));
  const crossed = (name: string, which: typeof crossings): Layer[] =>
    which.length === 0 ? [] : [{
      kind: "points", name, symbol: "diamond", color: "bad", size: 11,
      x: which.map((c) => (c.control === null ? null : c.control * x.factor)), y: which.map((c) => (c.value === null ? null : c.value * y.factor)),
    }];
  const picked = common.at;
  const selected = picked ? runs.filter((r) => r.index === picked.run).flatMap((r) => along(r.branch)[picked.row] ?? []) : [];
  const ends = runs.flatMap((run) => endPoints(run.branch));
  const isLog = common.isLog ?? wantsLog(runs, height);
  return {
    title: `Branch of steady states: ${y.name} against ${x.name}, ${common.of}`,
    x: { name: x.name, unit: x.unit },
    y: { name: y.name, unit: y.unit, ...(isLog ? { log: true } : {}) },
    layers: [
      ...curves, ...dots, ...brackets,
      ...points("fold", folds.filter((f) => !f.is_on_kink), { size: 11, color: "bad" }),
      ...points("fold on a kink", kinks, { symbol: "triangle", size: 11, color: "bad" }),
      ...crossed("oscillations begin to grow (Hopf)", crossings.filter((c) => isHopf(c.crossing))),
      ...crossed("stability changes", crossings.filter((c) => !isHopf(c.crossing))),
      ...points("root asked for", every((b) => b.roots), { symbol: "rect", hollow: true, size: 9 }),
      ...points("end", ends, { symbol: "rect", size: 7, color: "faint" }),
      ...points("looked at", selected, { hollow: true, symbol: "circle", size: 18 }),
    ],
    data: Object.fromEntries(runs.map((run) => [`run_${run.index}`, `runs/${run.runId}`])),
    notes: ["Solid: stable. Dashed: unstable. A gap: one discrete root ends there and another is followed."],
    onPoint: common.onPoint,
    ...(common.scale ? { scale: common.scale } : {}),
  };
}

/** Whether a number spans so much along the branches that its small values need a logarithm to be seen. */
export function wantsLog(runs: BranchRun[], height: Height): boolean {
  const values = runs.flatMap((run) => run.branch.points.flatMap((row) => row[height] ?? []));
  const [low, high] = [values.reduce((a, b) => Math.min(a, b), Infinity), values.reduce((a, b) => Math.max(a, b), -Infinity)];
  return low > 0 && high / low >= 10;
}

/** First and last row of a branch, where it goes no further. */
function endPoints(branch: Branch): CurveRow[] {
  const rows = along(branch);
  return [rows[0], rows.length > 1 ? rows.at(-1) : undefined].filter((row) => row !== undefined);
}

/** Half way between the two points where stability changes. */
function middle(branch: Branch, crossing: CurveRow, height: Height): { control: number | null; value: number | null } {
  const [before, after] = crossing.arclengths ?? [];
  const value = (s: number | undefined): number | undefined => branch.points.find((p) => p.arclength === s)?.[height];
  const mean = (a: number | undefined, b: number | undefined): number | null => (a === undefined || b === undefined ? (a ?? b ?? null) : (a + b) / 2);
  return { control: mean(crossing.bracket?.[0], crossing.bracket?.[1]), value: mean(value(before), value(after)) };
}

export interface FoldRun {
  index: number;
  runId: string;
  folds: Folds;
  tint: Tint;
}

/** Share of the thresholds' range that is shown beyond them. */
const BEYOND = 0.25;

/** Thresholds of one parameter over another; on which side there are steady states. */
export function foldFigure(runs: FoldRun[], second: Quantity, control: Quantity, common: Omit<Common, "at" | "isLog">): Figure {
  const at = (name: "second_value" | "control_value", run: FoldRun, q: Quantity): number[] =>
    run.folds.points.map((row) => (row[name] ?? NaN) * q.factor);
  const all = runs.flatMap((run) => at("control_value", run, control));
  const [low, high] = [all.reduce((a, b) => Math.min(a, b), Infinity), all.reduce((a, b) => Math.max(a, b), -Infinity)];
  const span = high - low || Math.abs(high) || 1;
  // Ends of the axis at round numbers.
  const step = 10 ** Math.floor(Math.log10(span)) / 2;
  const min = Math.max(low >= 0 ? 0 : -Infinity, Number((Math.floor((low - BEYOND * span) / step) * step).toPrecision(6)));
  const max = Number((Math.ceil((high + BEYOND * span) / step) * step).toPrecision(6));
  const [only] = runs;
  const isMaximum = only?.folds.points[0]?.is_maximum;
  const shades: Layer[] = [];
  if (runs.length === 1 && only && isMaximum !== undefined) {
    const [xs, ys] = [at("second_value", only, second), at("control_value", only, control)];
    const flat = (level: number): number[] => xs.map(() => level);
    const [below, above] = [{ x: xs, lower: flat(min), upper: ys }, { x: xs, lower: ys, upper: flat(max) }];
    shades.push({ kind: "area", name: "steady states", color: "ice", opacity: 0.3, ...(isMaximum ? below : above) });
    shades.push({ kind: "area", name: "none on this branch: collapse", color: "bad", opacity: 0.12, ...(isMaximum ? above : below) });
  }
  const list = (run: FoldRun, name: string, q: Quantity): string =>
    timesPython(`[r["${name}"] for r in run_${run.index}["fold_curve"]["points"]]`, q.factor);
  const curves = runs.map((run): Layer => ({
    kind: "curve", name: runs.length === 1 ? "fold: the threshold" : run.tint.name, quiet: run.tint.quiet, id: run.index,
    x: at("second_value", run, second), y: at("control_value", run, control),
    ...(run.tint.value === undefined ? { color: "bad" as const } : { value: run.tint.value }),
    python: { x: list(run, "second_value", second), y: list(run, "control_value", control) },
  }));
  return {
    title: `Threshold of ${control.name} over ${second.name}, ${common.of}`,
    x: { name: second.name, unit: second.unit },
    y: { name: control.name, unit: control.unit, ...(all.length > 0 ? { min, max } : {}) },
    layers: [...shades, ...curves],
    data: Object.fromEntries(runs.map((run) => [`run_${run.index}`, `runs/${run.runId}`])),
    onPoint: common.onPoint,
    ...(common.scale ? { scale: common.scale } : {}),
  };
}

/** What a fold is like, over the second parameter. */
export function alongFoldFigure(runs: FoldRun[], second: Quantity, y: Quantity, common: Omit<Common, "at" | "isLog">): Figure {
  const height = y.key as Height;
  const layers = runs.map((run): Layer => ({
    kind: "curve", name: run.tint.name, quiet: run.tint.quiet || runs.length === 1, id: run.index,
    x: run.folds.points.map((row) => (row.second_value ?? NaN) * second.factor),
    y: run.folds.points.map((row) => (row[height] ?? NaN) * y.factor),
    ...(run.tint.value === undefined ? { color: "force" as const } : { value: run.tint.value }),
    python: {
      x: timesPython(`[r["second_value"] for r in run_${run.index}["fold_curve"]["points"]]`, second.factor),
      y: timesPython(`[r["${height}"] for r in run_${run.index}["fold_curve"]["points"]]`, y.factor),
    },
  }));
  return {
    title: `At the threshold: ${y.name} over ${second.name}, ${common.of}`,
    x: { name: second.name, unit: second.unit },
    y: { name: y.name, unit: y.unit },
    layers,
    data: Object.fromEntries(runs.map((run) => [`run_${run.index}`, `runs/${run.runId}`])),
    onPoint: common.onPoint,
    ...(common.scale ? { scale: common.scale } : {}),
  };
}

/** A growth rate in words: how fast a perturbation comes or goes, and whether it swings. */
export function growth(re: number, im: number): string {
  /** Below this a rate is 0 to the solver's digits, a⁻¹. */
  const NONE = 1e-6;
  const time = (years: number): string => (years >= 0.1 ? `${Number(years.toPrecision(2))} a` : `${Number((years * 365.25).toPrecision(2))} d`);
  const how = Math.abs(re) < NONE ? "neither grows nor decays" : `${re > 0 ? "grows" : "decays"} e-fold in ${time(1 / Math.abs(re))}`;
  return Math.abs(im) < NONE ? how : `${how}, swings in ${time((2 * Math.PI) / Math.abs(im))}`;
}

// The profiles of runs as figures: speed, thickness about sea level, fluidity, limit of friction along the mélange,
// and the speed across it, as in Figs. 2 to 4 of the paper.
import type { TransectProfile } from "../../generated/schema";
import type { Profile } from "../api";
import type { AxisSpec, Curve, Figure, Layer, Scale } from "../chart/figure";
import type { ColourName } from "../chart/theme";
import { SUBMERGED, freeboard, show, withEnds } from "./numbers";
import { timesPython } from "./quantities";
import { type Speed, scaled, shownIn } from "./units";

/** What is drawn of a run. */
export interface Drawn {
  /** What a click reports. */
  id: number | string;
  name: string;
  profile: Profile | null;
  transects: TransectProfile[];
  glacier_m: number | undefined;
  /** Its place on the colour scale. */
  value?: number;
  color?: ColourName;
  quiet: boolean;
  dashed: boolean;
  /** The one of several that the figure is about. */
  isMain?: boolean;
  /** Python expression of where `profile` and `transects` stand. */
  python: string;
}

/** What all the figures of a set share. */
export interface Common {
  /** End of the titles: which runs. */
  of: string;
  scale: Scale | undefined;
  speed: Speed;
  data: Record<string, string>;
  notes: string[];
  onPoint: (id: number | string) => void;
}

const ALONG: AxisSpec = { name: "distance from the terminus", unit: "km" };
const KM = 1e-3;

/** Many curves are thinner. */
const width = (runs: Drawn[]): number => (runs.length > 12 ? 1.3 : 2);

function look(run: Drawn, runs: Drawn[]): Omit<Curve, "x" | "y" | "python"> {
  return {
    kind: "curve",
    name: run.name,
    quiet: run.quiet,
    id: run.id,
    line: run.dashed ? "dashed" : "solid",
    width: run.isMain ? 3 : width(runs),
    ...(run.value === undefined ? { color: run.color ?? "force" } : { value: run.value }),
  };
}

function base(common: Common, title: string, x: AxisSpec, y: AxisSpec, layers: Layer[]): Figure {
  const { of, scale, data, notes, onPoint } = common;
  return { title: `${title}, ${of}`, x, y, layers, data, notes, onPoint, ...(scale ? { scale } : {}) };
}

/** A quantity at nodes or cells along the mélange. */
function along(
  runs: Drawn[],
  common: Common,
  title: string,
  y: AxisSpec & { factor: number },
  at: "node_x_m" | "cell_x_m",
  of: "velocity_m_per_a" | "fluidity_per_a" | "mu_w",
): Figure {
  const { factor, ...axis } = y;
  const layers = runs.flatMap((run): Layer[] => {
    const { profile } = run;
    if (!profile) return [];
    const part = (name: string): string => `${run.python}["profile"]["${name}"]`;
    return [{
      ...look(run, runs),
      x: scaled(profile[at], KM),
      y: scaled(profile[of], factor),
      python: { x: timesPython(part(at), KM), y: timesPython(part(of), factor) },
    }];
  });
  return base(common, title, { ...ALONG, min: 0, max: farthest(runs) }, axis, layers);
}

/** Where the axis along the mélange ends, km: the same round number in all figures. */
function farthest(runs: Drawn[]): number {
  const length = runs.reduce((most, run) => Math.max(most, run.profile?.node_x_m.at(-1) ?? 0), 0) * KM;
  return roundEnd(length);
}

/** The least end of an axis from 0 at which a tick stands. */
export function roundEnd(length: number): number {
  if (!(length > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(length / 5));
  const ends = [1, 2, 3, 5, 10, 20].map((step) => step * power).filter((step) => length / step > 3.3 && length / step <= 7.5);
  return ends.map((step) => Number((Math.ceil(length / step - 1e-9) * step).toPrecision(6))).reduce((a, b) => Math.min(a, b), Infinity);
}

/** Speed U in the terminus frame. */
export function speedFigure(runs: Drawn[], common: Common): Figure {
  const { unit, factor } = shownIn("m a-1", common.speed);
  const y = { name: "speed U from the terminus", unit, factor };
  return along(runs, common, "Speed along the mélange", y, "node_x_m", "velocity_m_per_a");
}

export const fluidityFigure = (runs: Drawn[], common: Common): Figure =>
  along(runs, common, "Granular fluidity along the mélange", { name: "granular fluidity g′", unit: "a-1", factor: 1 }, "cell_x_m", "fluidity_per_a");

export const frictionFigure = (runs: Drawn[], common: Common): Figure =>
  along(runs, common, "Limit of internal friction along the mélange", { name: "limit of internal friction μ_w", unit: "1", factor: 1 }, "node_x_m", "mu_w");

/** Surface, end and base of a mélange as one line. */
export function outline(profile: Profile): { x: number[]; y: number[] } {
  const [start = 0, end = 0] = [profile.node_x_m[0], profile.node_x_m.at(-1)];
  const x = scaled([start, ...profile.cell_x_m, end], KM);
  const thickness = withEnds(profile.thickness_m);
  const up = thickness.map((h) => freeboard(h).surface);
  const down = thickness.map((h) => freeboard(h).base);
  return { x: [...x, ...x.toReversed()], y: [...up, ...down.toReversed()] };
}

/** The outline of a run as Python expressions. */
function outlineIn(python: string): { x: string; y: string } {
  const part = (name: string): string => `np.array(${python}["profile"]["${name}"])`;
  const x = `(lambda n, c: np.r_[n[0], c, n[-1], n[-1], c[::-1], n[0]] / 1000)(${part("node_x_m")}, ${part("cell_x_m")})`;
  const ends = "np.r_[1.5 * h[0] - 0.5 * h[1], h, 1.5 * h[-1] - 0.5 * h[-2]]";
  const y = `(lambda h: np.r_[${1 - SUBMERGED} * h, ${-SUBMERGED} * h[::-1]])((lambda h: ${ends})(${part("thickness_m")}))`;
  return { x, y };
}

/** Share of the longest mélange that is shown of the glacier. */
const UPSTREAM = 0.07;

/** Thickness about sea level, with the glacier front where x = 0. */
export function thicknessFigure(runs: Drawn[], common: Common): Figure {
  const stated = runs.flatMap((run) => (run.profile ? [{ run, ...outline(run.profile) }] : []));
  const all = (key: "x" | "y"): number[] => stated.flatMap((s) => s[key]);
  const length = all("x").reduce((a, b) => Math.max(a, b), 0);
  const depth = -all("y").reduce((a, b) => Math.min(a, b), 0);
  const heights = [...new Set(stated.flatMap(({ run }) => run.glacier_m ?? []))];
  const glaciers = heights.map((thickness): Layer => {
    const { surface, base } = freeboard(thickness);
    return {
      kind: "area",
      name: heights.length === 1 ? `glacier, H_t = ${Number(thickness.toPrecision(4))} m` : "glaciers",
      color: "glacier",
      opacity: heights.length === 1 ? 0.8 : Math.max(0.12, 0.6 / heights.length),
      x: [-UPSTREAM * length, 0],
      lower: [base, base],
      upper: [surface, surface],
    };
  });
  const only = stated.length === 1 ? stated[0] : stated.find(({ run }) => run.isMain);
  const filled = only?.run.profile ? [inside(only.run.profile)] : [];
  const curves = stated.map(({ run, x, y }): Layer => ({ ...look(run, runs), x, y, python: outlineIn(run.python) }));
  const deepest = Math.max(0, ...heights.map((h) => -freeboard(h).base));
  const isCut = deepest > CUT * depth && depth > 0;
  const highest = Math.max(0, ...heights.map((h) => freeboard(h).surface), ...all("y"));
  const y: AxisSpec = {
    name: "height above sea level",
    unit: "m",
    ...(isCut ? { min: round(-1.2 * depth), max: round(Math.min(1.15 * highest, depth)) } : {}),
  };
  const sea: Layer = { kind: "guide", name: "sea level", y: 0, color: "water" };
  const x = { ...ALONG, min: -UPSTREAM * length, max: farthest(runs) };
  const figure = base(common, "Thickness about sea level", x, y, [...glaciers, ...filled, sea, ...curves]);
  const cut = `The glacier reaches ${show(deepest, 3)} m below sea level: it is cut off here, so that the mélange can be seen.`;
  return { ...figure, notes: [...common.notes, ...(isCut ? [cut] : [])] };
}

/** How many times deeper than the mélange a glacier is still shown whole. */
const CUT = 2.2;

/** A round number next to an end of an axis. */
function round(value: number): number {
  const step = 10 ** Math.floor(Math.log10(Math.abs(value) || 1));
  return value < 0 ? Math.floor(value / (step / 2)) * (step / 2) : Math.ceil(value / (step / 2)) * (step / 2);
}

function inside(profile: Profile): Layer {
  const { x, y } = outline(profile);
  const half = x.length / 2;
  return {
    kind: "area", name: "mélange", color: "ice", opacity: 0.3, quiet: true,
    x: x.slice(0, half), upper: y.slice(0, half), lower: y.slice(half).reverse(),
  };
}

/** Speed across the fjord; the other half mirrored. */
export function acrossFigure(runs: Drawn[], common: Common): Figure {
  const { unit, factor } = shownIn("m a-1", common.speed);
  const several = runs.some((run) => run.transects.length > 1);
  const layers = runs.flatMap((run) =>
    run.transects.map((transect, i): Layer => {
      const half = transect.width_m / 2;
      const y = transect.y_m.map((v) => (v - half) * KM);
      const speed = scaled(transect.velocity_m_per_a, factor);
      const from = `${run.python}["transects"][${i}]`;
      return {
        ...look(run, runs),
        ...(several ? { value: transect.chi, name: `χ = ${transect.chi}${run.dashed ? `, ${run.name}` : ""}`, quiet: run.dashed } : {}),
        x: [...y, ...y.toReversed().map((v) => -v)],
        y: [...speed, ...speed.toReversed()],
        python: {
          x: `(lambda y: np.r_[y, -y[::-1]] / 1000)(np.array(${from}["y_m"]) - ${from}["width_m"] / 2)`,
          y: `(lambda u: np.r_[u, u[::-1]]${factor === 1 ? "" : ` * ${factor}`})(np.array(${from}["velocity_m_per_a"]))`,
        },
      };
    }),
  );
  const chi = runs[0]?.transects[0]?.chi;
  const title = several || chi === undefined ? "Speed across the fjord" : `Speed across the fjord at χ = ${chi}`;
  const x = { name: "distance from the centre line", unit: "km" };
  const figure = base(common, title, x, { name: "speed u past the walls", unit, min: 0 }, layers);
  if (!several) return figure;
  return { ...figure, scale: { name: "χ", unit: "1", min: 0, max: 1, quiet: true } };
}

/** A colour scale over values; none where they are all the same. */
export function scaleOf(name: string, unit: string, values: (number | null)[], legend: number): Scale | undefined {
  const known = values.filter((v) => v !== null);
  const [min, max] = [Math.min(...known), Math.max(...known)];
  if (known.length === 0 || min === max) return undefined;
  const isLog = min > 0 && max / min >= 8;
  return { name, unit, min, max, ...(isLog ? { log: true } : {}), ...(new Set(known).size <= legend ? { quiet: true } : {}) };
}

/** Places along the mélange that a text such as "0.1, 0.5" names. */
export function readChi(text: string): number[] {
  const values = text.split(/[\s,;]+/).filter((part) => part !== "").map(Number);
  return [...new Set(values.filter((v) => v >= 0 && v <= 1))];
}

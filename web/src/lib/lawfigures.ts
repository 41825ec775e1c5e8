// The figures of a law: points with the law through them, residuals, local exponents, and exponents over groups. All
// numbers are the service's; here they get units, colours and names.
import type { LawGroup, Laws } from "../api/analysis";
import type { ColourName } from "../chart/theme";
import type { AxisSpec, Figure, Layer, Scale, Symbol } from "../chart/figure";
import { LAWS, exponentFactor, exponentUnit } from "./law";
import { show, unitText } from "./numbers";
import { type Quantity, capital, timesPython } from "./quantities";
import { tickText } from "./ticks";
import { scaled } from "./units";
import { isWide } from "./varied";
import { countText } from "./words";

/** What is drawn and how. */
export interface LawView {
  ensemble: string;
  x: Quantity;
  y: Quantity;
  group: Quantity | undefined;
  isLogX: boolean;
  isLogY: boolean;
  laws: Laws;
  /** Path that the laws came from. */
  path: string;
  /** The quasi-static estimate beside the force. */
  quasi?: { laws: Laws; path: string; isFitted: boolean } | undefined;
  onPoint: (run: number | string) => void;
}

const SYMBOLS: Symbol[] = ["circle", "triangle", "rect", "diamond"];
/** Points of which more are drawn smaller, and small. */
const [SOME, MANY] = [150, 1500];
/** Points up to which a local exponent is marked place by place. */
const FEW = 60;

/** A group's value, or the middle of its values. */
export function middle({ from, to }: LawGroup): number | null {
  return typeof from === "number" && typeof to === "number" ? (from + to) / 2 : null;
}

/** A group's values in words. */
export function groupText(group: LawGroup, by: Quantity): string {
  if (middle(group) === null) return `no ${by.name}`;
  const [from, to] = [group.from, group.to].map((v) => tickText(Number(((v ?? 0) * by.factor).toPrecision(4))));
  const unit = unitText(by.unit);
  return `${from === to ? from : `${from} to ${to}`}${unit ? ` ${unit}` : ""}`;
}

/** What colours mean where there are groups. */
export function groupScale(laws: Laws, by: Quantity): Scale | undefined {
  const values = laws.groups.flatMap((group) => middle(group) ?? []).map((v) => v * by.factor);
  if (values.length < 2) return undefined;
  const [min, max] = [Math.min(...values), Math.max(...values)];
  return { name: by.name, unit: by.unit, min, max, log: isWide(min, max) };
}

/** How many of the runs that laws use are drawn. */
export function thinned(laws: Laws): string[] {
  const used = laws.groups.reduce((sum, group) => sum + group.n_runs - group.left_out.reduce((n, l) => n + l.count, 0), 0);
  if (laws.shown >= used) return [];
  const count = (n: number): string => countText(n);
  return [`Showing ${count(laws.shown)} of ${count(used)} runs: a random choice that is always the same. The law uses all of them.`];
}

const axis = (q: Quantity, log: boolean): AxisSpec => ({ name: q.name, unit: q.unit, log });
const titled = (view: LawView, text: string): string => `${text}${view.group ? ` for each ${view.group.name}` : ""}: ${view.ensemble}`;

interface Parts {
  group: LawGroup;
  /** The same group as a Python expression. */
  python: string;
  place: number | undefined;
  symbol: Symbol;
  name: string;
}

function groupsOf(view: LawView, laws: Laws, name: string): Parts[] {
  return laws.groups.map((group, i) => {
    const at = view.group ? middle(group) : null;
    return {
      group,
      python: `${name}["groups"][${i}]`,
      place: at === null ? undefined : at * (view.group?.factor ?? 1),
      symbol: SYMBOLS[i % SYMBOLS.length] ?? "circle",
      name: view.group ? `${view.group.name} ${groupText(group, view.group)}` : view.y.name,
    };
  });
}

interface Look {
  color: ColourName;
  hollow: boolean;
  line: "solid" | "dashed";
  named: string;
  isFitted: boolean;
}

function lawLayers(view: LawView, laws: Laws, data: string, look: Look): Layer[] {
  const { x, y } = view;
  const [bands, points, curves]: [Layer[], Layer[], Layer[]] = [[], [], []];
  const small = laws.shown > MANY ? { size: 4 } : laws.shown > SOME ? { size: 6 } : {};
  const halo = laws.shown > MANY ? { halo: true, width: 3 } : {};
  for (const { group, python, place, symbol, name } of groupsOf(view, laws, data)) {
    const { points: p, fit } = group;
    const from = (path: string, factor: number): string => timesPython(`${python}${path}`, factor);
    if (p.x.length > 0) {
      const looks = view.group ? { symbol, name: `${name}${look.hollow ? `, ${look.named}` : ""}`, quiet: look.hollow } : { name: look.named };
      points.push({
        kind: "points",
        ...looks,
        ...(place === undefined ? { color: look.color } : { values: p.x.map(() => place) }),
        hollow: look.hollow,
        ...small,
        x: scaled(p.x, x.factor),
        y: scaled(p.y, y.factor),
        ids: p.run_index,
        python: { x: from('["points"]["x"]', x.factor), y: from('["points"]["y"]', y.factor) },
      });
    }
    if (!fit || !look.isFitted) continue;
    const band = { x: scaled(fit.band.x, x.factor), lower: scaled(fit.band.lower, y.factor), upper: scaled(fit.band.upper, y.factor) };
    const expressions = {
      x: from('["fit"]["band"]["x"]', x.factor),
      y: from('["fit"]["band"]["y"]', y.factor),
      lower: from('["fit"]["band"]["lower"]', y.factor),
      upper: from('["fit"]["band"]["upper"]', y.factor),
    };
    const kind = LAWS[fit.model];
    const number = show(fit.exponent.estimate * exponentFactor(fit.model, x, y), 4);
    const law = `${look.hollow ? "quasi-static " : ""}${kind.name}, ${kind.number} ${number}`;
    const ofGroup = view.group ? `${name}: ${law}` : law;
    const isMain = !look.hollow;
    const color = place === undefined ? { color: isMain ? ("fit" as const) : look.color } : { value: place };
    if (isMain) bands.push({ kind: "area", name: view.group ? `${name}: 95 % band` : "95 % band", ...band, ...color, quiet: view.group !== undefined, python: expressions });
    curves.push({ kind: "curve", name: ofGroup, x: band.x, y: scaled(fit.band.y, y.factor), line: look.line, ...halo, ...color, quiet: view.group !== undefined, python: expressions });
  }
  return [...bands, ...points, ...curves];
}

/** Points and laws. */
export function lawFigure(view: LawView): Figure {
  const { laws, quasi, y } = view;
  const scale = view.group ? groupScale(laws, view.group) : undefined;
  const named = quasi ? "F/W (Eq. 30)" : y.name;
  const layers = lawLayers(view, laws, "law", { color: "force", hollow: false, line: "solid", named, isFitted: true });
  if (quasi) {
    const look: Look = { color: "quasiStatic", hollow: true, line: "dashed", named: "quasi-static estimate", isFitted: quasi.isFitted };
    layers.push(...lawLayers(view, quasi.laws, "quasi", look));
  }
  return {
    title: titled(view, `${capital(y.name)} against ${view.x.name}`),
    x: axis(view.x, view.isLogX),
    y: axis(y, view.isLogY),
    layers,
    ...(scale ? { scale } : {}),
    data: { law: view.path, ...(quasi ? { quasi: quasi.path } : {}) },
    notes: thinned(laws),
    onPoint: view.onPoint,
  };
}

/** What the law does not explain. */
export function residualFigure(view: LawView): Figure {
  const { laws, x, y } = view;
  const isLinear = laws.model === "linear";
  const factor = isLinear ? y.factor : 1;
  const scale = view.group ? groupScale(laws, view.group) : undefined;
  const layers: Layer[] = groupsOf(view, laws, "law").filter(({ group }) => group.fit).map(({ group, python, place, symbol, name }) => ({
    kind: "points",
    name,
    ...(place === undefined ? { color: "force" as const } : { values: group.points.x.map(() => place), symbol }),
    quiet: true,
    ...(laws.shown > MANY ? { size: 3 } : {}),
    x: scaled(group.points.x, x.factor),
    y: scaled(group.points.residual, factor),
    ids: group.points.run_index,
    python: { x: timesPython(`${python}["points"]["x"]`, x.factor), y: timesPython(`${python}["points"]["residual"]`, factor) },
  }));
  return {
    title: titled(view, `Residuals of the ${LAWS[laws.model].name}`),
    x: axis(x, view.isLogX),
    y: isLinear ? { name: `residual of ${y.name}`, unit: y.unit } : { name: `residual of ln ${y.name}`, unit: "1" },
    layers: [{ kind: "guide", name: "no misfit", y: 0, quiet: true }, ...layers],
    ...(scale ? { scale } : {}),
    data: { law: view.path },
    notes: [...(isLinear ? [] : ["A residual of 0.05 is a value 5 % above the law."]), ...thinned(laws)],
    onPoint: view.onPoint,
  };
}

/** Whether there are slopes between neighbours, of any group. */
export const hasLocal = ({ groups }: Laws): boolean => groups.some((group) => group.local_exponent.x.length > 0);

/** Why groups have no slopes between neighbours, each reason once, with its groups where not all have it. */
export function whyNoLocal({ groups }: Laws, by?: Quantity): string[] {
  const reasons = new Map<string, LawGroup[]>();
  for (const group of groups) {
    const why = group.no_local_exponent;
    if (typeof why === "string") reasons.set(why, [...(reasons.get(why) ?? []), group]);
  }
  return [...reasons].map(([why, having]) =>
    by && having.length < groups.length ? `${having.map((group) => groupText(group, by)).join(", ")}: ${why}.` : `${capital(why)}.`,
  );
}

/** The law's slope from place to place. */
export function localFigure(view: LawView): Figure {
  const { laws, x, y } = view;
  const factor = exponentFactor(laws.model, x, y);
  const { number } = LAWS[laws.model];
  const scale = view.group ? groupScale(laws, view.group) : undefined;
  const layers: Layer[] = [];
  for (const { group, python, place, symbol, name } of groupsOf(view, laws, "law")) {
    const { local_exponent: local, fit } = group;
    if (local.x.length === 0) continue;
    const numbers = { x: scaled(local.x, x.factor), y: scaled(local.exponent, factor) };
    const expressions = {
      x: timesPython(`${python}["local_exponent"]["x"]`, x.factor),
      y: timesPython(`${python}["local_exponent"]["exponent"]`, factor),
    };
    const color = place === undefined ? { color: "force" as const } : { value: place };
    layers.push({ kind: "curve", name: view.group ? name : `local ${number}`, ...numbers, ...color, quiet: view.group !== undefined, python: expressions });
    if (local.x.length <= FEW) {
      const marks = place === undefined ? { color: "force" as const } : { values: local.x.map(() => place), symbol };
      layers.push({ kind: "points", name: view.group ? name : `local ${number}`, ...numbers, ...marks, size: 6, quiet: true, python: expressions });
    }
    if (fit && !view.group) layers.push({ kind: "guide", name: `of the law: ${show(fit.exponent.estimate * factor, 4)}`, y: fit.exponent.estimate * factor, color: "fit" });
  }
  return {
    title: titled(view, `Local ${number} of ${y.name} over ${x.name}`),
    x: axis(x, view.isLogX),
    y: { name: `local ${number}`, unit: exponentUnit(laws.model, x, y) },
    layers,
    ...(scale ? { scale } : {}),
    data: { law: view.path },
    notes: [
      `The slope between neighbours in ${x.name}: where it drifts, no single ${number} holds.`,
      ...(laws.groups.some((group) => group.also_varies.length > 0) ? ["It is taken between runs that agree in all else, and is their mean."] : []),
      ...whyNoLocal(laws, view.group),
    ],
  };
}

/** Exponents over the groups. */
export function exponentsFigure(view: LawView & { group: Quantity }): Figure {
  const { laws, quasi, group: by, x, y } = view;
  const { number, name } = LAWS[laws.model];
  const factor = exponentFactor(laws.model, x, y);
  const layer = (of: Laws, data: string, isQuasi: boolean): Layer => {
    const fitted = of.groups.flatMap((group) => {
      const at = middle(group);
      return group.fit && at !== null ? [{ at, fit: group.fit }] : [];
    });
    const of_each = (path: string, by_factor: number): string =>
      timesPython(`[g${path} for g in ${data}["groups"] if g["fit"] and g["from"] is not None]`, by_factor);
    return {
      kind: "interval",
      name: isQuasi ? "quasi-static estimate" : y.name,
      color: isQuasi ? "quasiStatic" : "force",
      hollow: isQuasi,
      x: fitted.map(({ at }) => at * by.factor),
      y: fitted.map(({ fit }) => fit.exponent.estimate * factor),
      lower: fitted.map(({ fit }) => (fit.exponent.ci95[0] ?? NaN) * factor),
      upper: fitted.map(({ fit }) => (fit.exponent.ci95[1] ?? NaN) * factor),
      python: {
        x: timesPython(`[(g["from"] + g["to"]) / 2 for g in ${data}["groups"] if g["fit"] and g["from"] is not None]`, by.factor),
        y: of_each('["fit"]["exponent"]["estimate"]', factor),
        lower: of_each('["fit"]["exponent"]["ci95"][0]', factor),
        upper: of_each('["fit"]["exponent"]["ci95"][1]', factor),
      },
    };
  };
  const scale = groupScale(laws, by);
  return {
    title: `${capital(number)} of the ${name} of ${y.name} over ${x.name} against ${by.name}: ${view.ensemble}`,
    x: axis(by, scale?.log ?? false),
    y: { name: number, unit: exponentUnit(laws.model, x, y) },
    layers: [layer(laws, "law", false), ...(quasi?.isFitted ? [layer(quasi.laws, "quasi", true)] : [])],
    data: { law: view.path, ...(quasi?.isFitted ? { quasi: quasi.path } : {}) },
    notes: ["Bars are 95 % intervals of the misfit of each law: runs carry no noise."],
  };
}

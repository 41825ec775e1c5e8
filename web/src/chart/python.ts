// A figure as a Python script that asks the service for the same data and draws it again with matplotlib. Layers
// that say where their numbers come from are read anew; the others stand in the script.
import { AREA, type Figure, type Layer, type Parallel, type Scatter, axisLabel, isParallel } from "./figure";
import { LOOKS } from "./theme";

const quoted = (text: string): string => JSON.stringify(text);
/** What matplotlib writes as it stands: no formula between dollars, and listed though it begins with a low line. */
const label = (text: string): string => quoted(text.replaceAll("$", "\\$").replace(/^_/, " _"));
/** A line that Python passes over, whatever it says. */
const remark = (text: string): string => `# ${text.replace(/[\p{Cc}\u2028\u2029]+/gu, " ")}`;
const list = (values: (number | null)[]): string => `[${values.map((v) => (v === null ? "None" : String(v))).join(", ")}]`;
const numbers = (expression: string | undefined, values: (number | null)[]): string =>
  `numbers(${expression ?? list(values)})`;

const HEAD = [
  "import json",
  "import os",
  "import urllib.request",
  "",
  "import matplotlib.pyplot as plt",
  "import numpy as np",
  "from matplotlib import cm, colors",
];

const READ = (base: string): string[] => [
  `BASE = os.environ.get("MELANGE_URL", ${quoted(base)})`,
  'TOKEN = os.environ.get("MELANGE_TOKEN", "")  # where the service asks for one',
  "",
  "",
  "def read(path):",
  '    headers = {"Authorization": f"Bearer {TOKEN}"} if TOKEN else {}',
  '    with urllib.request.urlopen(urllib.request.Request(f"{BASE}/{path}", headers=headers)) as answer:',
  "        return json.load(answer)",
  "",
  "",
  "def numbers(values):",
  "    return np.array([np.nan if v is None else v for v in values], dtype=float)",
  "",
  "",
];

/** The script; `base` is the absolute address of the service's `api/v1`, without a slash at its end. */
export function python(figure: Figure | Parallel, base: string): string {
  // The first line is there so that no title can pass for one that names an encoding.
  const about = ["-*- coding: utf-8 -*-", figure.title, ...(figure.notes ?? [])].map(remark);
  const data = Object.entries(figure.data ?? {}).map(([name, path]) => `${name} = read(${quoted(path)})`);
  const body = isParallel(figure) ? parallel(figure) : plane(figure);
  const end = [`fig.savefig(${quoted(`${fileName(figure.title)}.pdf`)})`, 'if plt.get_backend().lower() != "agg":', "    plt.show()"];
  return [...about, "", ...HEAD, "", ...READ(base), ...data, "", ...body, ...end, ""].join("\n");
}

/** A title as the name of a file. */
export const fileName = (title: string): string =>
  title.normalize("NFKD").replace(/\p{M}/gu, "").replace(/[^\w.-]+/g, "-").replace(/^[-.]+|[-.]+$/g, "").slice(0, 80) || "figure";

function plane(figure: Figure): string[] {
  const { x, y, scale } = figure;
  const lines = ['fig, ax = plt.subplots(figsize=(6.85, 4.3), layout="constrained")'];
  if (scale) {
    const norm = scale.log ? "LogNorm" : "Normalize";
    lines.push(
      `scale = cm.ScalarMappable(colors.${norm}(${scale.min}, ${scale.max}), "viridis")`,
      ...(scale.quiet ? [] : [`fig.colorbar(scale, ax=ax, label=${label(axisLabel(scale))})`]),
    );
  }
  for (const layer of figure.layers) lines.push(...draw(layer));
  lines.push(`ax.set_xlabel(${label(axisLabel(x))})`, `ax.set_ylabel(${label(axisLabel(y))})`);
  if (x.log) lines.push('ax.set_xscale("log")');
  if (y.log) lines.push('ax.set_yscale("log")');
  if (x.min !== undefined || x.max !== undefined) lines.push(limits("x", x));
  if (y.min !== undefined || y.max !== undefined) lines.push(limits("y", y));
  if (x.categories) lines.push(...words("x", x.categories));
  if (y.categories) lines.push(...words("y", y.categories));
  const named = figure.layers.some((layer) => layer.kind !== "heat" && !("quiet" in layer && layer.quiet));
  if (named) lines.push("ax.legend(frameon=False)");
  return lines;
}

const words = (axis: "x" | "y", categories: string[]): string[] => [
  `ax.set_${axis}ticks(range(${categories.length}), [${categories.map(label).join(", ")}])`,
  `ax.set_${axis}lim(-0.5, ${categories.length - 0.5})`,
];

function limits(name: "x" | "y", axis: { min?: number; max?: number }): string {
  const [low, high] = name === "x" ? ["left", "right"] : ["bottom", "top"];
  const ends = [
    ...(axis.min === undefined ? [] : [`${low}=${axis.min}`]),
    ...(axis.max === undefined ? [] : [`${high}=${axis.max}`]),
  ];
  return `ax.set_${name}lim(${ends.join(", ")})`;
}

function colour(layer: { color?: keyof typeof LOOKS.light; value?: number }): string {
  if (layer.value !== undefined) return `scale.to_rgba(${layer.value})`;
  return quoted(LOOKS.light[layer.color ?? "ink"]);
}

const MARKS: Record<NonNullable<Scatter["symbol"]>, string> = {
  circle: "o",
  diamond: "D",
  triangle: "^",
  rect: "s",
  cross: "x",
};

function draw(layer: Layer): string[] {
  const named = `, gid=${quoted(layer.name)}${"quiet" in layer && layer.quiet ? "" : `, label=${label(layer.name)}`}`;
  switch (layer.kind) {
    case "points": {
      const [x, y] = [numbers(layer.python?.x, layer.x), numbers(layer.python?.y, layer.y)];
      const mark = `marker=${quoted(MARKS[layer.symbol ?? (layer.hollow ? "diamond" : "circle")])}, s=${(layer.size ?? 6) ** 2 / 2}`;
      if (layer.values && layer.hollow) return [`ax.scatter(${x}, ${y}, facecolors="none", edgecolors=scale.to_rgba(numbers(${list(layer.values)})), ${mark}${named})`];
      if (layer.values) return [`ax.scatter(${x}, ${y}, c=numbers(${list(layer.values)}), cmap=scale.cmap, norm=scale.norm, ${mark}${named})`];
      const paint = layer.hollow ? `facecolors="none", edgecolors=${colour(layer)}` : `color=${colour(layer)}`;
      return [`ax.scatter(${x}, ${y}, ${paint}, ${mark}${named})`];
    }
    case "curve": {
      const [x, y] = [numbers(layer.python?.x, layer.x), numbers(layer.python?.y, layer.y)];
      const style = `color=${colour(layer)}, linestyle=${quoted(layer.line ?? "solid")}, linewidth=${layer.width ?? 1.6}`;
      if (!layer.arrows) return [`ax.plot(${x}, ${y}, ${style}${named})`];
      return [
        `x, y = ${x}, ${y}`,
        `ax.plot(x, y, ${style}${named})`,
        `for i in ${list(layer.arrows)}:`,
        `    ax.annotate("", (x[i + 1], y[i + 1]), (x[i], y[i]), arrowprops={"arrowstyle": "-|>", "color": ${colour(layer)}})`,
      ];
    }
    case "area": {
      const [lower, upper] = [numbers(layer.python?.lower, layer.lower), numbers(layer.python?.upper, layer.upper)];
      return [`ax.fill_between(${numbers(layer.python?.x, layer.x)}, ${lower}, ${upper}, color=${colour(layer)}, alpha=${layer.opacity ?? AREA}, linewidth=0${named})`];
    }
    case "interval": {
      const [x, y] = [numbers(layer.python?.x, layer.x), numbers(layer.python?.y, layer.y)];
      const [lower, upper] = [numbers(layer.python?.lower, layer.lower), numbers(layer.python?.upper, layer.upper)];
      const fill = layer.hollow ? ', markerfacecolor="none"' : "";
      const style = `fmt=${quoted(MARKS[layer.symbol ?? (layer.hollow ? "diamond" : "circle")])}, color=${colour(layer)}${fill}, capsize=3`;
      const middle = layer.lies ? "x" : "y";
      return [
        `x, y, lower, upper = ${x}, ${y}, ${lower}, ${upper}`,
        `ax.errorbar(x, y, ${middle}err=(${middle} - lower, upper - ${middle}), ${style}${named})`,
      ];
    }
    case "heat": {
      const z = layer.python ?? `np.array([${layer.z.map((row) => numbers(undefined, row)).join(", ")}])`;
      return [`ax.pcolormesh(${list(layer.x)}, ${list(layer.y)}, ${z}, cmap=scale.cmap, norm=scale.norm, shading="nearest", gid=${quoted(layer.name)})`];
    }
    case "guide": {
      const style = `color=${colour(layer)}, linestyle="dashed", linewidth=1${named}`;
      return [layer.x === undefined ? `ax.axhline(${layer.y ?? 0}, ${style})` : `ax.axvline(${layer.x}, ${style})`];
    }
  }
}

function parallel(figure: Parallel): string[] {
  const { scale, axes } = figure;
  const columns = axes.map((_, i) => numbers(figure.python?.[i], figure.rows.map((row) => row[i] ?? null)));
  return [
    `axes = [${axes.map((axis) => label(axisLabel(axis))).join(", ")}]`,
    `is_log = [${axes.map((axis) => (axis.log ? "True" : "False")).join(", ")}]`,
    `columns = [${columns.join(", ")}]`,
    "whole = ~np.isnan(columns).any(axis=0)  # a run that lacks a number is not drawn",
    "columns = [c[whole] for c in columns]",
    "inside = np.ones(len(columns[0]), dtype=bool)",
    ...(figure.brushes ?? []).flatMap((range, i) => (range ? [`inside &= (columns[${i}] >= ${range[0]}) & (columns[${i}] <= ${range[1]})`] : [])),
    `values = columns[${figure.colored}]`,
    "columns = [np.log10(c) if log else c for c, log in zip(columns, is_log)]",
    "heights = [(c - np.nanmin(c)) / max(np.nanmax(c) - np.nanmin(c), 1e-300) for c in columns]",
    'fig, ax = plt.subplots(figsize=(6.85, 4.3), layout="constrained")',
    `scale = cm.ScalarMappable(colors.${scale.log ? "LogNorm" : "Normalize"}(${scale.min}, ${scale.max}), "viridis")`,
    `fig.colorbar(scale, ax=ax, label=${label(axisLabel(scale))})`,
    "for row, value, is_in in zip(np.transpose(heights), values, inside):",
    "    ax.plot(row, color=scale.to_rgba(value), linewidth=0.6, alpha=0.6 if is_in else 0.03)",
    'ax.set_xticks(range(len(axes)), axes, rotation=20, ha="right")',
    'ax.set_yticks([0, 1], ["least", "greatest"])',
  ];
}

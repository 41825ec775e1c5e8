// A figure with two axes as the plotting library's description. Together with `layers.ts`, `parallel.ts` and
// `echarts.ts` this is the chart module: nobody else knows the library.
import type { EChartsCoreOption } from "echarts/core";
import { show, unitText } from "../lib/numbers";
import { logRange, logTicks, tickText } from "../lib/ticks";
import type { Canvas, Drawing } from "./echarts";
import { AREA, type AxisSpec, type Figure, type Scale, axisLabel } from "./figure";
import { type Numbers, type Part, edges, parts } from "./layers";
import { LOOKS, type Theme, viridis } from "./theme";

const still = (): boolean => matchMedia("(prefers-reduced-motion: reduce)").matches || navigator.webdriver;

/** All coordinates drawn along an axis. */
function along(figure: Figure, which: "x" | "y"): number[] {
  const all: number[] = [];
  const add = (values: Numbers): void => {
    for (const value of values) if (value !== null && Number.isFinite(value)) all.push(value);
  };
  for (const layer of figure.layers) {
    if (layer.kind === "area") [which === "x" ? layer.x : layer.lower, which === "x" ? [] : layer.upper].forEach(add);
    else if (layer.kind === "interval") [layer[which], ...(Boolean(layer.lies) === (which === "x") ? [layer.lower, layer.upper] : [])].forEach(add);
    else if (layer.kind === "heat") add(edges(layer[which], figure[which].log));
    else if (layer.kind === "guide") add([layer[which] ?? null]);
    else add(layer[which]);
  }
  return all;
}

/** Ends of an axis. With axes of numbers that hardly differ the library has its own way. */
function axis(figure: Figure, which: "x" | "y", canvas: Canvas): object {
  const spec: AxisSpec = figure[which];
  const look = LOOKS[canvas.theme];
  const horizontal = which === "x";
  const range = spec.log ? logRange(along(figure, which)) : undefined;
  const ticks = range ? { customValues: logTicks(range) } : {};
  const isHeat = figure.layers.some((layer) => layer.kind === "heat");
  const tight = isHeat ? extent(along(figure, which)) : undefined;
  const { categories } = spec;
  if (categories) return words(categories, look, horizontal, canvas);
  return {
    type: spec.log ? "log" : "value",
    name: axisLabel(spec),
    nameLocation: "middle",
    nameGap: horizontal ? 30 : 60,
    nameTextStyle: { color: look.ink, fontSize: 13 },
    scale: true,
    // Marks with bars stand clear of the ends.
    ...(figure.layers.some((layer) => layer.kind === "interval") ? { boundaryGap: ["5%", "5%"] } : {}),
    min: range?.[0] ?? tight?.[0] ?? spec.min ?? null,
    max: range?.[1] ?? tight?.[1] ?? spec.max ?? null,
    axisLabel: { color: look.faint, formatter: tickText, hideOverlap: true, ...ticks, ...(tight ? { showMinLabel: false, showMaxLabel: false } : {}) },
    axisLine: { show: true, lineStyle: { color: look.rule }, onZero: false },
    axisTick: { show: true, ...ticks },
    splitLine: { lineStyle: { color: look.rule, opacity: 0.5 } },
  };
}

/** Room for an axis of words at the left edge. */
const wordRoom = (categories: string[], canvas: Canvas): number =>
  Math.min(0.4 * canvas.width, 24 + 7 * categories.reduce((most, word) => Math.max(most, word.length), 0));

/** An axis of words, which need no name beside. */
function words(categories: string[], look: (typeof LOOKS)[Theme], horizontal: boolean, canvas: Canvas): object {
  const customValues = categories.map((_, i) => i);
  const room = horizontal ? {} : { width: wordRoom(categories, canvas) - 16, overflow: "break" };
  return {
    type: "value",
    min: -0.5,
    max: categories.length - 0.5,
    axisLabel: { color: look.ink, formatter: (i: number) => categories[i] ?? "", customValues, ...room },
    axisLine: { show: true, lineStyle: { color: look.rule }, onZero: false },
    axisTick: { show: false },
    splitLine: { show: false },
  };
}

function extent(values: number[]): [number, number] {
  return [values.reduce((a, b) => Math.min(a, b), Infinity), values.reduce((a, b) => Math.max(a, b), -Infinity)];
}

/** A bar with the colour scale at the right edge. */
function scaleBar(scale: Scale, canvas: Canvas, top: number): object {
  const look = LOOKS[canvas.theme];
  const height = Math.max(60, canvas.height - top - 56);
  const stops = Array.from({ length: 9 }, (_, i) => ({ offset: i / 8, color: viridis(1 - i / 8, canvas.theme) }));
  const value = (s: number): number =>
    scale.log && scale.min > 0 ? scale.min * (scale.max / scale.min) ** s : scale.min + s * (scale.max - scale.min);
  const label = (s: number): object => ({
    type: "text",
    left: canvas.width - 62,
    top: top + (1 - s) * height - 6,
    style: { text: tickText(Number(value(s).toPrecision(4))), fill: look.faint, fontSize: 12 },
    silent: true,
  });
  return [
    {
      type: "rect",
      left: canvas.width - 82,
      top,
      shape: { width: 14, height },
      style: { fill: { type: "linear", x: 0, y: 0, x2: 0, y2: 1, colorStops: stops } },
      silent: true,
    },
    ...[0, 0.5, 1].map(label),
    {
      type: "text",
      right: 6,
      top: top - 22,
      style: { text: axisLabel(scale), fill: look.ink, fontSize: 12, align: "right" },
      silent: true,
    },
  ];
}

interface Hit {
  seriesIndex: number;
  dataIndex: number;
  seriesName?: string;
  value?: unknown;
}

const escaped = (text: string): string =>
  text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;");

/** What the pointer reads off. */
function tip(figure: Figure, ids: Part[], hit: Hit): string {
  const [x, y, z] = Array.isArray(hit.value) ? (hit.value as (number | null)[]) : [];
  const part = ids[hit.seriesIndex];
  const run = part?.ids?.[hit.dataIndex] ?? part?.id;
  const quantity = (axis: { name: string; unit: string; categories?: string[] }, value: number | null | undefined): string =>
    `${escaped(axis.name)}: ${escaped(axis.categories?.[Math.round(value ?? NaN)] ?? show(value, 5))} ${unitText(axis.unit)}`;
  return [
    escaped(hit.seriesName ?? ""),
    quantity(figure.x, x),
    quantity(figure.y, y),
    ...(z !== undefined && figure.scale ? [quantity(figure.scale, z)] : []),
    ...(typeof run === "number" ? [`run ${run}`] : []),
  ].join("<br>");
}

/** A dashed line in the legend. */
const DASHED = "path://M0 4h6v2h-6zM10 4h6v2h-6z";
/** Where a legend begins, and what lies between its names; pixels. */
const LEGEND_LEFT = 60;
const LEGEND_GAP = 10;

/** Lines that a legend takes; none where it would take too many, and is leafed through instead. */
function legendLines(names: string[], width: number): number | undefined {
  const [MOST, LETTER, ICON] = [4, 6.1, 23];
  let [lines, used] = [1, 0];
  for (const name of names) {
    const own = LETTER * name.length + ICON + LEGEND_GAP;
    if (used > 0 && used + own > width) [lines, used] = [lines + 1, 0];
    used += own;
  }
  return lines <= MOST ? lines : undefined;
}

/** The library's description of a figure. */
export function planeOption(figure: Figure, canvas: Canvas): Drawing {
  const look = LOOKS[canvas.theme];
  const drawn: Part[] = [];
  const legend = new Map<string, object>();
  const isScaled = figure.scale !== undefined && !figure.scale.quiet;
  for (const layer of figure.layers) {
    drawn.push(...parts(layer, figure, canvas));
    if (layer.kind !== "heat" && !("quiet" in layer && layer.quiet)) {
      const isArea = layer.kind === "area";
      legend.set(layer.name, layer.kind === "guide" ? { icon: DASHED } : isArea ? { itemStyle: { opacity: layer.opacity ?? AREA } } : {});
    }
  }
  const right = isScaled ? 100 : 20;
  const lines = legendLines([...legend.keys()], canvas.width - LEGEND_LEFT - right);
  // The scale's title stands below the legend, above its bar.
  const top = (legend.size > 0 ? 22 + 20 * (lines ?? 1) : 20) + (isScaled ? 20 : 0);
  const option: EChartsCoreOption = {
    animation: !canvas.isFile && !still(),
    animationDuration: 200,
    textStyle: { fontFamily: "system-ui, 'Segoe UI', Roboto, Arial, sans-serif" },
    ...(canvas.isFile ? { backgroundColor: look.paper } : {}),
    grid: {
      left: figure.y.categories ? wordRoom(figure.y.categories, canvas) : 82,
      right,
      top,
      bottom: 52,
    },
    legend: {
      type: lines === undefined ? "scroll" : "plain",
      top: 4,
      data: [...legend].map(([name, more]) => ({ name, ...more })),
      show: legend.size > 0,
      textStyle: { color: look.ink },
      pageTextStyle: { color: look.ink },
      pageIconColor: look.ink,
      itemWidth: 18,
      itemGap: LEGEND_GAP,
      right,
      left: LEGEND_LEFT,
    },
    tooltip: {
      trigger: "item",
      confine: true,
      formatter: (hit: Hit) => tip(figure, drawn, hit),
      backgroundColor: look.paper,
      textStyle: { color: look.ink },
      borderColor: look.rule,
    },
    ...(canvas.isFile
      ? {}
      : {
          dataZoom: [
            { type: "inside", xAxisIndex: 0, filterMode: "none", zoomOnMouseWheel: "ctrl" },
            { type: "inside", yAxisIndex: 0, filterMode: "none", zoomOnMouseWheel: "ctrl" },
          ],
        }),
    xAxis: axis(figure, "x", canvas),
    yAxis: axis(figure, "y", canvas),
    series: drawn.map((part) => part.series),
    graphic: figure.scale && isScaled ? scaleBar(figure.scale, canvas, top) : [],
  };
  return {
    option,
    idOf: (series, item) => drawn[series]?.ids?.[item] ?? drawn[series]?.id,
  };
}

// The only file that knows the plotting library: it draws what it is given.
import { CustomChart, LineChart, ScatterChart } from "echarts/charts";
import {
  DataZoomComponent,
  GridComponent,
  LegendComponent,
  TooltipComponent,
} from "echarts/components";
import { type EChartsCoreOption, type EChartsType, init, use } from "echarts/core";
import { CanvasRenderer } from "echarts/renderers";
import { show } from "./numbers";
import { logRange, logTicks } from "./ticks";

use([
  CanvasRenderer,
  CustomChart,
  DataZoomComponent,
  GridComponent,
  LegendComponent,
  LineChart,
  ScatterChart,
  TooltipComponent,
]);

/** A quantity's axis. */
export interface AxisSpec {
  name: string;
  log: boolean;
  /** Fixed ends, where the data should not choose them. */
  min?: number;
  max?: number;
}

export interface Point {
  x: number;
  y: number;
  /** What a click on the point reports. */
  id?: string;
}

export interface Scatter {
  kind: "points";
  name: string;
  points: Point[];
  hollow?: boolean;
  /** Name of a colour in the page's style. */
  color: string;
}

export interface Curve {
  kind: "curve";
  name: string;
  points: Point[];
  /** Name of a colour in the page's style. */
  color: string;
  dashed?: boolean;
}

/** The area between two curves over the same abscissae. */
export interface Area {
  kind: "area";
  name: string;
  x: number[];
  lower: number[];
  upper: number[];
  /** Name of a colour in the page's style. */
  color: string;
}

export interface Figure {
  x: AxisSpec;
  y: AxisSpec;
  layers: (Scatter | Curve | Area)[];
  onPoint?: (id: string) => void;
}

/** Colours of the page, read from its style. */
const css = (name: string): string =>
  getComputedStyle(document.documentElement).getPropertyValue(name).trim();

const still = (): boolean =>
  matchMedia("(prefers-reduced-motion: reduce)").matches || navigator.webdriver;

/** All coordinates drawn along an axis. */
const along = (figure: Figure, which: "x" | "y"): number[] =>
  figure.layers.flatMap((part) =>
    part.kind === "area"
      ? which === "x" ? part.x : [...part.lower, ...part.upper]
      : part.points.map((p) => p[which]),
  );

function axis(figure: Figure, which: "x" | "y"): object {
  const spec = figure[which];
  const horizontal = which === "x";
  const range = spec.log ? logRange(along(figure, which)) : undefined;
  const ticks = range ? { customValues: logTicks(range) } : {};
  return {
    type: spec.log ? "log" : "value",
    name: spec.name,
    nameLocation: "middle",
    nameGap: horizontal ? 32 : 62,
    nameTextStyle: { color: css("--ink"), fontSize: 13 },
    scale: true,
    min: range?.[0] ?? spec.min ?? null,
    max: range?.[1] ?? spec.max ?? null,
    axisLabel: { color: css("--faint"), formatter: tick, hideOverlap: true, ...ticks },
    axisLine: { show: true, lineStyle: { color: css("--rule") }, onZero: false },
    axisTick: { show: true, ...ticks },
    splitLine: { lineStyle: { color: css("--rule"), opacity: 0.5 } },
  };
}

function tick(value: number): string {
  const size = Math.abs(value);
  if (size >= 1e5 || (size > 0 && size < 1e-3)) {
    const order = Math.floor(Math.log10(size));
    const digits = [..."⁰¹²³⁴⁵⁶⁷⁸⁹"];
    const power = [...String(order)].map((c) => (c === "-" ? "⁻" : (digits[Number(c)] ?? c))).join("");
    const mantissa = Number((value / 10 ** order).toPrecision(3));
    return mantissa === 1 ? `10${power}` : `${mantissa}·10${power}`;
  }
  return String(Number(value.toPrecision(6)));
}

interface RenderApi {
  coord: (point: [number, number]) => [number, number];
}

function layer(part: Scatter | Curve | Area): object {
  const color = css(part.color);
  switch (part.kind) {
    case "points":
      return {
        type: "scatter",
        name: part.name,
        symbol: part.hollow ? "diamond" : "circle",
        symbolSize: part.hollow ? 8 : 9,
        data: part.points.map((p) => ({ value: [p.x, p.y], id: p.id })),
        itemStyle: part.hollow
          ? { color: "transparent", borderColor: color, borderWidth: 1.5 }
          : { color },
        emphasis: { scale: 1.6 },
        cursor: "pointer",
        z: 4,
      };
    case "curve":
      return {
        type: "line",
        name: part.name,
        data: part.points.map((p) => [p.x, p.y]),
        showSymbol: false,
        lineStyle: { color, width: 2, type: part.dashed ? "dashed" : "solid" },
        itemStyle: { color },
        z: 5,
      };
    case "area": {
      // One polygon in a custom series: stacked areas are wrong between log axes.
      const edge = [
        ...part.x.map((x, i): [number, number] => [x, part.upper[i] ?? x]),
        ...part.x.map((x, i): [number, number] => [x, part.lower[i] ?? x]).reverse(),
      ];
      return {
        type: "custom",
        name: part.name,
        itemStyle: { color },
        data: [edge[0]],
        encode: { x: 0, y: 1 },
        clip: true,
        silent: true,
        renderItem: (_: unknown, api: RenderApi) => ({
          type: "polygon",
          shape: { points: edge.map((p) => api.coord(p)) },
          style: { fill: css(part.color), opacity: 0.2 },
        }),
        z: 1,
      };
    }
  }
}

function option(figure: Figure): EChartsCoreOption {
  return {
    animation: !still(),
    grid: { left: 84, right: 18, top: 40, bottom: 52 },
    legend: { top: 4, textStyle: { color: css("--ink") }, itemWidth: 18 },
    tooltip: {
      trigger: "item",
      formatter: (hit: { seriesName?: string; value?: unknown }) => {
        const [px, py] = Array.isArray(hit.value) ? (hit.value as number[]) : [];
        return `${hit.seriesName ?? ""}<br>${figure.x.name}: ${show(px)}<br>${figure.y.name}: ${show(py)}`;
      },
      backgroundColor: css("--paper"),
      textStyle: { color: css("--ink") },
      borderColor: css("--rule"),
    },
    dataZoom: [
      { type: "inside", xAxisIndex: 0, filterMode: "none" },
      { type: "inside", yAxisIndex: 0, filterMode: "none" },
    ],
    xAxis: axis(figure, "x"),
    yAxis: axis(figure, "y"),
    series: figure.layers.map(layer),
  };
}

/** Draws a figure into an element and keeps it in step with it; for Svelte's `use:`. */
export function chart(
  element: HTMLElement,
  figure: Figure,
): { update: (next: Figure) => void; destroy: () => void } {
  let current = figure;
  const drawn: EChartsType = init(element);
  const draw = () => drawn.setOption(option(current), { notMerge: true });
  drawn.on("click", (event) => {
    const id = (event.data as { id?: string } | null)?.id;
    if (id !== undefined) current.onPoint?.(id);
  });
  const resize = new ResizeObserver(() => drawn.resize());
  resize.observe(element);
  const scheme = matchMedia("(prefers-color-scheme: dark)");
  scheme.addEventListener("change", draw);
  draw();
  return {
    update(next) {
      current = next;
      draw();
    },
    destroy() {
      scheme.removeEventListener("change", draw);
      resize.disconnect();
      drawn.dispose();
    },
  };
}

/** Colours of the page's figures, by their names in its style: safe for colour-blind eyes, light and
 * dark, looked up whenever a figure is drawn. */
export const palette = {
  force: "--force",
  quasiStatic: "--quasi-static",
  fit: "--fit",
  ice: "--ice",
} as const;

// A figure's layers as the plotting library's series. Part of the chart module.
import type { Canvas } from "./echarts";
import { AREA, type Curve, type Figure, type Interval, type Layer, type Scatter, share } from "./figure";
import { LOOKS, type Theme, viridis } from "./theme";

export type Numbers = (number | null)[];

/** Points of which more are drawn without outlines and marks of their own. */
const MANY = 4000;
/** Width of what the pointer meets of a curve's points, px. */
const POINTED = 12;
/** Shades in which points on a colour scale are drawn. */
const SHADES = 24;

/** Borders between the cells of a row, and its ends. */
export function edges(centres: number[], isLog = false): number[] {
  if (isLog && centres.every((c) => c > 0)) return edges(centres.map(Math.log)).map(Math.exp);
  const [first, second = (first ?? 0) + 1] = centres;
  if (first === undefined) return [];
  const inner = centres.slice(1).map((c, i) => ((centres[i] ?? c) + c) / 2);
  const last = centres.at(-1) ?? first;
  const before = centres.at(-2) ?? last - 1;
  return [first - (second - first) / 2, ...inner, last + (last - before) / 2];
}

interface RenderApi {
  coord: (point: [number, number]) => [number, number];
  value: (dimension: number) => number;
}

/** A series, and what a click on its items reports. */
export interface Part {
  series: object;
  ids?: ((number | string) | undefined)[];
  id?: number | string;
}

const pairs = (x: Numbers, y: Numbers, which?: number[]): (number | null)[][] =>
  (which ?? x.map((_, i) => i)).map((i) => [x[i] ?? null, y[i] ?? null]);

function paint(layer: { color?: keyof (typeof LOOKS)["light"]; value?: number }, figure: Figure, theme: Theme): string {
  if (layer.value !== undefined && figure.scale) return viridis(share(figure.scale, layer.value), theme);
  return LOOKS[theme][layer.color ?? "ink"];
}

/** A layer as series. */
export function parts(layer: Layer, figure: Figure, canvas: Canvas): Part[] {
  switch (layer.kind) {
    case "points":
      return points(layer, figure, canvas);
    case "interval":
      return intervals(layer, figure, canvas);
    case "curve":
      return [curve(layer, figure, canvas), ...arrowheads(layer, paint(layer, figure, canvas.theme))];
    case "area": {
      const color = paint(layer, figure, canvas.theme);
      // One polygon in a custom series: stacked areas are wrong between log axes.
      const edge = [
        ...layer.x.map((x, i): [number, number] => [x, layer.upper[i] ?? x]),
        ...layer.x.map((x, i): [number, number] => [x, layer.lower[i] ?? x]).reverse(),
      ];
      return [{
        series: {
          type: "custom",
          name: layer.name,
          itemStyle: { color },
          // All of the edge counts for the axes; the polygon is drawn once.
          data: edge,
          encode: { x: 0, y: 1 },
          clip: true,
          silent: true,
          renderItem: ({ dataIndex }: { dataIndex: number }, api: RenderApi) =>
            dataIndex > 0
              ? null
              : {
                  type: "polygon",
                  shape: { points: edge.map((p) => api.coord(p)) },
                  style: { fill: color, opacity: layer.opacity ?? AREA },
                },
          z: 1,
        },
      }];
    }
    case "heat": {
      const [xs, ys] = [edges(layer.x, figure.x.log), edges(layer.y, figure.y.log)];
      const cells = layer.z.flatMap((row, j) => row.flatMap((z, i) => (z === null ? [] : [[i, j, z]])));
      return [{
        series: {
          type: "custom",
          name: layer.name,
          data: cells.map(([i = 0, j = 0, z = 0]) => ({ value: [layer.x[i], layer.y[j], z], cell: [i, j] })),
          encode: { x: 0, y: 1 },
          clip: true,
          renderItem: (params: { dataIndex: number }, api: RenderApi) => {
            const [i = 0, j = 0, z = 0] = cells[params.dataIndex] ?? [];
            const [left, bottom] = api.coord([xs[i] ?? 0, ys[j] ?? 0]);
            const [right, top] = api.coord([xs[i + 1] ?? 0, ys[j + 1] ?? 0]);
            const fill = figure.scale ? viridis(share(figure.scale, z), canvas.theme) : LOOKS[canvas.theme].ice;
            const shape = { x: left, y: top, width: right - left + 0.5, height: bottom - top + 0.5 };
            return { type: "rect", shape, style: { fill } };
          },
          z: 1,
        },
      }];
    }
    case "guide":
      return [guide(layer, LOOKS[canvas.theme][layer.color ?? "faint"])];
  }
}

/** A line from edge to edge, drawn as a custom item since it has no ends in the data. */
function guide(layer: { name: string; x?: number; y?: number }, color: string): Part {
  return {
    series: {
      type: "custom",
      name: layer.name,
      itemStyle: { color },
      // What it has no value of must not widen the other axis.
      data: [[layer.x ?? NaN, layer.y ?? NaN]],
      encode: layer.x === undefined ? { y: 1 } : { x: 0 },
      silent: true,
      clip: true,
      renderItem: (params: { coordSys: { x: number; y: number; width: number; height: number } }, api: RenderApi) => {
        const [px, py] = api.coord([layer.x ?? 0, layer.y ?? 0]);
        const { x, y, width, height } = params.coordSys;
        const shape = layer.x === undefined
          ? { x1: x, x2: x + width, y1: py, y2: py }
          : { x1: px, x2: px, y1: y, y2: y + height };
        return { type: "line", shape, style: { stroke: color, lineDash: [5, 4], lineWidth: 1.2 } };
      },
      z: 3,
    },
  };
}

function points(layer: Scatter, figure: Figure, canvas: Canvas): Part[] {
  const { theme } = canvas;
  const many = layer.x.length > MANY;
  const part = (color: string, which?: number[]): Part => ({
    series: {
      type: "scatter",
      name: layer.name,
      symbol: layer.symbol ?? (layer.hollow ? "diamond" : "circle"),
      symbolSize: layer.size ?? (many ? 4 : layer.hollow ? 8 : 9),
      data: pairs(layer.x, layer.y, which),
      itemStyle: layer.hollow && !many ? { color: "transparent", borderColor: color, borderWidth: 1.5 } : { color, opacity: many ? 0.6 : 1 },
      emphasis: { scale: 1.6 },
      cursor: layer.ids && figure.onPoint ? "pointer" : "default",
      large: many,
      largeThreshold: MANY,
      progressive: 0,
      z: layer.hollow && many ? 3 : 4,
    },
    ids: (which ?? layer.x.map((_, i) => i)).map((i) => layer.ids?.[i]),
  });
  const { values } = layer;
  const { scale } = figure;
  if (!values || !scale) return [part(LOOKS[theme][layer.color ?? "ink"])];
  const shades: number[][] = Array.from({ length: SHADES }, () => []);
  values.forEach((value, i) => {
    if (value === null) return;
    const shade = Math.min(SHADES - 1, Math.max(0, Math.floor(share(scale, value) * SHADES)));
    shades[shade]?.push(i);
  });
  return shades.flatMap((which, shade) =>
    which.length === 0 ? [] : [part(viridis((shade + 0.5) / SHADES, theme), which)],
  );
}

/** Half the length of the strokes at a bar's ends, pixels. */
const CAP = 4;

/** Bars, and the marks on them. */
function intervals(layer: Interval, figure: Figure, canvas: Canvas): Part[] {
  const { x, y, lower, upper, lies = false, values, ...look } = layer;
  const color = LOOKS[canvas.theme][layer.color ?? "ink"];
  const bars = x.flatMap((at, i) => {
    const [a, b, c] = [lies ? y[i] : at, lower[i], upper[i]];
    if (a === null || a === undefined || b === null || b === undefined || c === null || c === undefined) return [];
    const value = values?.[i];
    const stroke = value === undefined || value === null || !figure.scale ? color : viridis(share(figure.scale, value), canvas.theme);
    return [{ ends: [b, c].map((v): [number, number] => (lies ? [v, a] : [a, v])), stroke }];
  });
  const bar: Part = {
    series: {
      type: "custom",
      name: layer.name,
      itemStyle: { color },
      // Both ends count for the axis that they lie along.
      data: bars.map(({ ends: [a, b] }) => [...(a ?? []), b?.[lies ? 0 : 1]]),
      encode: lies ? { x: [0, 2], y: 1 } : { x: 0, y: [1, 2] },
      silent: true,
      clip: true,
      renderItem: (params: { dataIndex: number }, api: RenderApi) => {
        const { ends, stroke } = bars[params.dataIndex] ?? { ends: [], stroke: color };
        const [[x1, y1] = [0, 0], [x2, y2] = [0, 0]] = ends.map((p) => api.coord(p));
        const style = { stroke, lineWidth: 1.6 };
        const line = (shape: object): object => ({ type: "line", shape, style });
        const cap = (cx: number, cy: number): object =>
          line(lies ? { x1: cx, x2: cx, y1: cy - CAP, y2: cy + CAP } : { x1: cx - CAP, x2: cx + CAP, y1: cy, y2: cy });
        return { type: "group", children: [line({ x1, y1, x2, y2 }), cap(x1, y1), cap(x2, y2)] };
      },
      z: 3,
    },
  };
  return [...points({ ...look, kind: "points", x, y, ...(values ? { values } : {}) }, figure, canvas), bar];
}

const DASHES = { solid: "solid", dashed: "dashed", dotted: "dotted" } as const;

function curve(layer: Curve, figure: Figure, canvas: Canvas): Part {
  const color = paint(layer, figure, canvas.theme);
  const isAlone = layer.x.length < 2;
  return {
    series: {
      type: "line",
      name: layer.name,
      data: pairs(layer.x, layer.y),
      // The points of a curve cannot be seen, but pointed at: there its numbers are read.
      showSymbol: isAlone || (!canvas.isFile && layer.x.length <= MANY),
      showAllSymbol: true,
      symbol: "circle",
      symbolSize: isAlone ? 6 : POINTED,
      connectNulls: false,
      lineStyle: {
        color,
        width: layer.width ?? 2,
        type: DASHES[layer.line ?? "solid"],
        ...(layer.halo ? { shadowBlur: 5, shadowColor: LOOKS[canvas.theme].paper } : {}),
      },
      itemStyle: { color, opacity: isAlone ? 1 : 0 },
      emphasis: {
        focus: layer.value === undefined ? "none" : "series",
        lineStyle: { width: (layer.width ?? 2) + 1.5 },
        itemStyle: { opacity: 1 },
        scale: false,
      },
      triggerEvent: layer.id !== undefined,
      cursor: layer.id !== undefined && figure.onPoint ? "pointer" : "default",
      z: 5,
    },
    ...(layer.id === undefined ? {} : { id: layer.id }),
  };
}

/** Arrowheads on a curve, turned as it runs on the screen. */
function arrowheads(layer: Curve, color: string): Part[] {
  if (!layer.arrows) return [];
  const ends = layer.arrows.flatMap((i) => {
    const [x, y, nextX, nextY] = [layer.x[i], layer.y[i], layer.x[i + 1], layer.y[i + 1]];
    return x == null || y == null || nextX == null || nextY == null ? [] : [{ from: [x, y], to: [nextX, nextY] }];
  });
  return [{
    series: {
      type: "custom",
      name: layer.name,
      itemStyle: { color },
      data: ends.map((end) => end.from),
      encode: { x: 0, y: 1 },
      clip: true,
      silent: true,
      renderItem: (params: { dataIndex: number }, api: RenderApi) => {
        const end = ends[params.dataIndex];
        if (!end) return null;
        const [[x, y], [nextX, nextY]] = [api.coord(end.from as [number, number]), api.coord(end.to as [number, number])];
        const turn = Math.atan2(nextY - y, nextX - x);
        const corner = (angle: number, size: number): [number, number] =>
          [x + size * Math.cos(turn + angle), y + size * Math.sin(turn + angle)];
        const points = [corner(0, 8), corner(2.5, 7), corner(-2.5, 7)];
        return { type: "polygon", shape: { points }, style: { fill: color } };
      },
      z: 6,
    },
  }];
}

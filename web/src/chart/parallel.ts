// Parallel coordinates as the plotting library's description.
import { tickText } from "../lib/ticks";
import type { Canvas, Drawing } from "./echarts";
import { type Parallel, axisLabel, share } from "./figure";
import { LOOKS, viridis } from "./theme";

const short = (value: number): string => tickText(Number(value.toPrecision(4)));

/** The library's description of a figure of parallel axes. */
export function parallelOption(figure: Parallel, canvas: Canvas): Drawing {
  const look = LOOKS[canvas.theme];
  const opacity = figure.rows.length > 500 ? 0.25 : 0.6;
  const option = {
    animation: false,
    textStyle: { fontFamily: "system-ui, 'Segoe UI', Roboto, Arial, sans-serif" },
    ...(canvas.isFile ? { backgroundColor: look.paper } : {}),
    parallel: { left: 60, right: 60, top: 56, bottom: 30 },
    parallelAxis: figure.axes.map((axis, dim) => ({
      dim,
      name: axisLabel(axis),
      type: axis.log ? "log" : "value",
      scale: true,
      min: axis.min ?? "dataMin",
      max: axis.max ?? "dataMax",
      // Neighbours' names would meet on one line.
      nameGap: dim % 2 === 0 ? 10 : 28,
      nameTextStyle: { color: look.ink, fontSize: 12 },
      axisLine: { lineStyle: { color: look.faint } },
      axisLabel: { color: look.ink, textBorderColor: look.paper, textBorderWidth: 3, formatter: short, showMinLabel: true, showMaxLabel: true, hideOverlap: true },
      // It is told where a hand has let go.
      realtime: false,
      areaSelectStyle: { color: look.force, opacity: 0.2, borderColor: look.force },
    })),
    series: [
      {
        type: "parallel",
        smooth: false,
        progressive: 0,
        inactiveOpacity: 0.03,
        activeOpacity: Math.max(0.5, opacity),
        lineStyle: { width: 1, opacity },
        data: figure.rows.map((row) => ({
          value: row.map((v) => v ?? "-"),
          lineStyle: { color: viridis(share(figure.scale, row[figure.colored] ?? NaN), canvas.theme) },
        })),
      },
    ],
  };
  return { option, idOf: (_, item) => figure.ids[item] };
}

// The only file that knows the plotting library: it draws what it is given, on the page or for a file.
import { CustomChart, LineChart, ParallelChart, ScatterChart } from "echarts/charts";
import {
  BrushComponent,
  DataZoomComponent,
  GraphicComponent,
  GridComponent,
  LegendComponent,
  ParallelComponent,
  TooltipComponent,
} from "echarts/components";
import { type EChartsCoreOption, type EChartsType, init, use } from "echarts/core";
import { CanvasRenderer, SVGRenderer } from "echarts/renderers";
import type { Range } from "../lib/brush";
import { type Figure, type Parallel, isParallel } from "./figure";
import { planeOption } from "./plane";
import { parallelOption } from "./parallel";
import { PRINT_DPI } from "./png";
import { LOOKS, type Theme } from "./theme";

use([
  BrushComponent,
  CanvasRenderer,
  CustomChart,
  DataZoomComponent,
  GraphicComponent,
  GridComponent,
  LegendComponent,
  LineChart,
  ParallelChart,
  ParallelComponent,
  ScatterChart,
  SVGRenderer,
  TooltipComponent,
]);

/** What the page shows. */
export interface Shown {
  figure: Figure | Parallel;
  theme: Theme;
}

/** Where and how a figure is drawn. */
export interface Canvas {
  width: number;
  height: number;
  theme: Theme;
  /** Whether it is drawn for a file: nothing moves, and nothing can be pointed at. */
  isFile: boolean;
}

/** A series of a drawing, with what a click on one of its items means. */
export interface Drawing {
  option: EChartsCoreOption;
  /** By index of the series, and of the item where items differ: the id that a click reports. */
  idOf: (series: number, item: number) => number | string | undefined;
}

const draw = (figure: Figure | Parallel, canvas: Canvas): Drawing =>
  isParallel(figure) ? parallelOption(figure, canvas) : planeOption(figure, canvas);

/** Draws a figure into an element and keeps it in step with it; for Svelte's `use:`. */
export function chart(
  element: HTMLElement,
  shown: Shown,
): { update: (next: Shown) => void; destroy: () => void } {
  let current = shown;
  const drawn: EChartsType = init(element);
  let drawing: Drawing;
  const redraw = (): void => {
    const { figure, theme } = current;
    drawing = draw(figure, { width: drawn.getWidth(), height: drawn.getHeight(), theme, isFile: false });
    drawn.setOption(drawing.option, { notMerge: true });
    brush(drawn, figure, theme);
  };
  // When the first picture was there, for whoever measures.
  let isSeen = false;
  drawn.on("rendered", () => {
    if (!isSeen) performance.mark("figure drawn");
    isSeen = true;
  });
  drawn.on("click", (event) => {
    const { figure } = current;
    const id = drawing.idOf(event.seriesIndex ?? -1, event.dataIndex);
    if (id !== undefined && !isParallel(figure)) figure.onPoint?.(id);
  });
  drawn.on("axisareaselected", () => {
    const { figure } = current;
    if (!isParallel(figure)) return;
    figure.onBrush?.(brushed(drawn, figure));
  });
  const resize = new ResizeObserver(() => {
    // As told once at the beginning.
    if (element.clientWidth === drawn.getWidth() && element.clientHeight === drawn.getHeight()) return;
    drawn.resize();
    redraw();
  });
  resize.observe(element);
  redraw();
  return {
    update(next) {
      if (next.figure === current.figure && next.theme === current.theme) return;
      const isSame = next.theme === current.theme && haveSameRows(next.figure, current.figure);
      current = next;
      if (isSame) brush(drawn, next.figure, next.theme);
      else redraw();
    },
    destroy() {
      resize.disconnect();
      drawn.dispose();
    },
  };
}

interface ParallelAxis {
  activeIntervals: [number, number][];
}
interface Model {
  getComponent: (type: "parallelAxis", index: number) => ParallelAxis | undefined;
}

/** Whether figures differ in nothing but their brushes. */
const haveSameRows = (a: Figure | Parallel, b: Figure | Parallel): boolean =>
  isParallel(a) && isParallel(b) && a.rows === b.rows && a.axes === b.axes && a.colored === b.colored;

/** What lies on the canvas, as far as brushes are concerned. */
interface Shape {
  name: string;
  draggable: boolean;
  setStyle: (style: object) => void;
}

/** Draws a figure's brushes. */
function brush(drawn: EChartsType, figure: Figure | Parallel, theme: Theme): void {
  if (!isParallel(figure)) return;
  const there = brushed(drawn, figure);
  const select = (parallelAxisIndex: number, range: Range): void =>
    drawn.dispatchAction({ type: "axisAreaSelect", parallelAxisIndex, intervals: range ? [range] : [] }, { silent: true });
  const wanted = figure.axes.map((_, i) => figure.brushes?.[i] ?? null);
  const differing = wanted.flatMap((range, i) => (range?.[0] === there[i]?.[0] && range?.[1] === there[i]?.[1] ? [] : [i]));
  for (const i of differing) select(i, wanted[i] ?? null);
  // An axis takes it that a hand has drawn its brush already, and draws it when another one is told of.
  if (differing.length > 0) select(figure.axes.length, null);
  // Brushes that no hand has drawn get the library's own colours, which hide the axis.
  const shapes = drawn.getZr().storage.getDisplayList(true) as unknown as Shape[];
  const { force } = LOOKS[theme];
  for (const shape of shapes) if (shape.name === "main" && shape.draggable) shape.setStyle({ fill: force, stroke: force, opacity: 0.3, lineWidth: 1 });
}

/** What is brushed, axis by axis; of several brushes on an axis the last one counts. */
function brushed(drawn: EChartsType, figure: Parallel): Range[] {
  // The library tells brushes through its model alone.
  const model = (drawn as unknown as { getModel: () => Model }).getModel();
  return figure.axes.map((_, i) => model.getComponent("parallelAxis", i)?.activeIntervals.at(-1) ?? null);
}

/** Millimetres of a picture that fills a page's text from side to side. */
const PRINT_MM = 174;
/** CSS pixels of a millimetre. */
const PX_PER_MM = 96 / 25.4;

const printed = (ratio: number): Canvas => {
  const width = Math.round(PRINT_MM * PX_PER_MM);
  return { width, height: Math.round(width * ratio), theme: "light", isFile: true };
};

/** The figure as a vector picture. */
export function svg(figure: Figure | Parallel, ratio: number): string {
  const canvas = printed(ratio);
  const { width, height } = canvas;
  const drawn = init(null, null, { renderer: "svg", ssr: true, width, height });
  drawn.setOption(draw(figure, canvas).option);
  brush(drawn, figure, canvas.theme);
  const text = drawn.renderToSVGString();
  drawn.dispose();
  return text;
}

/** The figure as pixels, for print: 174 mm wide at 600 dots per inch. */
export async function png(figure: Figure | Parallel, ratio: number): Promise<Blob> {
  const canvas = printed(ratio);
  const { width, height } = canvas;
  const element = document.createElement("div");
  const drawn = init(element, null, { renderer: "canvas", width, height, devicePixelRatio: PRINT_DPI / 96 });
  try {
    drawn.setOption(draw(figure, canvas).option);
    brush(drawn, figure, canvas.theme);
    const pixels = drawn.renderToCanvas({ backgroundColor: "#ffffff" });
    const blob = await new Promise<Blob | null>((done) => pixels.toBlob(done, "image/png"));
    if (!blob) throw new Error("the browser cannot draw a picture that large");
    return blob;
  } finally {
    drawn.dispose();
  }
}

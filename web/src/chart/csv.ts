// A figure as a table: exactly what is drawn, layer by layer.
import { within } from "../lib/brush";
import { type AxisSpec, type Figure, type Layer, type Parallel, isParallel } from "./figure";

/** A field. */
export type Value = number | string | null | undefined;

/** Rows of what is drawn, the first one the columns' names. */
export function table(figure: Figure | Parallel): Value[][] {
  if (isParallel(figure)) {
    const isInside = figure.brushes?.some((range) => range) ? within(figure.rows, figure.brushes) : undefined;
    return [
      ["run", ...figure.axes.map(column), ...(isInside ? ["brushed"] : [])],
      ...figure.rows.map((row, i) => [figure.ids[i], ...row, ...(isInside ? [isInside[i] ? "yes" : "no"] : [])]),
    ];
  }
  const scaled = figure.scale ? [column(figure.scale)] : [];
  const head = ["layer", column(figure.x), column(figure.y), "lower", "upper", ...scaled, "run"];
  const word = (axis: AxisSpec, value: Value): Value =>
    typeof value === "number" ? (axis.categories?.[Math.round(value)] ?? value) : value;
  const body = figure.layers.flatMap((layer) => rows(layer, figure.scale !== undefined));
  return [head, ...body.map(([name, x, y, ...more]) => [name, word(figure.x, x), word(figure.y, y), ...more])];
}

function rows(layer: Layer, isScaled: boolean): Value[][] {
  const row = (x: Value, y: Value, more: { lower?: Value; upper?: Value; value?: Value; run?: Value } = {}) => [
    layer.name, x, y, more.lower, more.upper, ...(isScaled ? [more.value] : []), more.run,
  ];
  switch (layer.kind) {
    case "points":
      return layer.x.map((x, i) => row(x, layer.y[i], { value: layer.values?.[i], run: layer.ids?.[i] }));
    case "curve":
      return layer.x.map((x, i) => row(x, layer.y[i], { value: layer.value, run: layer.id }));
    case "area":
      return layer.x.map((x, i) => row(x, null, { lower: layer.lower[i], upper: layer.upper[i], value: layer.value }));
    case "interval":
      return layer.x.map((x, i) => row(x, layer.y[i], { lower: layer.lower[i], upper: layer.upper[i], value: layer.values?.[i] }));
    case "heat":
      return layer.y.flatMap((y, j) => layer.x.map((x, i) => row(x, y, { value: layer.z[j]?.[i] })));
    case "guide":
      return [row(layer.x, layer.y)];
  }
}

const column = (axis: Pick<AxisSpec, "name" | "unit">): string =>
  axis.unit === "1" ? axis.name : `${axis.name} [${axis.unit}]`;

/** The table as CSV (RFC 4180), numbers in full. */
export const csv = (figure: Figure | Parallel): string =>
  table(figure).map((row) => row.map(field).join(",")).join("\r\n") + "\r\n";

function field(value: Value): string {
  if (value === null || value === undefined) return "";
  const text = String(value);
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

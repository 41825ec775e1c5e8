// What a figure is: plain data, before any library draws it. From the same data come the picture, its table, and the
// Python that draws it again.
import type { Range } from "../lib/brush";
import { unitText } from "../lib/numbers";
import type { ColourName } from "./theme";

/** A quantity's axis. */
export interface AxisSpec {
  name: string;
  /** As stored: "m a-1"; "1" for none. */
  unit: string;
  log?: boolean;
  /** Fixed ends, where the data should not choose them. */
  min?: number;
  max?: number;
  /** Words in place of numbers: 0 is the first one. */
  categories?: string[];
}

/** Where a layer's numbers come from, as Python expressions of the names in `Figure.data`. */
export interface Expressions {
  x: string;
  y: string;
  lower?: string;
  upper?: string;
}

interface Named {
  name: string;
  color?: ColourName;
  /** A place on the figure's colour scale, in place of a colour. */
  value?: number;
  python?: Expressions;
  /** Not listed in the legend. */
  quiet?: boolean;
}

export type Symbol = "circle" | "diamond" | "triangle" | "rect" | "cross";

/** Points, each of which may be a run. */
export interface Scatter extends Omit<Named, "value"> {
  kind: "points";
  x: (number | null)[];
  y: (number | null)[];
  /** What a click on a point reports: run indices or ids. */
  ids?: (number | string)[];
  /** Places on the figure's colour scale, point by point. */
  values?: (number | null)[];
  hollow?: boolean;
  symbol?: Symbol;
  size?: number;
}

export interface Curve extends Named {
  kind: "curve";
  x: (number | null)[];
  y: (number | null)[];
  line?: "solid" | "dashed" | "dotted";
  width?: number;
  /** Set off from points of its own colour. */
  halo?: boolean;
  /** What a click on the curve reports. */
  id?: number | string;
  /** Which way it is run through: arrowheads stand at these of its points. */
  arrows?: number[];
}

/** Opacity of an area that tells none of its own. */
export const AREA = 0.2;

/** The area between two curves over the same abscissae. */
export interface Area extends Named {
  kind: "area";
  x: number[];
  lower: number[];
  upper: number[];
  /** From 0 to 1; a light tint if not given. */
  opacity?: number;
}

/** Marks with bars from a least to a greatest value. */
export interface Interval extends Omit<Named, "value"> {
  kind: "interval";
  x: (number | null)[];
  y: (number | null)[];
  /** Ends of the bars: of y, or of x where they lie. */
  lower: (number | null)[];
  upper: (number | null)[];
  /** Whether the bars lie along x. */
  lies?: boolean;
  hollow?: boolean;
  symbol?: Symbol;
  /** Places on the figure's colour scale, mark by mark. */
  values?: (number | null)[];
}

/** Coloured rectangles about the points of a grid. */
export interface Heat {
  kind: "heat";
  name: string;
  /** Centres of the columns and rows, rising. */
  x: number[];
  y: number[];
  /** Row by row; null where nothing is known. */
  z: (number | null)[][];
  /** A Python expression for z, an array with a row for each y. */
  python?: string;
}

/** A straight line across the figure. */
export interface Guide {
  kind: "guide";
  name: string;
  /** Value of x for an upright line, of y for a level one. */
  x?: number;
  y?: number;
  color?: ColourName;
  /** Not listed in the legend. */
  quiet?: boolean;
}

export type Layer = Scatter | Curve | Area | Interval | Heat | Guide;

/** What colours mean. */
export interface Scale {
  name: string;
  unit: string;
  min: number;
  max: number;
  log?: boolean;
  /** Not drawn as a bar, where the legend names the values. */
  quiet?: boolean;
}

/** A figure with two axes. */
export interface Figure {
  title: string;
  x: AxisSpec;
  y: AxisSpec;
  layers: Layer[];
  scale?: Scale;
  /** Resources that `Expressions` read, by name: paths below `api/v1/`. */
  data?: Record<string, string>;
  /** What is not shown, or else has to be said wherever the figure goes. */
  notes?: string[];
  onPoint?: (id: number | string) => void;
}

/** Many quantities of many runs, an axis each. */
export interface Parallel {
  title: string;
  axes: AxisSpec[];
  /** A row for each run, a number for each axis. */
  rows: (number | null)[][];
  ids: (number | string)[];
  /** Which axis gives the colour. */
  colored: number;
  scale: Scale;
  data?: Record<string, string>;
  /** A Python expression for each axis. */
  python?: string[];
  notes?: string[];
  /** What is looked at, axis by axis; rows outside are faint. */
  brushes?: Range[];
  /** Told when somebody brushes. */
  onBrush?: (brushes: Range[]) => void;
}

export const isParallel = (figure: Figure | Parallel): figure is Parallel => "axes" in figure;

/** A quantity's name with its unit in brackets. */
export function axisLabel(axis: { name: string; unit: string }): string {
  const unit = unitText(axis.unit);
  return unit ? `${axis.name} (${unit})` : axis.name;
}

/** Where a value stands on a scale, from 0 to 1. */
export function share(scale: Scale, value: number): number {
  const by = scale.log && scale.min > 0 ? Math.log : (v: number) => v;
  const [low, high] = [by(scale.min), by(scale.max)];
  return high > low ? (by(value) - low) / (high - low) : 0.5;
}

// Ensembles overlaid in one figure: each one's points and law, by colour and symbol.
import type { Dictionary, Law } from "../api";
import { type Laws, lawsPath } from "../api/analysis";
import type { Expressions, Figure, Layer, Scatter, Symbol } from "../chart/figure";
import type { ColourName } from "../chart/theme";
import { words_of } from "./numbers";
import { capital, timesPython } from "./quantities";
import { type Speed, scaled, shownIn } from "./units";
import { countText } from "./words";

/** Ensembles that can be told apart in one figure. */
export const MOST_COMPARED = 6;
/** Points of each that are drawn. */
export const POINTS = 5000;
/** Points of which more are drawn small. */
const MANY = 500;

const COLOURS: ColourName[] = ["set1", "set2", "set3", "set4", "set5", "set6"];
const SYMBOLS: Symbol[] = ["circle", "diamond", "triangle", "rect", "cross", "circle"];
const LINES = ["solid", "dashed", "dotted", "solid", "dashed", "dotted"] as const;

export interface Overlaid {
  id: string;
  name: string;
  laws: Laws | undefined;
}

/** The figure of y against x. */
export function overlay(ensembles: Overlaid[], x: string, y: string, model: Law, dictionary: Dictionary, speed: Speed): Figure {
  const unitOf = (name: string): string => [...dictionary.parameters, ...dictionary.scalars].find((e) => e.name === name)?.unit ?? "1";
  const [alongX, alongY] = [shownIn(unitOf(x), speed), shownIn(unitOf(y), speed)];
  const points: Scatter[] = [];
  const curves: Layer[] = [];
  const data: Record<string, string> = {};
  const notes: string[] = [];
  let [isPositiveX, isPositiveY] = [true, true];
  ensembles.forEach(({ id, name, laws }, i) => {
    const group = laws?.groups[0];
    if (!laws || !group) return;
    const key = `laws_${i + 1}`;
    data[key] = lawsPath(id, { x, y, model, most: POINTS });
    const at = (path: string): Expressions => ({
      x: timesPython(`${key}["groups"][0]${path}["x"]`, alongX.factor),
      y: timesPython(`${key}["groups"][0]${path}["y"]`, alongY.factor),
    });
    const color = COLOURS[i % COLOURS.length] ?? "ink";
    isPositiveX &&= group.points.x.every((v) => v > 0);
    isPositiveY &&= group.points.y.every((v) => v > 0);
    points.push({
      kind: "points", name, color, symbol: SYMBOLS[i % SYMBOLS.length] ?? "circle", size: group.points.x.length > MANY ? 3 : 7,
      x: scaled(group.points.x, alongX.factor), y: scaled(group.points.y, alongY.factor), ids: group.points.run_index, python: at('["points"]'),
    });
    if (group.fit) {
      const { band } = group.fit;
      curves.push({
        kind: "curve", name: `${name}, law`, color, line: LINES[i % LINES.length] ?? "solid", quiet: true,
        x: scaled(band.x, alongX.factor), y: scaled(band.y, alongY.factor), python: at('["fit"]["band"]'),
      });
    }
    const used = group.n_runs - group.left_out.reduce((sum, { count }) => sum + count, 0);
    if (group.points.x.length < used) {
      notes.push(`Showing ${countText(group.points.x.length)} of ${countText(used)} runs of “${name}”: a random choice that is always the same. The law uses all.`);
    }
  });
  const isLogX = model === "power_law" && isPositiveX;
  const isLogY = model !== "linear" && isPositiveY;
  return {
    title: `${capital(words_of(y))} against ${words_of(x)}, ${ensembles.length} ensembles`,
    x: { name: words_of(x), unit: alongX.unit, log: isLogX },
    y: { name: words_of(y), unit: alongY.unit, log: isLogY },
    // The few lie on the many, and the laws on all of them.
    layers: [...points.sort((a, b) => b.x.length - a.x.length), ...curves],
    data,
    notes,
  };
}

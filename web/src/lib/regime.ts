// What a document needs beside its regime, and what another regime would refuse.
import { type Doc, type Json, put } from "./spec";

/** Members that only these regimes have. */
const OWN: Record<string, string[]> = {
  time: ["transient"],
  forcing: ["transient"],
  start: ["transient", "diagnostic"],
  calving_law: ["transient", "branch"],
  length_m: ["quasi_static"],
  thickness_0_m: ["quasi_static"],
  volume_m3: ["quasi_static"],
  branch: ["branch"],
  fold_curve: ["fold_curve"],
  calibration: ["calibration"],
};

/** What a regime begins with, if nothing is known. */
const NEEDED: Record<string, Doc> = {
  transient: { start: "steady", time: { duration_a: 3, output_every_a: 0.01 } },
  quasi_static: { length_m: 12000 },
  branch: { branch: { control: "melt_rate_m_per_day", from: 0.1, to: 1 } },
  diagnostic: { start: { length_m: 10000, thickness_0_m: 75 } },
  fold_curve: {
    fold_curve: { control: "melt_rate_m_per_day", from: 0.1, to: 1, second: "width_m", second_from: 3000, second_to: 7000 },
  },
};

/** A document and what another regime took away from it, to be given back. */
export interface Kept {
  doc: Doc;
  aside: Doc;
}

/** The document with another regime. */
export function withRegime({ doc, aside }: Kept, regime: string): Kept {
  const away: [string, Json][] = [];
  let next = put(doc, ["regime"], regime);
  for (const [name, regimes] of Object.entries(OWN)) {
    const value = doc[name];
    if (value === undefined || regimes.includes(regime)) continue;
    away.push([name, value]);
    next = put(next, [name], undefined);
  }
  const kept: Doc = { ...aside, ...Object.fromEntries(away) };
  const back = Object.entries(OWN).filter(([name, regimes]) => regimes.includes(regime) && name in kept && !(name in next));
  for (const [name] of back) next = put(next, [name], kept[name]);
  for (const [name, value] of Object.entries(NEEDED[regime] ?? {})) {
    const hasOther = regime === "quasi_static" && ["length_m", "thickness_0_m", "volume_m3"].some((other) => other in next);
    if (!(name in next) && !hasOther) next = put(next, [name], value);
  }
  return { doc: next, aside: kept };
}

/** Members of a document that the form shows. */
const SHOWN = new Set([
  "name", "tags", "regime", "parameters", "axes", "sample", "time", "forcing", "options", "length_m", "thickness_0_m", "volume_m3",
  "branch", "melt_shape", "start",
]);

/** Members that only the text shows. */
export const notShown = (doc: Doc): string[] => Object.keys(doc).filter((name) => !SHOWN.has(name));

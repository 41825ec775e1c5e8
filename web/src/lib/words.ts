// Sizes, times and counts as people read them.
import type { Counts } from "../api";

/** Made once: making it takes longer than all counts of a page. */
const COUNTS = new Intl.NumberFormat("en");

/** A count with its thousands apart. */
export const countText = (n: number): string => COUNTS.format(n);

const TIMES = new Intl.DateTimeFormat(undefined, { dateStyle: "medium", timeStyle: "medium" });

/** A time as its reader's own language has it. */
export const timeText = (time: Date): string => (Number.isNaN(time.getTime()) ? "" : TIMES.format(time));

/** A count with its noun. */
export const several = (n: number, one: string, many = `${one}s`): string => `${countText(n)} ${n === 1 ? one : many}`;

/** Bytes as `12 MB`. */
export function bytesText(bytes: number): string {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let [value, unit] = [bytes, 0];
  while (value >= 999.5 && unit < units.length - 1) [value, unit] = [value / 1000, unit + 1];
  return `${value >= 9.95 || unit === 0 ? value.toFixed(0) : value.toFixed(1)} ${units[unit] ?? ""}`;
}

/** Seconds as `2 min`, with one digit more where it tells something. */
export function durationText(seconds: number): string {
  if (seconds < 1) return "less than a second";
  if (seconds < 90) return `${seconds.toFixed(0)} s`;
  if (seconds < 90 * 60) return `${(seconds / 60).toFixed(0)} min`;
  const hours = seconds / 3600;
  if (hours < 36) return `${hours.toFixed(hours < 9.95 ? 1 : 0)} h`;
  return `${(hours / 24).toFixed(hours < 240 ? 1 : 0)} days`;
}

/** How long ago a time is; the service's clock may be a little ahead. */
export function ageText(iso: string, now: number): string {
  const seconds = (now - Date.parse(iso)) / 1000;
  if (!Number.isFinite(seconds)) return "";
  if (seconds < 60) return "just now";
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min ago`;
  if (seconds < 86_400) return `${Math.floor(seconds / 3600)} h ago`;
  const days = Math.floor(seconds / 86_400);
  if (days < 60) return days === 1 ? "yesterday" : `${days} days ago`;
  return days < 730 ? `${Math.floor(days / 30.4)} months ago` : `${Math.floor(days / 365.25)} years ago`;
}

/** What runs come to: solved, a verdict of the model, a failure of the solver, or not yet anything. */
export type Kind = "solved" | "verdict" | "failed" | "running" | "waiting";

const KINDS: [keyof Counts, Kind][] = [
  ["converged", "solved"],
  ["completed", "solved"],
  ["no_steady_state", "verdict"],
  ["no_fold", "verdict"],
  ["collapsed", "verdict"],
  ["overthick", "verdict"],
  ["fjord_closed", "verdict"],
  ["failed", "failed"],
  ["running", "running"],
  ["queued", "waiting"],
  ["cancelled", "waiting"],
];

export interface Outcomes {
  name: string;
  kind: Kind;
  count: number;
}

/** A sweep's runs by what they came to, without what there is none of. */
export const outcomes = (counts: Counts): Outcomes[] =>
  KINDS.map(([name, kind]) => ({ name: name.replaceAll("_", " "), kind, count: counts[name] })).filter((o) => o.count > 0);

/** The same as a sentence's part. */
export const outcomesText = (counts: Counts): string =>
  outcomes(counts).map((o) => `${countText(o.count)} ${o.name}`).join(", ");

/** What became of the runs that a cancelled ensemble left. */
export const neverSolved = (left: number, total: number): string =>
  `${countText(left)} of ${several(total, "run")} ${left === 1 ? "was" : "were"} never solved: the ensemble was cancelled.`;

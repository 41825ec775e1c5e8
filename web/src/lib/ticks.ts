// Where a logarithmic axis starts and ends, and where its ticks stand.
import { superscript } from "./numbers";

/** Share of the data's extent that is left free at either end of an axis. */
const MARGIN = 0.05;

/** Ends of a logarithmic axis around positive values. */
export function logRange(values: number[]): [number, number] {
  const logs = values.filter((v) => v > 0).map(Math.log);
  if (logs.length === 0) return [0.1, 10];
  const low = logs.reduce((a, b) => Math.min(a, b));
  const high = logs.reduce((a, b) => Math.max(a, b));
  const margin = high > low ? MARGIN * (high - low) : Math.LN2;
  return [Math.exp(low - margin), Math.exp(high + margin)];
}

/** Round values within a logarithmic axis: 1, 2, 5 and their tenfolds, or finer within a decade. */
export function logTicks([low, high]: [number, number]): number[] {
  /** A decade with fewer ticks than this gets evenly spaced ones. */
  const FEWEST = 4;
  const ticks: number[] = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power += 1) {
    for (const m of [1, 2, 5]) ticks.push(Number(`${m}e${power}`));
  }
  const inside = ticks.filter((t) => t >= low && t <= high);
  return inside.length >= FEWEST ? inside : evenTicks(low, high);
}

/** Multiples of a round step within an interval, about six of them. */
function evenTicks(low: number, high: number): number[] {
  const rough = (high - low) / 6;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough) ?? rough;
  const first = Math.ceil(low / step);
  const count = Math.floor(high / step) - first + 1;
  return Array.from({ length: count }, (_, i) => Number(((first + i) * step).toPrecision(12)));
}

/** A tick's number: plain, or with a power of ten where it is large or small. */
export function tickText(value: number): string {
  const size = Math.abs(value);
  if (size >= 1e5 || (size > 0 && size < 1e-3)) {
    const order = Math.floor(Math.log10(size));
    const mantissa = Number((value / 10 ** order).toPrecision(3));
    const power = `10${superscript(order)}`;
    return (mantissa === 1 ? power : `${mantissa}·${power}`).replace("-", "−");
  }
  return String(Number(value.toPrecision(6))).replace("-", "−");
}

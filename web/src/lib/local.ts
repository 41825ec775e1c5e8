// Local sensitivities d ln Q/d ln p of runs, as they are stored with a result.
import type { Outcome } from "../api";

/** A quantity's logarithmic derivatives by parameter; null where there is none. */
export interface Local {
  quantity: string;
  by: Record<string, number | null>;
}

const PREFIX = "log_by_";

/** The derivatives of a result. */
export function localOf(outcome: Outcome): Local[] {
  return (outcome.sensitivities ?? []).map((row) => {
    const { quantity = "", ...rest } = row as Record<string, unknown> & { quantity?: string };
    const by = Object.entries(rest).flatMap(([name, value]) =>
      name.startsWith(PREFIX) ? [[name.slice(PREFIX.length), typeof value === "number" ? value : null] as const] : [],
    );
    return { quantity, by: Object.fromEntries(by) };
  });
}

/** Parameters of which there is any derivative other than 0, the strongest first: by the first quantity, then by any. */
export function ranked(locals: Local[], quantity: string): string[] {
  const strength = (parameter: string, of: Local[]): number =>
    of.reduce((most, local) => Math.max(most, Math.abs(local.by[parameter] ?? 0)), 0);
  const main = locals.filter((local) => local.quantity === quantity);
  const names = [...new Set(locals.flatMap((local) => Object.keys(local.by)))];
  return names
    .filter((name) => strength(name, locals) > 0)
    .sort((a, b) => strength(b, main) - strength(a, main) || strength(b, locals) - strength(a, locals));
}

/** At most so many places of a rising list, evenly spread, with both ends. */
export function spread<T>(items: T[], most: number): T[] {
  if (items.length <= most) return items;
  return Array.from({ length: most }, (_, i) => items[Math.round((i * (items.length - 1)) / (most - 1))] as T);
}

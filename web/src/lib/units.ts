// Units as the page shows them: speeds by the day or by the year, at a switch; everything else as it is stored.

/** Days in a year of 365.25 days. */
export const DAYS_PER_YEAR = 365.25;

/** How speeds are shown. */
export type Speed = "m_per_day" | "m_per_a";

/** What a stored number is multiplied by to be shown in a unit. */
export interface Shown {
  unit: string;
  factor: number;
}

/** How numbers of a stored unit are shown. */
export function shownIn(unit: string, speed: Speed): Shown {
  if (unit === "m a-1" && speed === "m_per_day") return { unit: "m d-1", factor: 1 / DAYS_PER_YEAR };
  if (unit === "m d-1" && speed === "m_per_a") return { unit: "m a-1", factor: DAYS_PER_YEAR };
  return { unit, factor: 1 };
}

/** Numbers multiplied; a null stays null. */
export function scaled(values: number[], factor: number): number[];
export function scaled(values: (number | null)[], factor: number): (number | null)[];
export function scaled(values: (number | null)[], factor: number): (number | null)[] {
  return factor === 1 ? values : values.map((v) => (v === null ? null : v * factor));
}

/** Powers of a unit's parts: "N m-1" is N¹ m⁻¹. */
function powers(unit: string): Map<string, number> {
  const found = new Map<string, number>();
  for (const part of unit.split(" ")) {
    const [, name, power] = /^([^\d-]+)(-?\d+)?$/.exec(part) ?? [];
    if (name !== undefined) found.set(name, (found.get(name) ?? 0) + Number(power ?? 1));
  }
  return found;
}

/** The unit of one quantity over another; "1" where nothing is left. */
export function quotient(over: string, under: string): string {
  const all = powers(over);
  for (const [name, power] of powers(under)) all.set(name, (all.get(name) ?? 0) - power);
  const parts = [...all].filter(([, power]) => power !== 0).map(([name, power]) => (power === 1 ? name : `${name}${power}`));
  return parts.length === 0 ? "1" : parts.join(" ");
}

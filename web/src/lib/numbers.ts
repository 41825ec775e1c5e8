// Numbers as people read them, and the little arithmetic the page does itself.

/** Density of ice over that of sea water: the share of the thickness below sea level. */
export const SUBMERGED = 917 / 1028;

const superscripts: Record<string, string> = { "-": "⁻", "+": "" };
for (const [i, s] of [..."⁰¹²³⁴⁵⁶⁷⁸⁹"].entries()) superscripts[String(i)] = s;

export const superscript = (n: number): string =>
  [...String(n)].map((c) => superscripts[c] ?? c).join("");

/** A number with the given significant digits, as a power of ten where it is large or small. */
export function show(value: number | null | undefined, digits = 4): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const order = Math.floor(Math.log10(Math.abs(value)));
  if (order >= 6 || order < -3) {
    const mantissa = value / 10 ** order;
    return `${minus(mantissa.toFixed(digits - 1))} × 10${superscript(order)}`;
  }
  return minus(value.toFixed(Math.max(0, digits - 1 - order)));
}

const minus = (text: string): string => text.replace("-", "−");

/** A unit such as "m a-1" set as "m a⁻¹"; nothing for "1". */
export const unitText = (unit: string): string =>
  unit === "1"
    ? ""
    : unit.replace(/(-?\d+)/g, (digits) => superscript(Number(digits)));

/** A label with its unit in brackets. */
export function label(entry: { name: string; unit: string } | undefined, name: string): string {
  const unit = entry ? unitText(entry.unit) : "";
  const words = words_of(name);
  return unit ? `${words} (${unit})` : words;
}

/** What the field and the paper call quantities, where that is better than the interface's own words. */
const TERMS: Record<string, string> = {
  terminus_velocity_m_per_a: "glacier speed U_t",
  calving_rate_m_per_a: "calving rate U_c",
  terminus_thickness_m: "glacier thickness H_t",
  melt_rate_m_per_day: "melt rate",
  width_m: "fjord width W",
  width_gradient: "width gradient dW/dx",
  d_m: "iceberg size d",
  mu_s: "yield coefficient μ_s",
  length_m: "length L",
  thickness_0_m: "thickness at the terminus H₀",
  force_n_per_m: "force per unit width F/W",
  force_quasi_static_n_per_m: "quasi-static estimate of F/W",
  velocity_end_m_per_a: "speed at the end U_L",
  volume_m3: "volume",
  terminus_x_m: "position of the terminus X₀",
};

const suffixes = /_(m_per_a|m_per_day|n_per_m|per_a|m3|m|a)$/;

/** What is better written than its name, whatever its unit. */
const WRITTEN: Record<string, string> = { mu_w: "μ_w", n_cells: "cells" };

/** What a quantity is called on the page: the one place where names of the interface become words. */
export function words_of(name: string): string {
  const bare = name.replace(suffixes, "");
  return TERMS[name] ?? WRITTEN[bare] ?? bare.replaceAll("_", " ");
}

/** Heights of the mélange's surface and base above sea level, at flotation. */
export const freeboard = (thickness_m: number): { surface: number; base: number } => ({
  surface: (1 - SUBMERGED) * thickness_m,
  base: -SUBMERGED * thickness_m,
});

/** Cells' thickness with both ends, to which the model extrapolates it linearly (Eq. 22, C1). */
export function withEnds(thickness_m: number[]): number[] {
  const end = (h: number, next: number): number => (3 * h - next) / 2;
  const [first = 0, second = 0] = thickness_m;
  const [beforeLast = 0, last = 0] = thickness_m.slice(-2);
  return [end(first, second), ...thickness_m, end(last, beforeLast)];
}

// Quantities by their names in the interface: what they are called, and in which unit the page shows them.
import { unitText, words_of } from "./numbers";
import { type Speed, shownIn } from "./units";

interface Entry {
  name: string;
  unit: string;
  meaning: string;
}

interface Dictionary {
  parameters: Entry[];
  scalars: Entry[];
  controls?: { name: string; unit: string }[];
  series?: Entry[];
}

/** Where the field has a better name than the interface's own words. */
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

/** Units where neither dictionary nor name tell one. */
const SERIES: Record<string, string> = { time_a: "a" };

export interface Quantity {
  /** In the interface. */
  key: string;
  /** On the page. */
  name: string;
  /** As it is shown. */
  unit: string;
  /** What a stored number is multiplied by to be shown. */
  factor: number;
  meaning: string;
}

/** A quantity of the dictionary as the page shows it. */
export function quantity(dictionary: Dictionary, key: string, speed: Speed): Quantity {
  const { parameters, scalars, series = [], controls = [] } = dictionary;
  const entry: { unit: string; meaning?: string } | undefined =
    [...parameters, ...scalars, ...series].find((e) => e.name === key) ?? controls.find((e) => e.name === key);
  const { unit, factor } = shownIn(entry?.unit ?? SERIES[key] ?? "1", speed);
  return { key, name: TERMS[key] ?? words_of(key), unit, factor, meaning: entry?.meaning ?? "" };
}

/** A stored number with its name and unit, as in "melt rate 0.6 m d⁻¹". */
export function told(q: Quantity, value: number | null | undefined): string {
  if (value === null || value === undefined) return `${q.name} –`;
  const number = Number((value * q.factor).toPrecision(4));
  const size = Math.abs(number);
  const text = size >= 1e6 || (size > 0 && size < 1e-3) ? number.toExponential(3) : String(number);
  return `${q.name} ${text.replace("-", "−")} ${unitText(q.unit)}`.trim();
}

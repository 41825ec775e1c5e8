// A fitted law in the units in which it is shown. The service fits stored numbers; what changes with the units are
// prefactors, rates and slopes, and the interval of a power law's prefactor.
import type { Fit, Law } from "../api";
import { show, unitText } from "./numbers";
import { capital } from "./quantities";
import { type Shown, quotient } from "./units";

export interface Interval {
  estimate: number;
  low: number;
  high: number;
}

/** A law's numbers as shown. */
export interface ShownLaw {
  exponent: Interval;
  prefactor: Interval;
}

/** The service's names of laws, with what people call them and the number that matters most in each. */
export const LAWS: Record<Law, { name: string; number: string; prefactor: string; isLogX: boolean; isLogY: boolean }> = {
  power_law: { name: "power law", number: "exponent", prefactor: "prefactor", isLogX: true, isLogY: true },
  exponential: { name: "exponential law", number: "rate", prefactor: "prefactor", isLogX: false, isLogY: true },
  linear: { name: "linear law", number: "slope", prefactor: "intercept", isLogX: false, isLogY: false },
};

export const isLaw = (text: string | undefined): text is Law => text !== undefined && Object.hasOwn(LAWS, text);

const times = ({ estimate, ci95 }: Fit["exponent"], factor: number): Interval => {
  const [low = NaN, high = NaN] = ci95;
  return { estimate: estimate * factor, low: low * factor, high: high * factor };
};

/** By what a law's exponent, rate or slope is multiplied. */
export function exponentFactor(model: Law, x: Shown, y: Shown): number {
  if (model === "power_law") return 1;
  return model === "exponential" ? 1 / x.factor : y.factor / x.factor;
}

/** Unit of a law's exponent, rate or slope. */
export function exponentUnit(model: Law, x: Shown, y: Shown): string {
  if (model === "power_law") return "1";
  return quotient(model === "exponential" ? "1" : y.unit, x.unit);
}

/** The fit in the units of x and y. */
export function shownLaw(fit: Fit, x: Shown, y: Shown): ShownLaw {
  const exponent = times(fit.exponent, exponentFactor(fit.model, x, y));
  if (fit.model !== "power_law" || x.factor === 1) return { exponent, prefactor: times(fit.prefactor, y.factor) };
  // The prefactor is the law's value where x is 1 of the shown unit.
  const u = -Math.log(x.factor);
  const centre = Math.log(fit.prefactor.estimate) + fit.exponent.estimate * u;
  const half = halfWidth(fit, u);
  const at = (ln: number): number => y.factor * Math.exp(ln);
  return { exponent, prefactor: { estimate: at(centre), low: at(centre - half), high: at(centre + half) } };
}

/** Half the width of a power law's band in ln y where ln x is `u`. Its square is a quadratic of `u`, which is known
 *  from the intervals of exponent and prefactor and one place of the band. */
function halfWidth(fit: Fit, u: number): number {
  const half = (low: number, high: number): number => (high - low) / 2;
  const [nLow = NaN, nHigh = NaN] = fit.exponent.ci95;
  const [cLow = NaN, cHigh = NaN] = fit.prefactor.ci95;
  const curvature = half(nLow, nHigh) ** 2;
  const atOne = half(Math.log(cLow), Math.log(cHigh)) ** 2;
  const { x, lower, upper } = fit.band;
  const farthest = x.reduce((best, v, i) => (Math.abs(Math.log(v)) > Math.abs(Math.log(x[best] ?? 1)) ? i : best), 0);
  const v = Math.log(x[farthest] ?? NaN);
  const there = half(Math.log(lower[farthest] ?? NaN), Math.log(upper[farthest] ?? NaN)) ** 2;
  const slope = (there - atOne - curvature * v * v) / v;
  return Math.sqrt(Math.max(0, atOne + slope * u + curvature * u * u));
}

const factorText = (unit: string): string => (unit === "1" ? "" : ` ${unitText(unit)}`);

/** The law as a formula; `number` is left for the caller, who may mark it. */
export function formula(model: Law, x: string, y: string, units: { x: Shown; y: Shown }, law: ShownLaw): { before: string; number: string; after: string } {
  const prefactor = show(law.prefactor.estimate, 4);
  const exponent = show(law.exponent.estimate, 4);
  const unit = factorText(units.y.unit);
  const unitOfExponent = factorText(exponentUnit(model, units.x, units.y));
  switch (model) {
    case "power_law": {
      const base = units.x.unit === "1" ? `(${x})` : `(${x} / 1${factorText(units.x.unit)})`;
      return { before: `${y} ≈ ${prefactor}${unit} · ${base}`, number: exponent, after: "" };
    }
    case "exponential":
      return { before: `${y} ≈ ${prefactor}${unit} · exp(`, number: exponent, after: `${unitOfExponent} · ${x})` };
    case "linear":
      return { before: `${y} ≈ ${prefactor}${unit} + (`, number: exponent, after: `${unitOfExponent}) · ${x}` };
  }
}

/** What the law says of a change of x that one can picture. */
export function consequence(model: Law, x: string, y: string, units: { x: Shown; y: Shown }, law: ShownLaw): string {
  const { estimate } = law.exponent;
  const changes = (share: number): string => (share >= 0 ? `${show(100 * share, 3)} % greater` : `${show(-100 * share, 3)} % less`);
  switch (model) {
    case "power_law":
      return `With 10 % more ${x}, ${y} is ${changes(1.1 ** estimate - 1)}.`;
    case "exponential":
      return `${capital(y)} ${estimate < 0 ? "falls to half" : "doubles"} over ${show(Math.LN2 / Math.abs(estimate), 3)}${factorText(units.x.unit)} of ${x}.`;
    case "linear":
      return `${capital(y)} changes by ${show(estimate, 3)}${factorText(units.y.unit)} for each${units.x.unit === "1" ? " 1" : factorText(units.x.unit)} of ${x}.`;
  }
}

// What the parts of the form are handed: the document, how it is changed, and what was refused.
import type { Dictionary } from "../../api";
import { label, unitText } from "../../lib/numbers";
import type { Doc } from "../../lib/spec";

export interface Refusal {
  field: string | undefined;
  /** As the service told it. */
  text: string;
  /** The same, at the field. */
  message: string;
}

export interface Form {
  doc: Doc;
  change: (doc: Doc) => void;
  refusal: Refusal | undefined;
  dictionary: Dictionary;
}

/** What a sweep may vary beside the parameters. */
const FLUX = { name: "calving_flux_m2_per_a", unit: "m2 a-1" };

/** Parameters by name with their labels, for a select. */
export const choices = (dictionary: Dictionary): { name: string; text: string }[] =>
  [...dictionary.parameters, FLUX].map((p) => ({ name: p.name, text: label(p, p.name) }));

/** The label of a member, with its unit. */
export const named = (name: string, unit: string): string => (unit === "1" ? name : `${name} (${unitText(unit)})`);

// A refused filter, marked where it is refused.
import { Problem } from "../api/client";

/** Whether the service refuses a filter. */
export const isOfFilter = (error: unknown): error is Problem => error instanceof Problem && error.field === "filter";

/** The filter before, at and after the character it is refused at, which is counted from 1. */
export function marked(text: string, character: number): [string, string, string] {
  const characters = [...text];
  const at = Math.min(Math.max(0, character - 1), characters.length);
  return [characters.slice(0, at).join(""), characters[at] ?? " ", characters.slice(at + 1).join("")];
}

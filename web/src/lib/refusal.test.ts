// Filters marked where they are refused.
import { expect, test } from "vitest";
import { marked } from "./refusal";

test.each([
  ["ab=1", 2, ["a", "b", "=1"]],
  ["ab", 3, ["ab", " ", ""]],
  ["né𝟙x", 3, ["né", "𝟙", "x"]],
] as const)("%s at %i", (text, at, parts) => expect(marked(text, at)).toEqual(parts));

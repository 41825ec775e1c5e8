// What is looked at closely.
import { expect, test } from "vitest";
import type { SweepState } from "../api";
import { busiest, idFilter, replaced } from "./busy";

const of = (id: string, state: SweepState) => ({ id, state });

test("what is open comes first, then what runs; what rests is left alone", () => {
  const known = [of("a", "queued"), of("b", "complete"), of("c", "running"), of("d", "queued"), of("e", "paused"), of("d", "queued")];
  expect(busiest(known, "d", 9).map((s) => s.id)).toEqual(["d", "c", "a"]);
  expect(busiest(known, "b", 2).map((s) => s.id)).toEqual(["c", "a"]);
});

test("they are asked for by their ids and take their own places", () => {
  expect(idFilter(["x", "y"])).toBe('id = "x" or id = "y"');
  expect(replaced([of("a", "queued"), of("b", "queued")], [of("b", "running"), of("z", "running")])).toEqual([of("a", "queued"), of("b", "running")]);
});

// Another regime: what it needs comes, what it would refuse goes and comes back.
import { expect, test } from "vitest";
import { notShown, withRegime } from "./regime";

const season = { name: "x", regime: "transient", time: { duration_a: 5 }, forcing: { d_m: {} }, parameters: { b: 1 }, fjord: { x_m: [0] } };

test("a regime takes away what it would refuse and gives it back", () => {
  const steady = withRegime({ doc: season, aside: {} }, "steady");
  expect(steady.doc).toEqual({ name: "x", regime: "steady", parameters: { b: 1 }, fjord: { x_m: [0] } });
  const back = withRegime(steady, "transient");
  expect(back.doc).toEqual({ ...season, start: "steady" });
});

test("a regime comes with what it needs", () => {
  expect(withRegime({ doc: {}, aside: {} }, "quasi_static").doc).toEqual({ regime: "quasi_static", length_m: 12000 });
  const thick = withRegime({ doc: { regime: "quasi_static", thickness_0_m: 100 }, aside: {} }, "steady");
  expect(withRegime(thick, "quasi_static").doc).toEqual({ regime: "quasi_static", thickness_0_m: 100 });
  const branch = withRegime({ doc: { calving_law: { rate_m_per_a: 1 }, regime: "transient", time: {} }, aside: {} }, "branch");
  expect(Object.keys(branch.doc)).toEqual(["calving_law", "regime", "branch"]);
});

test("what the form does not show is named", () => {
  expect(notShown(season)).toEqual(["fjord"]);
  expect(notShown({ table: {}, priority: 1, name: "x" })).toEqual(["table", "priority"]);
});

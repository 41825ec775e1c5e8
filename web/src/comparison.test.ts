// Comparing ensembles: what matches, what is the same, and how far apart the rest lies.
import { expect, test } from "vitest";
import { compare } from "./comparison";

const run = (run_id: string, melt: number, force: number | null) => ({
  run_id,
  regime: "steady",
  upstream_closure: "published",
  melt,
  force,
});

test("runs match by their parameters, whatever their order", () => {
  const first = [run("a", 0.5, 4), run("b", 0.6, 2), run("c", 0.7, null)];
  const second = [run("c", 0.7, null), run("x", 0.6, 2.5), run("a", 0.5, 4)];
  expect(compare(first, second, ["melt"], "force")).toEqual({ matched: 3, same: 2, largest: 0.2 });
});

test("what has other parameters or no force tells no difference", () => {
  expect(compare([run("a", 0.5, 4)], [run("b", 0.51, 4)], ["melt"], "force")).toEqual({
    matched: 0,
    same: 0,
    largest: null,
  });
  expect(compare([run("a", 0.5, null)], [run("b", 0.5, 4)], ["melt"], "force").largest).toBeNull();
  expect(compare([run("a", 0.5, 0)], [run("b", 0.5, 0)], ["melt"], "force").largest).toBe(0);
});

// Addresses hold the view: what is written is read again, and what is broken does no harm.
import { expect, test } from "vitest";
import { along, comingBack, readPlace, writePlace } from "./place";

test("a place is read as it was written", () => {
  const place = {
    path: ["sweep", "01a2/ü", "laws"],
    query: { x: "width_m", filter: 'status = "converged" and b > 1e4', with: "a:1" },
  };
  expect(readPlace(writePlace(place))).toEqual(place);
  expect(readPlace(writePlace({ path: [], query: {} }))).toEqual({ path: [], query: {} });
});

test("a filter may hold question marks and ampersands", () => {
  const place = { path: ["sweep"], query: { filter: "name ~ \"a?b&c=d#e\"" } };
  expect(readPlace(writePlace(place))).toEqual(place);
});

test("what is no address is a place all the same", () => {
  expect(readPlace("")).toEqual({ path: [], query: {} });
  expect(readPlace("#%E0%A4%A")).toEqual({ path: ["%E0%A4%A"], query: {} });
  expect(readPlace("#//sweep//1/?")).toEqual({ path: ["sweep", "1"], query: {} });
});

test("a panel keeps its view while others are looked at; runs, units and the list are those of now", () => {
  const own = { law: "linear", filter: "b > 1", speed: "m_per_a", find: "x" };
  const now = { filter: "b > 2", speed: "m_per_day", view: "map" };
  expect(comingBack(own, now)).toEqual({ law: "linear", filter: "b > 2" });
  expect(comingBack(own, {})).toEqual({ law: "linear" });
  expect(comingBack(undefined, now)).toEqual({ filter: "b > 2" });
  expect(along(own)).toEqual({ speed: "m_per_a", find: "x" });
});

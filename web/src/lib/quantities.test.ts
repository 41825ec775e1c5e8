// Quantities as they are named and shown.
import { expect, test } from "vitest";
import { plain, quantity, told } from "./quantities";

const dictionary = {
  parameters: [{ name: "melt_rate_m_per_day", unit: "m d-1", meaning: "melt" }, { name: "b", unit: "1", meaning: "b" }],
  scalars: [{ name: "yielding_fraction", unit: "1", meaning: "share" }],
  controls: [{ name: "rate_m_per_a", unit: "m a-1" }],
};

test("a quantity has the field's name, and its unit at the switch", () => {
  expect(quantity(dictionary, "melt_rate_m_per_day", "m_per_a")).toMatchObject({ name: "melt rate", unit: "m a-1", factor: 365.25 });
  expect(quantity(dictionary, "rate_m_per_a", "m_per_day")).toMatchObject({ name: "rate", unit: "m d-1" });
  expect(quantity(dictionary, "yielding_fraction", "m_per_a")).toMatchObject({ name: "yielding fraction", unit: "1", factor: 1 });
});

test("a number is told with name and unit", () => {
  const melt = quantity(dictionary, "melt_rate_m_per_day", "m_per_day");
  expect(told(melt, 0.6)).toBe("melt rate 0.6 m d⁻¹");
  expect(told(melt, null)).toBe("melt rate –");
  expect(told(quantity(dictionary, "b", "m_per_day"), 1e4)).toBe("b 10000");
});

test("names of the interface in a sentence become words, their numbers have units", () => {
  expect(plain("no mélange any more, beyond melt_rate_m_per_day = 0.2186098: at 604.5 m", dictionary, "m_per_day")).toBe(
    "no mélange any more, beyond melt rate = 0.2186 m d⁻¹: at 604.5 m",
  );
  expect(plain("melt_rate_m_per_day reaches its bound 0.5", dictionary, "m_per_day")).toBe("melt rate reaches its bound 0.5 m d⁻¹");
  expect(plain("b is what it was, some_thing = 3 too; yielding_fraction falls", dictionary, "m_per_a")).toBe("b is what it was, some_thing = 3 too; yielding fraction falls");
});

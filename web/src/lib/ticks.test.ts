// Axes of the page's figures.
import { describe, expect, it } from "vitest";
import { logRange, logTicks } from "./ticks";

describe("a logarithmic axis", () => {
  it("holds its data with a margin", () => {
    const [low, high] = logRange([1, 100]);
    expect(low).toBeGreaterThan(0.75);
    expect(low).toBeLessThan(1);
    expect(high).toBeGreaterThan(100);
    expect(high).toBeLessThan(130);
  });

  it("has room around a single value, and some for none", () => {
    expect(logRange([4])).toEqual([expect.closeTo(2, 12), expect.closeTo(8, 12)]);
    expect(logRange([])).toEqual([0.1, 10]);
  });

  it("has round ticks over decades and within one", () => {
    expect(logTicks([0.9, 120])).toEqual([1, 2, 5, 10, 20, 50, 100]);
    expect(logTicks([0.48, 1.04])).toEqual([0.5, 0.6, 0.7, 0.8, 0.9, 1]);
  });
});

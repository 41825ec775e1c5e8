// What the page computes itself.
import { describe, expect, it } from "vitest";
import { freeboard, label, show, unitText, withEnds, words_of } from "./numbers";

describe("numbers", () => {
  it("are shown with their significant digits", () => {
    expect(show(149.41536)).toBe("149.4");
    expect(show(-3.11, 4)).toBe("−3.110");
    expect(show(8156311.3)).toBe("8.156 × 10⁶");
    expect(show(1.4e-11, 2)).toBe("1.4 × 10⁻¹¹");
    expect(show(0)).toBe("0");
  });

  it("that do not exist are a dash", () => {
    expect(show(null)).toBe("–");
    expect(show(Number.NaN)).toBe("–");
  });
});

describe("labels", () => {
  it("carry their unit", () => {
    expect(unitText("m a-1")).toBe("m a⁻¹");
    expect(unitText("m3")).toBe("m³");
    expect(unitText("1")).toBe("");
    expect(words_of("force_quasi_static_n_per_m")).toBe("quasi-static estimate of F/W");
    expect(label({ name: "width_m", unit: "m" }, "width_m")).toBe("fjord width W (m)");
  });
});

describe("flotation", () => {
  it("leaves a tenth above the sea", () => {
    const { surface, base } = freeboard(100);
    expect(surface - base).toBeCloseTo(100, 12);
    expect(surface).toBeCloseTo(10.798, 3);
  });
});

describe("a profile", () => {
  it("is extrapolated to its ends", () => {
    expect(withEnds([70, 50, 30])).toEqual([80, 70, 50, 30, 20]);
  });
});

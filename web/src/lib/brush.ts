// Ranges of quantities that one looks at: as they stand in the page's address, which rows lie within them, and the
// filter that says the same to the service.

/** Least and greatest value; null for all. */
export type Range = [number, number] | null;

/** Ranges by name as text: `width_m:3000..4000,b:10000..20000`. */
export function writeRanges(ranges: Record<string, Range>): string | undefined {
  const given = Object.entries(ranges).flatMap(([name, range]) => (range ? [`${name}:${short(range[0])}..${short(range[1])}`] : []));
  return given.length === 0 ? undefined : given.join(",");
}

/** The ranges that a text names; what cannot be read is left out. */
export function readRanges(text: string | undefined): Record<string, [number, number]> {
  const found: Record<string, [number, number]> = {};
  for (const part of (text ?? "").split(",")) {
    const [, name, low, high] = /^([^:]+):(.+?)\.\.(.+)$/.exec(part) ?? [];
    const [from, to] = [Number(low), Number(high)];
    if (name !== undefined && Number.isFinite(from) && Number.isFinite(to)) found[name] = from <= to ? [from, to] : [to, from];
  }
  return found;
}

/** Six digits are as fine as a hand is. */
const short = (value: number): number => Number(value.toPrecision(6));

/** Whether each row lies within all ranges, a range for each column. Where there is a range, a missing number is outside. */
export function within(rows: (number | null)[][], ranges: Range[]): boolean[] {
  const active = ranges.flatMap((range, i) => (range ? [{ i, range }] : []));
  return rows.map((row) =>
    active.every(({ i, range: [low, high] }) => {
      const value = row[i];
      return value !== null && value !== undefined && value >= low && value <= high;
    }),
  );
}

/** The ranges in the language of filters, added to another filter; undefined where nothing is said. */
export function filterOf(ranges: Record<string, Range>, more?: string): string | undefined {
  const given = Object.entries(ranges).flatMap(([name, range]) => (range ? [`${short(range[0])} <= ${name} <= ${short(range[1])}`] : []));
  const other = more?.trim() ?? "";
  const all = [...(other === "" ? [] : [given.length === 0 ? other : `(${other})`]), ...given];
  return all.length === 0 ? undefined : all.join(" and ");
}

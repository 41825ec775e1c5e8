// Which of many runs are drawn, and how a choice stands in an address.

/** The indices that a text such as "3,7,9" names, each once. */
export function readRuns(text: string | undefined): number[] {
  if (text === undefined) return [];
  const indices = text.split(",").map((part) => part.trim()).filter((part) => /^\d+$/.test(part)).map(Number);
  return [...new Set(indices)];
}

/** `count` places among `n`, evenly spread, the ends among them. */
export function evenly(n: number, count: number): number[] {
  if (count >= n) return Array.from({ length: n }, (_, i) => i);
  if (count <= 1) return n > 0 && count === 1 ? [Math.floor(n / 2)] : [];
  return Array.from({ length: count }, (_, i) => Math.round((i * (n - 1)) / (count - 1)));
}

export interface Candidate {
  index: number;
  /** By which runs are spread; null where a run has none. */
  value: number | null;
  /** What else varies of it. */
  others?: unknown[];
  /** Whether there is anything to draw; so if not given. */
  isDrawn?: boolean;
}

/**
 * Up to `most` runs that can be drawn, evenly spread over their values, by value and then by index. In a grid
 * everything else stays the same: it is as in the middle of the design, with gaps where that has nothing to draw. Of
 * runs that share a value the middle ones are taken. Runs drawn `before` stay, and others join them.
 */
export function spread(candidates: Candidate[], most: number, before: number[] = []): number[] {
  const old = new Set(before);
  const alike = withSameOthers(candidates, candidates.find((c) => old.has(c.index))).filter((c) => c.isDrawn !== false);
  const kept = alike.filter((c) => old.has(c.index)).slice(0, most);
  const chosen = new Set([...kept.map((c) => c.index), ...evenlyOver(alike.filter((c) => !old.has(c.index)), most - kept.length)]);
  return alike.filter((c) => chosen.has(c.index)).sort(byValue).map((c) => c.index);
}

const byValue = (a: Candidate, b: Candidate): number =>
  a.value === b.value ? a.index - b.index : a.value === null ? 1 : b.value === null ? -1 : a.value - b.value;

function grouped(candidates: Candidate[], by: (candidate: Candidate) => string | number | null): Candidate[][] {
  const groups = new Map<string | number | null, Candidate[]>();
  for (const candidate of candidates) {
    const group = groups.get(by(candidate));
    if (group) group.push(candidate);
    else groups.set(by(candidate), [candidate]);
  }
  return [...groups.values()];
}

function evenlyOver(candidates: Candidate[], most: number): number[] {
  const groups = grouped(candidates.toSorted(byValue), (c) => c.value);
  const each = Math.max(1, Math.floor(most / Math.max(1, groups.length)));
  return evenly(groups.length, Math.min(most, groups.length)).flatMap((place) => {
    const group = groups[place] ?? [];
    return evenly(group.length, each).flatMap((i) => group[i]?.index ?? []);
  });
}

/**
 * Runs that share what else varies: with the run given, or else with the combination nearest to the middle of the
 * design, of those that hold several values. All of them where no combination does, as in a random sample.
 */
function withSameOthers(candidates: Candidate[], like: Candidate | undefined): Candidate[] {
  const text = (c: Candidate): string => JSON.stringify(c.others ?? []);
  const values = (group: Candidate[]): number => new Set(group.map((c) => c.value)).size;
  // Pairs of a Saltelli design are no grid.
  const least = values(candidates) === 2 ? 2 : 3;
  const combinations = grouped(candidates, text).filter((group) => group.some((c) => c.isDrawn !== false) && values(group) >= least);
  const same = like && combinations.find((group) => group[0] && text(group[0]) === text(like));
  if (same) return same;
  const levels = (candidates[0]?.others ?? []).map((_, k) => {
    const level = [...new Set(candidates.map((c) => c.others?.[k]))];
    return level.every((v) => typeof v === "number") ? level.sort((a, b) => a - b) : level;
  });
  /** Steps from the middle of the design, each parameter's range counted as one. */
  const away = (group: Candidate[]): number =>
    levels.reduce((sum, level, k) => sum + Math.abs(level.indexOf(group[0]?.others?.[k]) / Math.max(1, level.length - 1) - 0.5), 0);
  const distances = combinations.map(away);
  return combinations[distances.indexOf(Math.min(...distances))] ?? candidates;
}

/** What is said of runs that were chosen by hand. */
export const drawnText = (drawn: number, named: number): string =>
  drawn < named ? `Showing the first ${drawn} of ${named} runs that were chosen: no more are drawn at once.` : `Showing the ${drawn} runs that were chosen.`;

/** A number that changes when it is worth asking again: at each run of a few, at each fiftieth of many. */
export function stage(done: number, total: number, isOver: boolean): number {
  return isOver || total <= 50 ? done : Math.floor((50 * done) / total);
}

/** Names of parameters that a sweep's document varies, in its order. */
export function variedIn(spec: unknown): string[] {
  const { axes, sample, table } = (spec ?? {}) as {
    axes?: Axis[] | null;
    sample?: { ranges?: Record<string, unknown> } | null;
    table?: { columns?: string[] } | null;
  };
  const names = [...(axes ?? []).flatMap(ofAxis), ...Object.keys(sample?.ranges ?? {}), ...(table?.columns ?? [])];
  return [...new Set(names)];
}

interface Axis {
  parameter?: string | null;
  zip?: Axis[] | null;
}

function ofAxis(axis: Axis): string[] {
  if (axis.zip) return axis.zip.flatMap(ofAxis);
  return axis.parameter ? [axis.parameter] : [];
}

/** Parameters that vary over a sweep: as the service tells them, or else its document. */
export function varied(sweep: { spec: unknown; varies?: { parameter: string }[] }): string[] {
  const told = (sweep.varies ?? []).map((v) => v.parameter);
  return told.length > 0 ? told : variedIn(sweep.spec);
}

/**
 * A condition as an example, which some runs meet. In a grid it keeps one parameter the same, else nearly the same: the
 * middle fifth of the runs; `but` is left to vary, if anything else does.
 */
export function exampleOf(columns: Record<string, unknown[]>, names: string[], but: string): string {
  const name = names.find((n) => n !== but) ?? names[0] ?? "";
  const values = (columns[name] ?? []).filter((v) => typeof v === "number").sort((a, b) => a - b);
  if (values.length === 0) return "run_index < 100";
  const at = (share: number): number => values[Math.round(share * (values.length - 1))] ?? 0;
  if (new Set(values).size <= values.length / 2) return `${name} = ${at(0.5)}`;
  const round = (value: number): number => Number(value.toPrecision(3));
  const [low, high] = [round(at(0.4)), round(at(0.6))];
  const [from, to] = values.some((v) => v >= low && v <= high) ? [low, high] : [at(0.4), at(0.6)];
  return `${from} <= ${name} <= ${to}`;
}

// The REST interface, typed: the only file that knows its addresses.

export interface Counts {
  total: number;
  queued: number;
  running: number;
  converged: number;
  completed: number;
  collapsed: number;
  no_steady_state: number;
  no_fold: number;
  overthick: number;
  fjord_closed: number;
  failed: number;
  cancelled: number;
}

export interface Axis {
  zip?: Axis[];
  parameter?: string;
  option?: string;
  linspace?: [number, number, number];
  logspace?: [number, number, number];
  values?: (number | string)[];
}

export interface Spec {
  name?: string;
  regime: string;
  parameters?: Record<string, number>;
  axes?: Axis[];
  sample?: { ranges: Record<string, [number, number] | { log: [number, number] }> };
  table?: { columns: string[] };
}

export type SweepState = "queued" | "running" | "paused" | "stopping" | "complete" | "cancelled";

/** Whether nothing of a sweep changes any more by itself. */
export const isOver = (state: SweepState): boolean => state === "complete" || state === "cancelled";

/** The parameters that a sweep varies, as it was written. */
export function varied(spec: Spec): string[] {
  const ofAxis = (axis: Axis): string[] =>
    axis.zip ? axis.zip.flatMap(ofAxis) : axis.parameter === undefined ? [] : [axis.parameter];
  const axes = (spec.axes ?? []).flatMap(ofAxis);
  return [...axes, ...Object.keys(spec.sample?.ranges ?? {}), ...(spec.table?.columns ?? [])];
}

export interface Sweep {
  id: string;
  name: string;
  state: SweepState;
  counts: Counts;
  created_at: string;
  spec: Spec;
}

/** A run's scalars by name; null where a number does not exist. */
export type Run = Record<string, number | string | null>;

export interface Page<T> {
  items: T[];
  next: string | null;
  total: number;
}

export interface Estimate {
  estimate: number;
  standard_error: number;
  ci95: [number, number];
}

export type Law = "power_law" | "exponential" | "linear";

export interface Fit {
  model: Law;
  exponent: Estimate;
  prefactor: Estimate;
  r_squared: number;
  n_used: number;
  left_out: { reason: string; count: number }[];
  band: { x: number[]; y: number[]; lower: number[]; upper: number[] };
  interval_meaning: string;
}

export interface Profile {
  node_x_m: number[];
  velocity_m_per_a: number[];
  mu_w: number[];
  cell_x_m: number[];
  thickness_m: number[];
  fluidity_per_a: number[];
}

export interface Outcome {
  status: string;
  detail: string;
  parameters: Record<string, number>;
  profile: Profile | null;
  [scalar: string]: unknown;
}

export interface Entry {
  name: string;
  unit: string;
  meaning: string;
}

export interface ParameterEntry extends Entry {
  default: number;
  min: number;
  max: number;
}

export interface Dictionary {
  parameters: ParameterEntry[];
  scalars: Entry[];
}

/** A refusal or failure of the service, as it told it. */
export class Problem extends Error {
  readonly field: string | undefined;
  readonly status: number;

  constructor(status: number, detail: string, field?: string) {
    super(detail);
    this.status = status;
    this.field = field;
  }
}

const base = "api/v1";

async function call<T>(path: string, init?: RequestInit): Promise<T> {
  let response: Response;
  try {
    response = await fetch(`${base}/${path}`, init);
  } catch {
    throw new Problem(0, "the service does not answer; is it still running?");
  }
  const body: unknown = await response.json().catch(() => null);
  if (!response.ok) {
    const problem = body as { detail?: string; field?: string } | null;
    throw new Problem(response.status, problem?.detail ?? response.statusText, problem?.field);
  }
  return body as T;
}

export const dictionary = () => call<Dictionary>("dictionary");
export const sweeps = () => call<Page<Sweep>>("sweeps?limit=100");
export const run = (id: string) => call<Outcome>(`runs/${id}`);

export const submit = (spec: Spec) =>
  call<{ id: string; count: number; reused: number }>("sweeps", {
    method: "POST",
    headers: { "content-type": "application/json" },
    body: JSON.stringify(spec),
  });

export const fit = (id: string, x: string, y: string, model: Law) =>
  call<Fit>(`sweeps/${id}/fit?${new URLSearchParams({ x, y, model }).toString()}`);

/** Address of a bulk table. */
export const bulk = (id: string, file: string) => `${base}/sweeps/${id}/${file}`;

/** Up to `most` runs of a sweep, and how many there are. */
export async function runs(id: string, most: number): Promise<{ items: Run[]; total: number }> {
  const items: Run[] = [];
  let cursor: string | null = null;
  for (;;) {
    const query: string = cursor === null ? "" : `&cursor=${encodeURIComponent(cursor)}`;
    const page: Page<Run> = await call<Page<Run>>(`sweeps/${id}/runs?limit=1000${query}`);
    items.push(...page.items);
    if (page.next === null || items.length >= most) return { items, total: page.total };
    cursor = page.next;
  }
}

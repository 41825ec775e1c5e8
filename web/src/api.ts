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
  /** Who submitted it. */
  owner: string | null;
  tags: string[];
  /** In lists the beginning of a long one. */
  note: string | null;
  /** Present and never changing again once it is sealed. */
  sealed: { content_hash: string; title: string; sealed_at: string } | null;
  spec: Spec;
}

/** A sweep that is told whole. */
export interface WholeSweep extends Sweep {
  /** The note, made harmless by the service. */
  note_html: string | null;
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

export type Role = "reader" | "contributor" | "admin";

/** Who uses the page; on a service without people everybody is the same admin. */
export interface Me {
  name: string;
  role: Role;
  is_open: boolean;
}

export interface Person {
  name: string;
  role: Role;
  most_runs: number | null;
  most_pending_runs: number | null;
  created_at: string;
  revoked_at: string | null;
}

/** Whether somebody may change a sweep: the service decides, the page only does not offer in vain. */
export const mayChange = (me: Me, sweep: Sweep): boolean =>
  me.role === "admin" || (me.role === "contributor" && sweep.owner === me.name);

/** A refusal or failure of the service, as it told it. */
export class Problem extends Error {
  readonly field: string | undefined;
  readonly status: number;
  /** At which character of a filter, counted from 1. */
  readonly character: number | undefined;

  constructor(status: number, detail: string, field?: string, character?: number) {
    super(detail);
    this.status = status;
    this.field = field;
    this.character = character;
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
    const problem = body as {
      detail?: string;
      field?: string;
      character?: number;
      request_id?: string;
    } | null;
    const detail = problem?.detail ?? response.statusText;
    // What the service's log knows a failure by.
    const request = problem?.request_id ? ` (request ${problem.request_id})` : "";
    throw new Problem(response.status, detail + request, problem?.field, problem?.character);
  }
  return body as T;
}

const sendJson = (method: string, body: unknown): RequestInit => ({
  method,
  headers: { "content-type": "application/json" },
  body: JSON.stringify(body),
});

export const me = () => call<Me>("me");
export const login = (token: string) => call<Me>("session", sendJson("POST", { token }));
export const logout = () => call<null>("session", { method: "DELETE" });
export const people = () => call<Person[]>("people");
export const invite = (name: string, role: Role) =>
  call<{ name: string; token: string }>("people", sendJson("POST", { name, role }));
export const newToken = (name: string) =>
  call<{ name: string; token: string }>(`people/${encodeURIComponent(name)}/token`, { method: "POST" });
export const revoke = (name: string) =>
  call<null>(`people/${encodeURIComponent(name)}`, { method: "DELETE" });

export type Verb = "pause" | "resume" | "stop" | "cancel" | "retry" | "recover";
export const ask = (id: string, verb: Verb) =>
  call<Sweep>(`sweeps/${id}/${verb}`, { method: "POST" });
export const remove = (id: string) => call<null>(`sweeps/${id}`, { method: "DELETE" });

export const edit = (id: string, change: { add_tags?: string[]; remove_tags?: string[]; name?: string; note?: string }) =>
  call<WholeSweep>(`sweeps/${id}`, sendJson("PATCH", change));

export interface Seal {
  title: string;
  authors: { name: string; orcid?: string }[];
  licence: string;
}
export const seal = (id: string, form: Seal) =>
  call<Sweep>(`sweeps/${id}/seal`, sendJson("POST", form));

/** How a sealed ensemble is cited, as text. */
export async function citation(id: string): Promise<string> {
  const response = await fetch(`${base}/sweeps/${id}/citation?format=text`);
  if (!response.ok) throw new Problem(response.status, response.statusText);
  return response.text();
}

export const importArchive = (file: File) =>
  call<unknown>("import", { method: "POST", headers: { "content-type": "application/zstd" }, body: file });

export const dictionary = () => call<Dictionary>("dictionary");
export const sweep = (id: string) => call<WholeSweep>(`sweeps/${id}`);

/** The newest sweeps that a filter lets through; an empty one lets all. */
export function sweeps(filter: string): Promise<Page<Sweep>> {
  const which = filter === "" ? "" : `&${new URLSearchParams({ filter }).toString()}`;
  return call<Page<Sweep>>(`sweeps?limit=100${which}`);
}
export const run = (id: string) => call<Outcome>(`runs/${id}`);

export const submit = (spec: Spec) =>
  call<{ id: string; count: number; reused: number }>("sweeps", sendJson("POST", spec));

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

// The REST interface by the names the page uses; types come from the service's OpenAPI document.
import type {
  Counts as CountsSchema,
  Dictionary as DictionarySchema,
  Document,
  DryRun as DryRunSchema,
  Fit as FitSchema,
  Law as LawSchema,
  Me as MeSchema,
  Outcome as OutcomeSchema,
  Person as PersonSchema,
  Profile as ProfileSchema,
  Role as RoleSchema,
  SealForm,
  Sweep as SweepSchema,
  SweepState as SweepStateSchema,
  Submitted as SubmittedSchema,
} from "../../generated/schema";
import { address, client, told } from "./client";

export { Problem, absolute, address, sentence } from "./client";

export type Counts = CountsSchema;
export type Dictionary = DictionarySchema;
export type DryRun = DryRunSchema;
export type Fit = FitSchema;
export type Law = LawSchema;
export type Me = MeSchema;
export type Outcome = OutcomeSchema;
export type Person = PersonSchema;
export type Profile = ProfileSchema;
export type Role = RoleSchema;
export type Spec = Document;
export type Submitted = SubmittedSchema;
export type Sweep = SweepSchema;
export type SweepState = SweepStateSchema;

/** A name of the interface with its unit and meaning. */
export interface Entry {
  name: string;
  unit: string;
  meaning: string;
}

/** A run's scalars by name; null where a number does not exist. */
export type Run = Record<string, number | string | null>;

/** Whether nothing of a sweep changes any more by itself. */
export const isOver = (state: SweepState): boolean => state === "complete" || state === "cancelled";

/** Runs that have ended, whatever their end. */
export const ended = (sweep: Sweep): number => sweep.counts.total - sweep.counts.queued - sweep.counts.running;

/** Whether somebody may change a sweep: the service decides, the page only does not offer in vain. */
export const mayChange = (me: Me, sweep: Sweep): boolean =>
  me.role === "admin" || (me.role === "contributor" && sweep.owner === me.name);

const path = <T extends object>(values: T) => ({ params: { path: values } });
const at = <P extends object, Q extends object>(values: P, query: Q) => ({ params: { path: values, query } });

export const me = (): Promise<Me> => told(client.GET("/api/v1/me"));
export const login = (token: string) => told(client.POST("/api/v1/session", { body: { token } }));
export const logout = () => told(client.DELETE("/api/v1/session"));

export const people = (): Promise<Person[]> => told(client.GET("/api/v1/people"));
export const invite = (name: string, role: Role) => told(client.POST("/api/v1/people", { body: { name, role } }));
export const newToken = (name: string) => told(client.POST("/api/v1/people/{name}/token", path({ name })));
export const revoke = (name: string) => told(client.DELETE("/api/v1/people/{name}", path({ name })));

export const dictionary = (): Promise<Dictionary> => told(client.GET("/api/v1/dictionary"));

/** The newest sweeps that a filter lets through; an empty one lets all. */
export const sweeps = (filter: string, limit = 100) =>
  told(client.GET("/api/v1/sweeps", { params: { query: { limit, ...(filter === "" ? {} : { filter }) } } }));
/** The newest sweeps of the trash. */
export const trash = () => told(client.GET("/api/v1/sweeps", { params: { query: { trash: true, limit: 100 } } }));
export const sweep = (id: string): Promise<Sweep> => told(client.GET("/api/v1/sweeps/{id}", path({ id })));

/** A document goes as it was written, so that no number changes on its way. */
const written = (text: string) => ({
  body: text as never,
  bodySerializer: (body: unknown) => body as string,
  headers: { "content-type": "application/json" },
});
/** Submits a sweep; who comes again with the same key and text gets the same sweep. */
export const submit = async (text: string, key: string): Promise<Submitted> => {
  const params = { header: { "Idempotency-Key": key } };
  const { headers, ...rest } = written(text);
  const answer: unknown = await told(client.POST("/api/v1/sweeps", { params, ...rest, headers: { ...headers, "Idempotency-Key": key } }));
  return answer as Submitted;
};
/** What a submission would do. */
export const dryRun = async (text: string): Promise<DryRun> => {
  const query = { dry_run: true };
  const answer: unknown = await told(client.POST("/api/v1/sweeps", { params: { query }, ...written(text) }));
  return answer as DryRun;
};

export type Verb = "pause" | "resume" | "stop" | "cancel" | "retry" | "recover";
export const ask = (id: string, verb: Verb) =>
  told(client.POST("/api/v1/sweeps/{id}/{verb}", path({ id, verb })));
export const remove = (id: string) => told(client.DELETE("/api/v1/sweeps/{id}", path({ id })));

export interface Edit {
  add_tags?: string[];
  remove_tags?: string[];
  name?: string;
  note?: string;
}
export const edit = (id: string, change: Edit): Promise<Sweep> =>
  told(client.PATCH("/api/v1/sweeps/{id}", { ...path({ id }), body: change }));
export const seal = (id: string, form: SealForm) =>
  told(client.POST("/api/v1/sweeps/{id}/seal", { ...path({ id }), body: form }));

/** How a sealed ensemble is cited, as text. */
export const citation = (id: string): Promise<string> =>
  told<string>(client.GET("/api/v1/sweeps/{id}/citation", { ...at({ id }, { format: "text" }), parseAs: "text" }));

export const importArchive = (file: File, acceptsConflicts = false) =>
  told(
    client.POST("/api/v1/import", {
      ...(acceptsConflicts ? { params: { query: { accept_conflicts: true } } } : {}),
      body: file as never,
      bodySerializer: (body: unknown) => body as Blob,
      headers: { "content-type": "application/zstd" },
    }),
  );

export const run = (id: string): Promise<Outcome> => told(client.GET("/api/v1/runs/{id}", path({ id })));

/** Address of a bulk table. */
export const bulk = (id: string, file: string): string => address(`sweeps/${id}/${file}`);

/** Up to `most` runs of a sweep, and how many there are. */
export async function runs(id: string, most: number, filter?: string): Promise<{ items: Run[]; total: number }> {
  const items: Run[] = [];
  let cursor: string | null | undefined;
  for (;;) {
    const query = {
      limit: Math.min(1000, most),
      ...(cursor ? { cursor } : {}),
      ...(filter === undefined ? {} : { filter }),
    };
    const page = await told(client.GET("/api/v1/sweeps/{id}/runs", at({ id }, query)));
    items.push(...(page.items as Run[]));
    if (!page.next || items.length >= most) return { items, total: page.total };
    cursor = page.next;
  }
}

/** The id of a run of a sweep. */
export async function runId(id: string, index: number): Promise<string> {
  const { items } = await runs(id, 1, `run_index = ${index}`);
  const found = items[0]?.["run_id"];
  if (typeof found !== "string") throw new Error(`run ${index} has no result`);
  return found;
}

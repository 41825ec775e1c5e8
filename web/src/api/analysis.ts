// What the service makes of an ensemble's results: columns, laws, failures, indices, states, seasons. Each call that
// figures read has its path, too, for the scripts that draw them again.
import type {
  Columns as ColumnsSchema,
  Failures as FailuresSchema,
  Group,
  Indices as IndicesSchema,
  ProfilesAnswer,
  Season as SeasonSchema,
  SweepLaws,
  operations,
} from "../../generated/schema";
import { client, told } from "./client";

export type Columns = ColumnsSchema;
export type Failures = FailuresSchema;
export type Indices = IndicesSchema;
export type LawGroup = Group;
export type Laws = SweepLaws;
export type ProfileItem = ProfilesAnswer["items"][number];
export type Season = SeasonSchema;

type Query<Name extends keyof operations> = NonNullable<operations[Name]["parameters"]["query"]>;
/** The same, with members that may be undefined for not given. */
type Open<T> = { [K in keyof T]: undefined extends T[K] ? T[K] | undefined : T[K] };

export type ColumnsQuery = Open<Query<"get_sweeps_id_columns">>;
export type LawsQuery = Open<Query<"get_sweeps_id_laws">>;
export type IndicesQuery = Open<Query<"get_sweeps_id_indices">>;
export type ProfilesQuery = Open<Query<"get_sweeps_id_profiles">>;
export type SeasonQuery = Open<Query<"get_runs_id_season">>;

/** A query without the members that are not given. */
function given<T extends object>(query: Open<T>): T {
  return Object.fromEntries(Object.entries(query).filter(([, value]) => value !== undefined)) as T;
}

/** A path below `api/v1/` with its query. */
function path(place: string, query: object): string {
  const entries = Object.entries(given(query)).map(([name, value]): [string, string] => [name, String(value)]);
  return `${place}?${new URLSearchParams(entries).toString()}`;
}

export const columnsPath = (id: string, query: ColumnsQuery): string => path(`sweeps/${id}/columns`, query);
export const columns = (id: string, query: ColumnsQuery): Promise<Columns> =>
  told(client.GET("/api/v1/sweeps/{id}/columns", { params: { path: { id }, query: given(query) } }));

export const lawsPath = (id: string, query: LawsQuery): string => path(`sweeps/${id}/laws`, query);
export const laws = (id: string, query: LawsQuery): Promise<Laws> =>
  told(client.GET("/api/v1/sweeps/{id}/laws", { params: { path: { id }, query: given(query) } }));

/** Runs that came to no result, grouped by the reason. */
export const failures = (id: string): Promise<Failures> =>
  told(client.GET("/api/v1/sweeps/{id}/failures", { params: { path: { id } } }));

export const indicesPath = (id: string, query: IndicesQuery): string => path(`sweeps/${id}/indices`, query);
export const indices = (id: string, query: IndicesQuery): Promise<Indices> =>
  told(client.GET("/api/v1/sweeps/{id}/indices", { params: { path: { id }, query: given(query) } }));

export const profilesPath = (id: string, query: ProfilesQuery): string => path(`sweeps/${id}/profiles`, query);
export const profiles = (id: string, query: ProfilesQuery): Promise<ProfilesAnswer> =>
  told(client.GET("/api/v1/sweeps/{id}/profiles", { params: { path: { id }, query: given(query) } }));

export const season = (runId: string, query: SeasonQuery = {}): Promise<Season> =>
  told(client.GET("/api/v1/runs/{id}/season", { params: { path: { id: runId }, query: given(query) } }));

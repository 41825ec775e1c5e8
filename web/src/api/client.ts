// How the service is asked: the only file that sends requests. Addresses, queries and answers are typed by the
// service's own OpenAPI document.
import createClient from "openapi-fetch";
import type { paths } from "../../generated/schema";

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

/** What went wrong, as a sentence. */
export const sentence = (error: unknown): string => (error instanceof Error ? error.message : String(error));

// Addresses are relative to the page's, so that it may be served below any path.
export const client = createClient<paths>({ baseUrl: "." });

/** Address of one of the service's resources, relative to the page. */
export const address = (path: string): string => `api/v1/${path}`;
/** The same, for use elsewhere: without the view that stands after the #. */
export const absolute = (path: string): string => new URL(address(path), document.baseURI).href;

interface Told<T> {
  data?: T;
  error?: unknown;
  response: Response;
}

interface Problematic {
  detail?: string;
  field?: string;
  character?: number;
  request_id?: string;
}

/** The answer, or its problem thrown. */
export async function told<T>(asked: Promise<Told<T>>): Promise<T> {
  let answer: Told<T>;
  try {
    answer = await asked;
  } catch {
    throw new Problem(0, "the service does not answer; is it still running?");
  }
  const { data, error, response } = answer;
  if (response.ok) return data as T;
  const problem = (typeof error === "object" ? error : null) as Problematic | null;
  const detail = problem?.detail ?? `${response.status} ${response.statusText}`;
  // What the service's log knows a failure by.
  const request = problem?.request_id ? ` (request ${problem.request_id})` : "";
  throw new Problem(response.status, detail + request, problem?.field, problem?.character);
}

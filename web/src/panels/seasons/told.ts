// What the service tells of a run's season, or why it does not.
import { Problem } from "../../api";
import { type Season, type SeasonQuery, season } from "../../api/analysis";

export type Told = { season: Season } | { problem: string };

/** A refusal is an answer; that the service does not answer is none. */
export async function seasonOf(runId: string, query: SeasonQuery): Promise<Told> {
  try {
    return { season: await season(runId, query) };
  } catch (error) {
    if (error instanceof Problem && error.status === 422) return { problem: error.message };
    throw error;
  }
}

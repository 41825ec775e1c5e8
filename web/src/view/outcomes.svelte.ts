// Results of the runs that a panel draws. Runs that have ended never change: each is asked for once.
import * as api from "../api";
import { Once } from "../lib/once";
import type { Chosen } from "./chosen.svelte";
import { Loaded, dependsOn } from "./loaded.svelte";

export interface Ended {
  index: number;
  runId: string;
  outcome: api.Outcome;
}

/** Asked for as long as the panel applies to the ensemble. */
export function outcomesOf(chosen: Chosen, applies: () => boolean): Loaded<Ended[]> {
  const loaded = new Loaded<Ended[]>();
  const outcomes = new Once<api.Outcome>();
  const ids = new Map<string, string>();
  $effect(() => {
    const [id, key] = [chosen.id, chosen.key];
    // A run that was named before it ended is asked for again.
    if (chosen.isNamed) dependsOn(chosen.look);
    if (!applies() || key === "") {
      loaded.clear();
      return;
    }
    const indices = key.split(",").map(Number);
    loaded.ask(async () => {
      const missing = indices.filter((index) => !ids.has(`${id}/${index}`));
      if (missing.length > 0) {
        const { items } = await api.runs(id, missing.length, `run_index in (${missing.join(",")})`);
        for (const item of items) ids.set(`${id}/${Number(item["run_index"])}`, String(item["run_id"]));
      }
      const found = indices.flatMap((index) => {
        const runId = ids.get(`${id}/${index}`);
        return runId === undefined ? [] : [{ index, runId }];
      });
      return Promise.all(found.map(async (run) => ({ ...run, outcome: await outcomes.get(run.runId, () => api.run(run.runId)) })));
    });
  });
  return loaded;
}

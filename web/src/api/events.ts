// Progress of an ensemble as the service tells it by itself. A connection that breaks is taken up again by the
// browser, which names the last event it has seen.
import type { Progress as ProgressSchema } from "../../generated/schema";
import { address } from "./client";

/** A run that failed lately. */
export interface Failure {
  run_index: number;
  run_id: string;
  detail: string;
}

export interface Progress extends Omit<ProgressSchema, "failures"> {
  failures: Failure[];
}

/** Listens until the ensemble is over, or until what this returns is called. */
export function follow(id: string, told: (progress: Progress, isLast: boolean) => void): () => void {
  const source = new EventSource(address(`sweeps/${id}/events`));
  const listen = (name: "progress" | "end"): void => {
    source.addEventListener(name, (event: MessageEvent<string>) => {
      // Else the browser would come back for more.
      if (name === "end") source.close();
      told(JSON.parse(event.data) as Progress, name === "end");
    });
  };
  listen("progress");
  listen("end");
  return () => source.close();
}

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

/** What one page holds while it listens: a browser opens six connections to a service, for all its pages together. */
const LOCK = "melange.events";
/** Pause before a stream that was refused is asked for again, ms. */
const AGAIN_MS = 5000;

/**
 * Listens while the page is in sight, until the ensemble is over or until what this returns is called. Tells undefined
 * when the stream is lost and what it told no longer holds.
 */
export function follow(id: string, told: (progress: Progress | undefined, isLast: boolean) => void): () => void {
  let close: (() => void) | undefined;
  let timer: ReturnType<typeof setTimeout> | undefined;
  const pause = (): void => {
    clearTimeout(timer);
    close?.();
    close = undefined;
  };
  const begin = (): void => {
    pause();
    if (!document.hidden) close = alone(connect);
  };
  const lose = (): void => {
    pause();
    told(undefined, false);
  };
  const seen = (): void => (document.hidden ? lose() : begin());
  const end = (): void => {
    document.removeEventListener("visibilitychange", seen);
    pause();
  };
  const connect = (): (() => void) => {
    const source = new EventSource(address(`sweeps/${id}/events`));
    source.addEventListener("progress", (event: MessageEvent<string>) => told(JSON.parse(event.data) as Progress, false));
    source.addEventListener("end", (event: MessageEvent<string>) => {
      // Else the browser would come back for more.
      end();
      told(JSON.parse(event.data) as Progress, true);
    });
    source.addEventListener("error", () => {
      // The browser itself takes up what broke, but not what was refused.
      if (source.readyState !== EventSource.CLOSED) return;
      lose();
      timer = setTimeout(begin, AGAIN_MS);
    });
    return () => source.close();
  };
  document.addEventListener("visibilitychange", seen);
  begin();
  return end;
}

/** Works once no other page of the browser does, where the browser can tell; until what this returns is called. */
function alone(work: () => () => void): () => void {
  const { locks } = navigator as { locks?: LockManager };
  if (!locks) return work();
  const waiting = new AbortController();
  let release = (): void => waiting.abort();
  const held = (): Promise<void> =>
    new Promise((done) => {
      const end = work();
      release = () => {
        end();
        done();
      };
    });
  // Refused when it is given up while waiting.
  locks.request(LOCK, { signal: waiting.signal }, held).catch(() => undefined);
  return () => release();
}

// When the page listens for progress, and what becomes of a stream that is refused.
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { type Progress, follow } from "./events";

class Source extends EventTarget {
  static readonly CLOSED = 2;
  static all: Source[] = [];
  readyState = 1;

  constructor() {
    super();
    Source.all.push(this);
  }

  close(): void {
    this.readyState = Source.CLOSED;
  }

  tell(name: string, state: string): void {
    this.dispatchEvent(new MessageEvent(name, { data: JSON.stringify({ state }) }));
  }
}

const open = (): Source[] => Source.all.filter((source) => source.readyState !== Source.CLOSED);
const page = Object.assign(new EventTarget(), { hidden: false });
const show = (isShown: boolean): void => {
  page.hidden = !isShown;
  page.dispatchEvent(new Event("visibilitychange"));
};

beforeEach(() => {
  vi.useFakeTimers();
  Source.all = [];
  page.hidden = false;
  vi.stubGlobal("EventSource", Source);
  vi.stubGlobal("document", page);
  vi.stubGlobal("navigator", {});
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

test("a page out of sight holds no connection", () => {
  const stop = follow("a", () => undefined);
  expect(open()).toHaveLength(1);
  show(false);
  expect(open()).toHaveLength(0);
  show(true);
  expect(open()).toHaveLength(1);
  stop();
  show(false);
  show(true);
  expect(open()).toHaveLength(0);
});

test("a refused stream is forgotten and asked for again; a broken one is left to the browser", () => {
  const told: (Progress | undefined)[] = [];
  const stop = follow("a", (progress) => told.push(progress));
  const [first] = open();
  first?.tell("progress", "running");
  first?.dispatchEvent(new Event("error"));
  expect(told).toHaveLength(1);
  first?.close();
  first?.dispatchEvent(new Event("error"));
  expect(told).toEqual([{ state: "running" }, undefined]);
  vi.advanceTimersByTime(60_000);
  expect(open()).toHaveLength(1);
  stop();
});

test("nothing is asked for after the end", () => {
  const last: boolean[] = [];
  follow("a", (_, isLast) => last.push(isLast));
  Source.all[0]?.tell("end", "complete");
  show(false);
  show(true);
  expect([last, open().length, Source.all.length]).toEqual([[true], 0, 1]);
});

test("of several pages of a browser one listens, and the next when it leaves", async () => {
  // As the browser's: one after the other.
  let queue = Promise.resolve();
  const request = (_: string, { signal }: { signal: AbortSignal }, work: () => Promise<void>): Promise<void> =>
    (queue = queue.then(() => (signal.aborted ? undefined : work())));
  vi.stubGlobal("navigator", { locks: { request } });
  const stops = [1, 2, 3].map(() => follow("a", () => undefined));
  await vi.advanceTimersByTimeAsync(0);
  expect(open()).toHaveLength(1);
  stops[1]?.();
  stops[0]?.();
  await vi.advanceTimersByTimeAsync(0);
  expect(Source.all).toHaveLength(2);
  stops[2]?.();
  expect(open()).toHaveLength(0);
});

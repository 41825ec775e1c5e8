// Drawing, by way of the plotting library, which is large: it is fetched once, and nothing else waits for it.
import type { Figure, Parallel } from "./figure";
import type { Shown } from "./echarts";

let fetched: Promise<typeof import("./echarts")> | undefined;

/** The library's part of this module. What could not be fetched is fetched again when it is asked for again. */
export function library(): Promise<typeof import("./echarts")> {
  fetched ??= import("./echarts").catch((error: unknown) => {
    fetched = undefined;
    throw error;
  });
  return fetched;
}

/** The figures that wait for their turn: the first one of a page is seen before the next one is drawn. */
let turn: Promise<void> = Promise.resolve();

/** Until what was drawn is seen; nobody sees a page in the background. */
const seen = (): Promise<void> =>
  new Promise((done) => (document.hidden ? done() : requestAnimationFrame(() => setTimeout(done))));

/** Draws a figure into an element as soon as that can be done, and keeps it in step with it; for Svelte's `use:`. */
export function chart(
  element: HTMLElement,
  shown: Shown & { onfailure: () => void },
): { update: (next: Shown) => void; destroy: () => void } {
  let current: Shown = shown;
  let drawn: { update: (next: Shown) => void; destroy: () => void } | undefined;
  let isGone = false;
  const draw = async (): Promise<void> => {
    const found = await library().catch(() => undefined);
    if (isGone) return;
    if (!found) {
      shown.onfailure();
      return;
    }
    drawn = found.chart(element, current);
    await seen();
  };
  // What one figure does wrong is told, and keeps no other from being drawn.
  turn = turn.then(draw).catch(reportError);
  return {
    update(next) {
      current = next;
      drawn?.update(next);
    },
    destroy() {
      isGone = true;
      drawn?.destroy();
    },
  };
}

/** The figure as a vector picture. */
export const svg = async (figure: Figure | Parallel, ratio: number): Promise<string> => (await library()).svg(figure, ratio);

/** The figure as pixels, for print. */
export const png = async (figure: Figure | Parallel, ratio: number): Promise<Blob> => (await library()).png(figure, ratio);

// How long an ensemble's first plot takes, from going there to its being drawn. Usage: node large.mjs URL SWEEP.
// Prints milliseconds as JSON: of three visits with an empty cache, the time to the figure, and of what the law call took.
import assert from "node:assert/strict";
import { start } from "./browser.mjs";

const [url, id] = process.argv.slice(2);
assert.ok(id, "usage: node large.mjs URL SWEEP");

const browser = await start();
try {
  const visits = [];
  for (let k = 0; k < 3; k += 1) {
    const context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
    const page = await context.newPage();
    await page.goto(`${url.replace(/\/$/, "")}/#/sweep/${id}/laws`);
    await page.waitForFunction(() => performance.getEntriesByName("figure drawn").length > 0, undefined, { timeout: 30_000 });
    visits.push(
      await page.evaluate(() => {
        const call = performance.getEntriesByType("resource").find((r) => r.name.includes("/laws?"));
        return {
          drawn_ms: Math.round(performance.getEntriesByName("figure drawn")[0].startTime),
          asked_ms: Math.round(call.startTime),
          law_ms: Math.round(call.duration),
        };
      }),
    );
    if (k === 0) await page.getByText(/Showing [\d,]+ of [\d,]+ runs/).first().waitFor();
    await context.close();
  }
  console.log(JSON.stringify({ visits, drawn_ms: Math.min(...visits.map((v) => v.drawn_ms)) }));
} finally {
  await browser.close();
}

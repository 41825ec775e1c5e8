// The distribution's Chromium, headless and without anything it would do by itself; and axe-core for its pages.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { chromium } from "playwright-core";

/** A walk that hangs fails. */
const MOST_MS = 240_000;
setTimeout(() => {
  console.error(`it takes longer than ${MOST_MS / 1000} s`);
  process.exit(1);
}, MOST_MS).unref();

const axeSource = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

export const start = () =>
  chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: [
      "--headless",
      "--no-sandbox",
      "--disable-gpu",
      "--disable-quic",
      "--no-first-run",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
    ],
  });

/** The page as it is has no violations of accessibility. */
export async function withoutViolations(page) {
  await page.evaluate(axeSource);
  const { violations } = await page.evaluate("axe.run()");
  assert.deepEqual(violations.map((v) => `${v.id}: ${v.nodes[0]?.html}`), []);
}

// Takes every file of every figure at some places of the page. Usage: node figures.mjs URL FOLDER PLACE...
// Prints, as JSON, the figures' titles with the names of their files.
import assert from "node:assert/strict";
import { join } from "node:path";
import { start } from "./browser.mjs";

const [url, folder, ...places] = process.argv.slice(2);
assert.ok(url && folder && places.length > 0, "usage: node figures.mjs URL FOLDER PLACE...");

const browser = await start();
try {
  const page = await (await browser.newContext({ viewport: { width: 1280, height: 900 } })).newPage();
  const faults = [];
  page.on("pageerror", (e) => faults.push(String(e)));
  const taken = [];
  for (const place of places) {
    await page.goto("about:blank");
    await page.goto(`${url}/${place}`);
    await page.locator("figure.figure .drawing canvas").first().waitFor({ timeout: 20_000 });
    await page.waitForLoadState("networkidle");
    // Nothing is under way any more.
    await page.locator("figure.figure[aria-busy=true]").waitFor({ state: "detached" });
    const figures = page.locator("figure.figure");
    for (let i = 0; i < (await figures.count()); i += 1) {
      const figure = figures.nth(i);
      const title = await figure.getByRole("heading").textContent();
      const files = {};
      for (const kind of ["SVG", "PNG", "CSV", "Python"]) {
        const [download] = await Promise.all([
          page.waitForEvent("download"),
          figure.getByRole("button", { name: kind, exact: true }).click(),
        ]);
        files[kind] = `${taken.length}-${download.suggestedFilename()}`;
        await download.saveAs(join(folder, files[kind]));
        // The browser drops whatever a page wants to save beyond ten files in a second.
        await page.waitForTimeout(120);
      }
      taken.push({ place, title, files });
    }
  }
  assert.deepEqual(faults, [], "the page reported errors");
  console.log(JSON.stringify(taken));
} finally {
  await browser.close();
}

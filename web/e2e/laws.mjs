// A glaciologist reads laws and sensitivities off the page, in a real browser against a running service.
// Usage: node laws.mjs URL GRID DESIGN LOCAL [folder for screenshots], with ids of three ensembles: steady states over
// melt rate and width (a grid with few widths, one of them 4000 m), a complete Saltelli design, and steady states over
// the melt rate with sensitivities. Prints what it saw as JSON.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { start, withoutViolations } from "./browser.mjs";

const [address, grid, design, local, folder] = process.argv.slice(2);
assert.ok(local, "usage: node laws.mjs URL GRID DESIGN LOCAL [folder]");
const url = address.replace(/\/$/, "");

const browser = await start();
const seen = {};
try {
  const context = await browser.newContext({ viewport: { width: 1280, height: 900 }, acceptDownloads: true });
  const page = await context.newPage();
  page.setDefaultTimeout(45_000);
  const faults = [];
  page.on("pageerror", (e) => faults.push(String(e)));
  const shot = async (name) => folder && page.screenshot({ path: `${folder}/${name}.png`, fullPage: true });
  const go = (place) => page.goto(`${url}/#/sweep/${place}`);
  const used = (n) => page.getByText("Runs used").first().locator("xpath=../dd").filter({ hasText: String(n) }).waitFor();
  const text = async (id) => (await page.getByTestId(id).textContent()).trim();

  // One law for all runs: it is said that it lumps the widths.
  await go(`${grid}/laws`);
  await page.getByTestId("exponent").waitFor({ timeout: 20_000 });
  seen.exponent = await text("exponent");
  seen.interval = await text("interval");
  seen.used = (await page.getByText("Runs used").locator("xpath=../dd").textContent()).trim();
  await page.getByText("fjord width W varies too").waitFor();
  await withoutViolations(page);
  await shot("law");

  // Files of the figure hold its numbers, and ask for the same law.
  const files = page.getByRole("group", { name: /^Files of Force per unit width F\/W against melt rate/ });
  const saved = async (kind) => {
    const [download] = await Promise.all([page.waitForEvent("download"), files.getByRole("button", { name: kind }).click()]);
    return readFile(await download.path(), "utf8");
  };
  const rows = (await saved("CSV")).trim().split("\r\n");
  seen.csv_points = rows.filter((row) => row.startsWith("F/W (Eq. 30),")).length;
  seen.python = await saved("Python");
  assert.match(await saved("SVG"), /^<svg/);

  // One law per width, from the button beside the warning.
  await page.getByRole("button", { name: "One law per fjord width W" }).click();
  const table = page.getByRole("region", { name: "Exponent for each fjord width W" });
  await table.waitFor();
  assert.match(page.url(), /by=width_m/);
  seen.groups = await table.locator("tbody tr").evaluateAll((trs) => trs.map((tr) => [...tr.children].map((cell) => cell.textContent.trim())));
  await page.getByText(/^Exponent of the power law of force per unit width F\/W over melt rate against fjord width W/).waitFor();
  await withoutViolations(page);
  await shot("laws-by-width");

  // Of one width alone the law is that of its group; other units leave its exponent and change its prefactor.
  await page.getByRole("combobox", { name: "One law", exact: true }).selectOption("");
  const filter = page.getByLabel("Only runs with");
  await filter.fill("widthh = 4000");
  await filter.press("Enter");
  await page.getByRole("alert").filter({ hasText: "character 1" }).waitFor();
  assert.equal(await page.locator(".refused mark").textContent(), "w");
  await withoutViolations(page);
  await filter.fill("width_m = 4000");
  await filter.press("Enter");
  await page.getByText("fjord width W varies too").waitFor({ state: "detached" });
  seen.exponent_4000 = await text("exponent");
  await page.getByRole("combobox", { name: "Law", exact: true }).selectOption("exponential");
  await page.getByText("Local rate of force per unit width F/W over melt rate").first().waitFor();
  seen.rate_per_day = await text("exponent");
  await page.getByRole("combobox", { name: "Speeds" }).selectOption("m_per_a");
  await page.getByText("exp(", { exact: false }).first().waitFor();
  seen.rate_per_a = await text("exponent");
  assert.match(page.url(), /speed=m_per_a/);
  // The link shows the same.
  await page.reload();
  await page.getByTestId("exponent").waitFor({ timeout: 20_000 });
  assert.equal(await text("exponent"), seen.rate_per_a);

  // A click on a point opens its run.
  await go(`${grid}/laws?filter=width_m+%3D+4000`);
  await page.getByTestId("exponent").waitFor();
  await used("");
  const box = await page.locator(".figure canvas").first().boundingBox();
  for (let k = 0; k < 600 && !page.url().includes("/profiles"); k += 1) {
    await page.mouse.click(box.x + box.width * 0.35 + 5 * Math.floor(k / 90), box.y + 40 + (k % 90) * 4);
  }
  seen.opened = /profiles\?.*runs=(\d+)/.exec(page.url())?.[1];
  assert.ok(seen.opened, "no point could be clicked");

  // A brush, typed and drawn, and the law of the runs within.
  await go(`${grid}/sensitivity`);
  await page.getByLabel("fjord width W from").fill("4000");
  await page.getByLabel("fjord width W from").press("Tab");
  await page.getByText(/^\d+ of \d+ runs that are drawn/).waitFor();
  seen.brushed = await text("brushed");
  await withoutViolations(page);
  await shot("parallel");
  const lines = await page.locator(".figure canvas").first().boundingBox();
  await page.mouse.move(lines.x + 60, lines.y + 120);
  await page.mouse.down();
  await page.mouse.move(lines.x + 60, lines.y + 300, { steps: 8 });
  await page.mouse.up();
  await page.waitForFunction(() => location.hash.includes("melt_rate_m_per_day"));
  seen.drawn = await page.getByLabel("melt rate from").inputValue();
  assert.ok(Number(seen.drawn) > 0, "the drawn brush is listed");
  await page.getByRole("link", { name: "The law of the runs in the brush" }).click();
  await page.getByTestId("exponent").waitFor();
  assert.match(await page.getByLabel("Only runs with").inputValue(), /4000 <= width_m/);

  // Two parameters as a map; indices of a design, refused elsewhere; derivatives.
  await go(`${grid}/sensitivity?view=map`);
  await page.getByRole("heading", { name: /^Force per unit width F\/W over melt rate and fjord width W/ }).waitFor();
  await withoutViolations(page);
  await shot("map");
  await page.getByRole("link", { name: "Sobol indices" }).click();
  seen.refusal = await text("refusal");
  await page.getByRole("link", { name: "Submit a Saltelli design" }).waitFor();
  await go(`${design}/sensitivity`);
  await page.getByRole("heading", { name: /^Sobol indices of force per unit width/ }).waitFor();
  seen.indices = await page.locator("[data-testid^='first-'], [data-testid^='total-']").evaluateAll((cells) => Object.fromEntries(cells.map((c) => [c.dataset.testid, c.textContent.trim()])));
  await withoutViolations(page);
  await shot("sobol");
  await go(`${local}/sensitivity`);
  await page.getByRole("heading", { name: /^Local sensitivities of force per unit width F\/W over melt rate/ }).waitFor();
  await page.emulateMedia({ colorScheme: "dark" });
  await page.waitForFunction(() => document.documentElement.dataset.theme === "dark");
  await withoutViolations(page);
  await shot("local-dark");

  // On a phone nothing is wider than the screen.
  await page.setViewportSize({ width: 390, height: 844 });
  for (const place of [`${grid}/laws?by=width_m`, `${grid}/sensitivity`]) {
    await go(place);
    await page.locator(".figure canvas").first().waitFor();
    const [wide, screen] = await page.evaluate(() => [document.documentElement.scrollWidth, window.innerWidth]);
    assert.ok(wide <= screen, `${place} is ${wide} wide`);
  }
  assert.deepEqual(faults, [], "the page reported errors");
  console.log(JSON.stringify(seen));
} finally {
  await browser.close();
}

// The page itself, whatever it shows: below another path, small to load, by keyboard, on a phone, light and dark, with
// its view in its address. Usage: node shell.mjs URL SWEEP EMPTY_URL [folder for screenshots]
// Prints what it saw as JSON.
import assert from "node:assert/strict";
import http from "node:http";
import { start, withoutViolations } from "./browser.mjs";

const [url, sweep, emptyUrl, folder] = process.argv.slice(2);
assert.ok(url && sweep && emptyUrl, "usage: node shell.mjs URL SWEEP EMPTY_URL [folder]");

/** Passes on what lies below a path, as a proxy in front of the service does. */
const PREFIX = "/lab/melange";
const strays = [];
const proxy = http.createServer((request, response) => {
  if (!request.url?.startsWith(`${PREFIX}/`)) {
    strays.push(request.url);
    response.writeHead(404).end();
    return;
  }
  const target = new URL(request.url.slice(PREFIX.length), url);
  const headers = { ...request.headers, host: target.host };
  delete headers.origin;
  const onward = http.request(target, { method: request.method, headers }, (answer) => {
    response.writeHead(answer.statusCode ?? 502, answer.headers);
    answer.pipe(response);
  });
  onward.on("error", () => response.destroy());
  request.pipe(onward);
});
await new Promise((listening) => proxy.listen(0, "127.0.0.1", listening));
const below = `http://127.0.0.1:${proxy.address().port}${PREFIX}/`;

const browser = await start();
/** A page that must not fail, fetch anything from elsewhere or be refused what it asks for. */
async function open(address, options = {}) {
  const page = await (await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options })).newPage();
  const faults = [];
  page.on("pageerror", (e) => faults.push(String(e)));
  page.on("console", (m) => m.type() === "error" && faults.push(m.text()));
  page.on("request", (r) => {
    const { origin } = new URL(r.url());
    if (origin !== "null" && origin !== new URL(address).origin && !r.url().startsWith("blob:")) faults.push(`asked ${r.url()}`);
  });
  await page.goto(address);
  return { page, faults };
}
const drawn = (page) => page.locator("figure.figure .drawing canvas").first().waitFor({ timeout: 20_000 });

try {
  const seen = {};

  // Below a path: everything that is asked for lies there, too.
  const { page, faults } = await open(below);
  await drawn(page);
  await page.getByTestId("exponent").waitFor();
  seen.exponent = await page.getByTestId("exponent").textContent();
  assert.ok(page.url().startsWith(`${below}#/sweep/`), `the address holds the view: ${page.url()}`);
  seen.bytes = await page.evaluate(() =>
    [...performance.getEntriesByType("resource"), ...performance.getEntriesByType("navigation")]
      .filter((entry) => /\.(js|css|html)$|\/$/.test(new URL(entry.name).pathname))
      .reduce((sum, entry) => sum + entry.encodedBodySize, 0),
  );
  assert.ok(seen.bytes > 50_000 && seen.bytes < 500_000, `${seen.bytes} bytes to load`);
  assert.deepEqual(strays, [], "asked for outside the path");

  // The switch of units changes the numbers and the address; the address brings the numbers back.
  await page.goto(`${below}#/sweep/${sweep}/laws?x=melt_rate_m_per_day&law=linear`);
  await page.waitForFunction((old) => document.querySelector("[data-testid=exponent]")?.textContent !== old, seen.exponent);
  const slope = page.getByTestId("exponent");
  const perDay = await slope.textContent();
  await page.getByLabel("Speeds").selectOption("m_per_a");
  await page.waitForFunction((old) => document.querySelector("[data-testid=exponent]")?.textContent !== old, perDay);
  seen.slopes = [perDay, await slope.textContent()];
  assert.ok(page.url().includes("speed=m_per_a"), page.url());
  const colleague = await open(page.url());
  await colleague.page.getByTestId("exponent").waitFor();
  assert.equal(await colleague.page.getByTestId("exponent").textContent(), seen.slopes[1]);
  await colleague.page.context().close();

  // By keyboard: the first stop leads past the list, a tab opens its panel.
  await page.locator("body").press("Tab");
  assert.equal(await page.evaluate(() => document.activeElement?.className), "skip");
  await page.keyboard.press("Enter");
  assert.equal(await page.evaluate(() => document.activeElement?.id), "main");
  await page.getByRole("link", { name: "Profiles", exact: true }).focus();
  await page.keyboard.press("Enter");
  await drawn(page);
  assert.ok(page.url().includes("/profiles"), page.url());
  await page.goBack();
  await page.getByTestId("exponent").waitFor();

  // Dark by the switch, and kept.
  await page.getByLabel("Theme").selectOption("dark");
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), "dark");
  await withoutViolations(page);
  await page.reload();
  await drawn(page);
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), "dark");
  if (folder) await page.screenshot({ path: `${folder}/shell-dark.png`, fullPage: true });
  assert.deepEqual(faults, []);
  await page.context().close();

  // On a phone nothing is wider than the screen, in any panel.
  const phone = await open(url, { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
  for (const panel of ["overview", "laws", "profiles", "seasons", "sensitivity", "stability"]) {
    await phone.page.goto(`${url}/#/sweep/${sweep}/${panel}`);
    await phone.page.getByRole("navigation", { name: "Panels" }).waitFor();
    await phone.page.waitForLoadState("networkidle");
    const width = await phone.page.evaluate(() => document.documentElement.scrollWidth);
    assert.ok(width <= 391, `${panel} is ${width} pixels wide on a phone`);
    await withoutViolations(phone.page);
    if (folder) await phone.page.screenshot({ path: `${folder}/phone-${panel}.png`, fullPage: true });
  }
  for (const place of ["new", "compare", "import"]) {
    await phone.page.goto(`${url}/#/${place}`);
    await phone.page.waitForLoadState("networkidle");
    const width = await phone.page.evaluate(() => document.documentElement.scrollWidth);
    assert.ok(width <= 391, `${place} is ${width} pixels wide on a phone`);
    await withoutViolations(phone.page);
  }
  assert.deepEqual(phone.faults, []);
  await phone.page.context().close();

  // A place that is not there, and an archive without anything, say so.
  const lost = await open(`${url}/#/sweep/00000000000000000000000000000000/laws`);
  await lost.page.getByRole("heading", { name: "Not here" }).waitFor();
  await withoutViolations(lost.page);
  await lost.page.context().close();
  const empty = await open(emptyUrl);
  await empty.page.getByRole("heading", { name: "No ensemble yet" }).waitFor();
  await withoutViolations(empty.page);
  await empty.page.getByRole("link", { name: "Submit a sweep" }).click();
  await empty.page.getByRole("heading", { name: "New ensemble" }).waitFor();
  await empty.page.context().close();

  // A service that is gone is told of, and what was shown stays.
  const orphan = await open(below);
  await drawn(orphan.page);
  // First nobody new, then whoever is there.
  proxy.close();
  proxy.closeAllConnections();
  await orphan.page.getByRole("alert").filter({ hasText: "does not answer" }).waitFor({ timeout: 20_000 });
  assert.ok(await orphan.page.getByTestId("exponent").isVisible());

  console.log(JSON.stringify(seen));
} finally {
  await browser.close();
  proxy.close();
}

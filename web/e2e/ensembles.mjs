// Ensembles in a real browser: what one is and why runs of it have no state; tags, notes, filters; a document in the
// form and as text, tried and submitted; progress, cancelling, the trash and back; comparing. Against a service where
// nobody has to log in. Usage: node ensembles.mjs URL MELT_ID VERDICTS_ID. Prints what it saw as JSON.
import assert from "node:assert/strict";
import { start, withoutViolations } from "./browser.mjs";

const [url, melt, verdicts] = process.argv.slice(2);
assert.ok(verdicts, "usage: node ensembles.mjs URL MELT_ID VERDICTS_ID");

const browser = await start();
const faults = [];

async function open(place, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(45_000);
  page.on("pageerror", (e) => faults.push(String(e)));
  await page.goto(`${url}/#/${place}`);
  return page;
}

const region = (page, name) => page.getByRole("region", { name, exact: true });
const document = (page) => page.getByLabel("Document, as it will be sent (JSON)");
const spec = async (page) => JSON.parse(await document(page).inputValue());

/** The ensemble's facts, its reasons for runs without a state, its tags and note. */
async function overview(seen) {
  const page = await open(`sweep/${verdicts}/overview`);
  const reasons = region(page, "Runs without a state");
  await reasons.locator("details").first().waitFor();
  seen.reasons = await reasons.locator("summary").allTextContents();
  seen.without = await reasons.locator("p").first().textContent();
  await reasons.locator("summary").first().click();
  seen.example = await reasons.getByRole("link", { name: /^Run \d+$/ }).first().getAttribute("href");
  seen.facts = await region(page, "What it is").textContent();
  seen.downloads = await region(page, "Downloads").getByRole("link").evaluateAll((links) => links.map((link) => link.href));

  await page.getByLabel("More tags").fill("seen, twice");
  await page.getByRole("button", { name: "Add tags" }).click();
  await page.getByRole("button", { name: "Remove the tag twice" }).click();
  await page.getByRole("button", { name: "Remove the tag twice" }).waitFor({ state: "detached" });
  await page.getByRole("button", { name: "Rename or write a note" }).click();
  await page.getByLabel("Note, in Markdown").fill("Beyond the **threshold**.");
  await page.getByRole("button", { name: "Save" }).click();
  assert.equal(await page.getByTestId("note").locator("strong").textContent(), "threshold");
  await withoutViolations(page);

  // A tag as a filter, in the address.
  const chip = page.getByRole("button", { name: "seen", exact: true });
  await chip.click();
  await page.getByRole("status").filter({ hasText: "1 ensemble found." }).waitFor();
  assert.equal(await chip.getAttribute("aria-pressed"), "true");
  assert.equal(await page.getByRole("searchbox", { name: "Find" }).inputValue(), 'tag = "seen"');
  const linked = await open(page.url().split("#/")[1]);
  await linked.getByRole("status").filter({ hasText: "1 ensemble found." }).waitFor();
  await linked.context().close();
  await chip.click();
  // More than a page of them.
  await page.getByText(/^Showing 100 of \d+\.$/).waitFor();
  await page.getByRole("button", { name: "Show more" }).click();
  await page.getByText(/^Showing 100 of/).waitFor({ state: "detached" });
  seen.listed = await page.locator(".entry").count();
  await page.context().close();
}

/** The document by the form and as text; tried, refused, submitted once. */
async function submit(seen) {
  const page = await open("new", { colorScheme: "dark" });
  await page.getByLabel("Points", { exact: true }).fill("6");
  await page.getByLabel("fjord width W (m)", { exact: true }).fill("4500");
  await page.getByLabel("Tags, with commas between").fill("form");
  const written = await spec(page);
  assert.deepEqual(written.axes, [{ parameter: "melt_rate_m_per_day", linspace: [0.5, 1, 6] }]);
  assert.deepEqual([written.parameters, written.tags], [{ width_m: 4500 }, ["form"]]);

  // What the form does not show stays; what cannot be read is not touched.
  const whole = { ...written, name: "by hand", fjord: { x_m: [0, 40000], width_m: [4000, 4400] } };
  delete whole.parameters;
  await document(page).fill(JSON.stringify(whole));
  await page.getByText("The form does not show “fjord”").waitFor();
  assert.equal(await page.getByLabel("Name", { exact: true }).inputValue(), "by hand");
  await page.getByLabel("From", { exact: true }).fill("-1");
  assert.deepEqual((await spec(page)).fjord, whole.fjord);
  const good = await document(page).inputValue();
  await document(page).fill(good.slice(0, -2));
  await page.getByRole("heading", { name: "The form waits" }).waitFor();
  await withoutViolations(page);
  assert.equal(await document(page).inputValue(), good.slice(0, -2));
  await document(page).fill(good);

  // A refusal stands at its field and beside the text.
  await page.getByRole("button", { name: "Dry run" }).click();
  await page.getByRole("alert").filter({ hasText: "parameters.melt_rate_m_per_day" }).waitFor();
  await page.getByRole("group", { name: "Axis 1" }).getByText("0 to 100").waitFor();
  await withoutViolations(page);
  await page.getByLabel("From", { exact: true }).fill("0.5x");
  await page.getByText("This is not a number.").waitFor();
  await page.getByLabel("From", { exact: true }).fill("0.6");
  assert.ok(await page.getByRole("button", { name: "Solve", exact: true }).isDisabled(), "no run without a dry run");
  await page.getByRole("button", { name: "Dry run" }).click();
  const solve = page.getByRole("button", { name: "Solve 6 runs" });
  await solve.waitFor();
  seen.dryRun = await page.getByRole("status").filter({ hasText: "Dry run: 6 runs" }).textContent();
  await withoutViolations(page);
  await solve.dblclick();
  await page.getByRole("heading", { name: "by hand", level: 2, exact: true }).waitFor();
  seen.submitted = page.url().match(/sweep\/([0-9a-f]+)/)?.[1];

  // Duplicated with changes, from the whole document.
  await page.goto(`${url}/#/sweep/${seen.submitted}/overview`);
  await page.getByText("6 converged").first().waitFor({ timeout: 20_000 });
  await region(page, "What to do with it").getByRole("link", { name: "Duplicate with changes" }).click();
  await page.getByText("The form does not show “fjord”").waitFor();
  assert.equal((await spec(page)).name, "by hand, changed");
  await page.context().close();
}

/** A long one: progress, cancelled, deleted, brought back. */
async function follow(seen) {
  const page = await open("new?preset=saltelli");
  const long = {
    name: "long",
    regime: "steady",
    parameters: { n_cells: 400 },
    sample: { method: "uniform", n: 4000, seed: 1, ranges: { melt_rate_m_per_day: [0.5, 0.9], width_m: [3500, 5000] } },
  };
  await document(page).fill(JSON.stringify(long));
  await page.getByRole("button", { name: "Dry run" }).click();
  await page.getByRole("button", { name: "Solve 4,000 runs" }).click();
  await page.getByRole("heading", { name: "long", level: 2, exact: true }).waitFor();
  const overviewTab = page.getByRole("navigation", { name: "Panels" }).getByRole("link", { name: "Overview" });
  await overviewTab.click();
  const progress = region(page, "Progress");
  await progress.getByText(/runs per second/).waitFor({ timeout: 20_000 });
  await progress.getByText(/^about /).waitFor();
  seen.progress = await progress.locator("dl").textContent();
  await withoutViolations(page);
  await page.getByRole("button", { name: "Cancel", exact: true }).click();
  const dialog = page.getByRole("dialog");
  await withoutViolations(page);
  await dialog.getByRole("button", { name: "Leave it" }).click();
  await dialog.waitFor({ state: "detached" });
  await page.getByRole("button", { name: "Cancel", exact: true }).click();
  await dialog.getByRole("button", { name: "Cancel it" }).click();
  await page.getByRole("button", { name: "Resume" }).waitFor({ timeout: 20_000 });
  await progress.waitFor({ state: "detached" });

  await page.getByRole("button", { name: "Delete", exact: true }).click();
  await dialog.getByRole("button", { name: "Delete it" }).click();
  await page.getByText("“long” lies in the trash.").waitFor();
  await page.getByRole("link", { name: "Trash" }).click();
  await page.getByRole("button", { name: "Bring back long" }).waitFor();
  await withoutViolations(page);
  await page.getByRole("button", { name: "Bring back long" }).click();
  await page.getByRole("heading", { name: "long", level: 2, exact: true }).waitFor();
  await page.context().close();
}

/** Two ensembles beside each other, chosen by ticks; on a phone too. */
async function compare(seen) {
  const page = await open(`compare?ids=${melt}`);
  await page.getByText("One more is needed to compare with.").waitFor();
  await page.getByRole("searchbox", { name: "Find" }).fill(`id = "${verdicts}"`);
  await page.getByRole("searchbox", { name: "Find" }).press("Enter");
  // Before, the first of the list is another one.
  await page.getByRole("status").filter({ hasText: "1 ensemble found." }).waitFor();
  await page.getByRole("checkbox", { name: /^Compare / }).first().check();
  await page.getByTestId("comparison").waitFor();
  seen.comparison = await page.getByTestId("comparison").textContent();
  seen.exponents = await page.locator("tr", { hasText: "Exponent of force" }).locator("strong").allTextContents();
  await page.locator(".figure canvas").waitFor();
  await withoutViolations(page);
  const phone = await open(page.url().split("#/")[1], { viewport: { width: 390, height: 844 } });
  await phone.getByTestId("comparison").waitFor();
  assert.ok(!(await phone.getByRole("searchbox", { name: "Find" }).isVisible()), "the list makes way");
  const width = await phone.evaluate("document.documentElement.scrollWidth");
  assert.ok(width <= 390, `the page is ${width} px wide on a phone`);
  await withoutViolations(phone);
  await phone.context().close();
  await page.context().close();
}

try {
  const seen = {};
  for (const part of [overview, submit, follow, compare]) await part(seen);
  assert.deepEqual(faults, [], "the page reported errors");
  console.log(JSON.stringify(seen));
} finally {
  await browser.close();
}

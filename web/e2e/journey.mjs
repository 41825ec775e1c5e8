// A group's way through the page in a real browser: an admin invites two people, one submits, the other
// finds, tags and compares, may not cancel, seals their own and exports it; a second, empty service takes
// it in. Usage: node journey.mjs URL TOKEN EMPTY_URL FOLDER [screenshots]. Prints what it saw as JSON.
import assert from "node:assert/strict";
import { join } from "node:path";
import { start, withoutViolations } from "./browser.mjs";

const [url, adminToken, emptyUrl, folder, screenshots] = process.argv.slice(2);
assert.ok(folder, "usage: node journey.mjs URL TOKEN EMPTY_URL FOLDER [screenshots]");

const browser = await start();

async function open(address) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 1100 } });
  const page = await context.newPage();
  page.on("pageerror", (e) => assert.fail(String(e)));
  page.on("console", (m) => {
    if (m.text().includes("Content Security Policy")) assert.fail(m.text());
  });
  await page.goto(address);
  return page;
}

const overview = (page) => page.getByRole("navigation", { name: "Panels" }).getByRole("link", { name: "Overview" }).click();
const listed = (page, name) => page.getByRole("region", { name: "Ensembles" }).getByRole("link", { name });

async function enter(token) {
  const page = await open(url);
  await page.getByLabel("Token").fill(token);
  await page.getByRole("button", { name: "Log in" }).click();
  await page.getByRole("button", { name: "Log out" }).waitFor();
  return page;
}

async function invite(page, name) {
  await page.getByLabel("Name of a person").fill(name);
  await page.getByRole("button", { name: "Invite" }).click();
  await page.getByText(`${name}'s token`).waitFor();
  return page.getByTestId("token").textContent();
}

async function solve(page, name, from, points) {
  // Where there is no ensemble yet, the page says where to begin; the bar always does.
  await page.getByRole("link", { name: "New sweep" }).click();
  await page.getByLabel("Name", { exact: true }).fill(name);
  await page.getByLabel("From", { exact: true }).fill(String(from));
  await page.getByLabel("Points", { exact: true }).fill(String(points));
  await page.getByRole("button", { name: "Dry run" }).click();
  await page.getByRole("button", { name: `Solve ${points} runs` }).click();
  await page.getByRole("heading", { name, level: 2, exact: true }).waitFor();
  await page.getByText(`${points} converged`).first().waitFor({ timeout: 60_000 });
  await page.getByText("Runs used").locator("xpath=../dd").filter({ hasText: String(points) }).waitFor();
}

try {
  const seen = {};
  const look = await open(url);
  await look.getByRole("heading", { name: "Log in" }).waitFor();
  await withoutViolations(look);
  await look.getByLabel("Token").fill("melange_wrong");
  await look.getByRole("button", { name: "Log in" }).click();
  await look.getByRole("alert").filter({ hasText: "nobody's" }).waitFor();
  await look.context().close();

  const ada = await enter(adminToken);
  await ada.getByText("People", { exact: true }).click();
  const [boToken, cyToken] = [await invite(ada, "bo"), await invite(ada, "cy")];
  await withoutViolations(ada);
  if (screenshots) await ada.screenshot({ path: join(screenshots, "people.png"), fullPage: true });
  await ada.getByRole("button", { name: "Log out" }).click();
  await ada.getByRole("heading", { name: "Log in" }).waitFor();
  await ada.context().close();

  const bo = await enter(boToken);
  await solve(bo, "melt of bo", 0.6, 5);
  assert.equal(await bo.getByText("People", { exact: true }).count(), 0, "bo is no admin");
  await bo.context().close();

  const cy = await enter(cyToken);
  await solve(cy, "melt of cy", 0.6, 9);
  await cy.getByLabel("Find").fill('owner = "bo" and converged = 5');
  await cy.getByLabel("Find").press("Enter");
  await cy.getByText("1 ensemble found.").waitFor();
  await listed(cy, "melt of bo").click();
  await cy.getByRole("heading", { name: "melt of bo", level: 2, exact: true }).waitFor();
  await overview(cy);
  await cy.getByText("Only its owner and an admin may change it.").waitFor();
  for (const name of ["Delete", "Cancel", "Pause"]) {
    assert.equal(await cy.getByRole("button", { name, exact: true }).count(), 0, name);
  }
  await cy.getByLabel("More tags").fill("paper, checked");
  await cy.getByRole("button", { name: "Add tags" }).click();
  await cy.locator(".entry .tag").filter({ hasText: "checked" }).waitFor();
  assert.equal(await cy.getByRole("button", { name: "Remove the tag checked" }).count(), 0, "others take no tags away");
  await cy.getByLabel("Find").fill('tag = "paper"');
  await cy.getByLabel("Find").press("Enter");
  await cy.getByText("1 ensemble found.").waitFor();
  await cy.getByLabel("Find").fill("");
  await cy.getByLabel("Find").press("Enter");
  await listed(cy, "melt of cy").click();
  await cy.getByRole("heading", { name: "melt of cy", level: 2, exact: true }).waitFor();
  await overview(cy);
  await cy.getByRole("main").getByRole("link", { name: "Compare" }).click();
  await cy.getByRole("combobox", { name: /^Compare with/ }).selectOption({ label: "melt of bo, bo" });
  seen.comparison = await cy.getByTestId("comparison").textContent();
  if (screenshots) await cy.screenshot({ path: join(screenshots, "compare.png"), fullPage: true });
  await listed(cy, "melt of cy").click();
  await cy.getByTestId("exponent").waitFor();
  seen.exponent = await cy.getByTestId("exponent").textContent();

  await overview(cy);
  await cy.getByText("Seal", { exact: true }).click();
  await cy.getByLabel("Title").fill("Melt & force, by cy");
  await cy.getByLabel("Author", { exact: true }).fill("Cy Tester");
  await cy.getByLabel("ORCID of the author").fill("0000-0002-1825-0097");
  await cy.getByRole("button", { name: "Seal for good" }).click();
  await withoutViolations(cy);
  await cy.getByRole("dialog").getByRole("button", { name: "Seal it for good" }).click();
  await cy.getByRole("heading", { name: "Sealed" }).waitFor();
  seen.citation = await cy.getByTestId("citation").textContent();
  assert.equal(await cy.getByLabel("More tags").count(), 0, "a sealed one keeps its tags");
  assert.equal(await cy.getByRole("button", { name: "Delete" }).count(), 0, "and stays");
  await withoutViolations(cy);
  if (screenshots) await cy.screenshot({ path: join(screenshots, "sealed.png"), fullPage: true });
  const [download] = await Promise.all([
    cy.waitForEvent("download"),
    cy.getByRole("link", { name: "Export" }).click(),
  ]);
  const archive = join(folder, "export.tar.zst");
  await download.saveAs(archive);
  await cy.context().close();

  const other = await open(emptyUrl);
  await other.getByRole("link", { name: "Import an archive" }).click();
  await withoutViolations(other);
  await other.getByLabel("Archive of an export").setInputFiles(archive);
  await other.getByRole("button", { name: "Import" }).click();
  await other.getByRole("heading", { name: "melt of cy", level: 2, exact: true }).waitFor();
  await other.getByText("Runs used").locator("xpath=../dd").filter({ hasText: "9" }).waitFor();
  assert.equal(await other.getByTestId("exponent").textContent(), seen.exponent);
  await overview(other);
  assert.equal(await other.getByTestId("citation").textContent(), seen.citation);
  await other.context().close();
  console.log(JSON.stringify(seen));
} finally {
  await browser.close();
}

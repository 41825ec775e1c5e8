// A person's way through the dashboard in a real browser, against a running service that holds the
// demo's sweep. Usage: node dashboard.mjs URL [folder for screenshots]. Prints what it saw as JSON.
import assert from "node:assert/strict";
import { start, withoutViolations } from "./browser.mjs";

const [url, folder] = process.argv.slice(2);
assert.ok(url, "usage: node dashboard.mjs URL [folder]");

const browser = await start();
try {
  const seen = {};
  for (const colorScheme of ["dark", "light"]) {
    const context = await browser.newContext({ viewport: { width: 1280, height: 1180 }, colorScheme });
    const page = await context.newPage();
    const elsewhere = [];
    const faults = [];
    page.on("request", (r) => {
      if (!r.url().startsWith(url) && !r.url().startsWith("data:")) elsewhere.push(r.url());
    });
    page.on("pageerror", (e) => faults.push(String(e)));
    page.on("console", (m) => m.type() === "error" && faults.push(m.text()));

    await page.goto(url);
    const exponent = page.getByTestId("exponent");
    await exponent.waitFor({ timeout: 20_000 });
    await page.getByText("51 converged").first().waitFor({ timeout: 20_000 });
    await page.getByText("Runs used").locator("xpath=../dd").filter({ hasText: "51" }).waitFor();
    seen.exponent = await exponent.textContent();
    seen.interval = await page.getByTestId("interval").textContent();

    // A click on a point of the force curve leads to its run. The base case lies on it.
    const laws = page.url();
    const canvas = page.locator(".figure canvas").first();
    const box = await canvas.boundingBox();
    assert.ok(box);
    const opened = async () => /\/profiles\?.*runs=\d+/.test(page.url());
    // Feel down a strip about as wide as two neighbouring points are apart, in steps of half a point.
    for (let k = 0; k < 400 && !(await opened()); k += 1) {
      const x = box.x + box.width * 0.4 + 4 * Math.floor(k / 80);
      const y = box.y + 45 + (k % 80) * 4;
      await page.mouse.click(x, y);
    }
    assert.ok(await opened(), "no point could be clicked");
    await page.getByText("Thickness about sea level").first().waitFor();
    const thickness = await page.getByTestId("thickness_0_m").textContent();
    const [, id, index] = page.url().match(/sweep\/(\w+)\/profiles\?.*runs=(\d+)/) ?? [];
    const table = await fetch(`${url}/api/v1/sweeps/${id}/runs?filter=${encodeURIComponent(`run_index = ${index}`)}`);
    const [run] = (await table.json()).items;
    assert.equal(Number.parseFloat(thickness ?? ""), Number(run.thickness_0_m.toPrecision(4)), "the run that was clicked");
    if (folder) await page.screenshot({ path: `${folder}/dashboard-${colorScheme}.png`, fullPage: true });

    await withoutViolations(page);
    await page.goto(laws);
    await exponent.waitFor();

    // A filter that is wrong is marked where it is wrong; one that is right finds.
    const find = page.getByRole("searchbox", { name: "Find" });
    await find.fill('name ~ "melt" and colour = 3');
    await find.press("Enter");
    await page.getByRole("alert").filter({ hasText: "character 19" }).waitFor();
    assert.equal(await page.locator(".refused mark").textContent(), "c");
    await withoutViolations(page);
    await find.fill("total > 1000");
    await find.press("Enter");
    await page.getByRole("status").filter({ hasText: "0 ensembles found" }).waitFor();
    assert.ok(await exponent.isVisible(), "what was chosen stays");
    await find.fill('tag = "noted" and total = 51');
    await find.press("Enter");
    await page.getByRole("status").filter({ hasText: "1 ensemble found" }).waitFor();
    await page.locator(".entry .tag", { hasText: "noted" }).waitFor();
    await page.getByRole("navigation", { name: "Panels" }).getByRole("link", { name: "Overview" }).click();
    // Its note is shown as HTML, and what is hostile in it as text.
    const note = page.getByTestId("note");
    assert.equal(await note.locator("strong").textContent(), "Fig. 4");
    assert.equal(await note.locator("script, img, [onerror]").count(), 0);
    assert.equal(await note.locator("a").getAttribute("rel"), "nofollow noopener");
    await find.fill("");
    await find.press("Enter");
    faults.splice(0, faults.length, ...faults.filter((f) => !f.includes("422")));

    if (colorScheme === "light") {
      // A bad value is refused with the server's own sentence, a good sweep is solved and fitted.
      await page.getByRole("link", { name: "New sweep" }).click();
      const dryRun = page.getByRole("button", { name: "Dry run" });
      await page.getByLabel("From", { exact: true }).fill("-1");
      await dryRun.click();
      await page.getByRole("alert").filter({ hasText: "melt_rate_m_per_day" }).waitFor();
      await page.getByLabel("Name", { exact: true }).fill("six by two");
      await page.getByLabel("From", { exact: true }).fill("0.6");
      await page.getByLabel("Points", { exact: true }).fill("6");
      await page.getByRole("button", { name: "Add an axis" }).click();
      await page.getByLabel("Points", { exact: true }).nth(1).fill("2");
      await dryRun.click();
      await page.getByRole("button", { name: "Solve 12 runs" }).click();
      await page.getByRole("heading", { name: "six by two", level: 2, exact: true }).waitFor();
      await page.getByText("12 converged").first().waitFor({ timeout: 60_000 });
      await page.getByText("Runs used").locator("xpath=../dd").filter({ hasText: "12" }).waitFor();
      faults.splice(0, faults.length, ...faults.filter((f) => !f.includes("422")));
    }
    assert.deepEqual(elsewhere, [], "something was fetched from elsewhere");
    assert.deepEqual(faults, [], "the page reported errors");
    await context.close();
  }
  console.log(JSON.stringify(seen));
} finally {
  await browser.close();
}

// Profiles, seasons and stability in a real browser, against a running service that holds the ensembles named:
//   node profiles.mjs URL STEADY RUN QUASI TRANSIENT BRANCH FOLDS [folder for scripts and screenshots]
// STEADY: many steady runs, of which RUN is singled out; QUASI: a quasi-static ensemble; TRANSIENT: transients with a
// periodic forcing and stored states; BRANCH, FOLDS: runs of these regimes. Prints what it saw as JSON.
import assert from "node:assert/strict";
import { join } from "node:path";
import { start, withoutViolations } from "./browser.mjs";

const [url, steady, run, quasi, transient, branch, folds, folder] = process.argv.slice(2);
assert.ok(folds, "usage: node profiles.mjs URL STEADY RUN QUASI TRANSIENT BRANCH FOLDS [folder]");

const browser = await start();
try {
  const seen = { titles: {}, scripts: [] };
  const faults = [];
  for (const colorScheme of ["light", "dark"]) {
    const isFirst = colorScheme === "light";
    const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, colorScheme });
    const page = await context.newPage();
    page.on("pageerror", (e) => faults.push(String(e)));
    page.on("console", (m) => ["error", "warning"].includes(m.type()) && faults.push(m.text()));

    /** Opens a panel, waits for a figure and checks the page. */
    const open = async (place, heading) => {
      await page.goto(`${url}/#/${place}`);
      await page.reload();
      await page.getByRole("heading", { name: heading }).waitFor();
      await page.waitForFunction(() => document.querySelectorAll(".drawing.waiting").length === 0);
    };
    const look = async (name) => {
      await withoutViolations(page);
      seen.titles[name] = await page.locator(".figure h3").allTextContents();
      if (folder) await page.screenshot({ path: join(folder, `${name}-${colorScheme}.png`), fullPage: true });
    };
    /** Saves the scripts of all figures in sight. */
    const scripts = async (name) => {
      if (!folder || !isFirst) return;
      const buttons = page.getByRole("button", { name: "Python" });
      for (let i = 0; i < (await buttons.count()); i += 1) {
        const [download] = await Promise.all([page.waitForEvent("download"), buttons.nth(i).click()]);
        const path = join(folder, `${name}-${i}.py`);
        await download.saveAs(path);
        seen.scripts.push(path);
      }
    };

    // Many runs, then one of them by the list, with its neighbours a step away.
    await open(`sweep/${steady}/profiles`, /^Speed across the fjord at χ = 0.5/);
    seen.showing = await page.getByRole("status").filter({ hasText: "Showing" }).textContent();
    await look("profiles");
    await scripts("profiles");
    await page.getByText("Choose runs").click();
    await page.getByRole("button", { name: `Only run ${run}`, exact: true }).click();
    await page.getByTestId("force_n_per_m").waitFor();
    seen.force = await page.getByTestId("force_n_per_m").textContent();
    seen.length = await page.getByTestId("length_m").textContent();
    assert.match(page.url(), new RegExp(`runs=${run}$`));
    await page.getByLabel("χ of the speed across").fill("0.2, 0.8");
    await page.getByLabel("χ of the speed across").press("Tab");
    await page.getByLabel("Beside it, a run of").selectOption(quasi);
    await page.waitForURL(/with=\w+(%3A|:)0/);
    await page.waitForFunction(() => document.querySelectorAll(".drawing.waiting").length === 0);
    await page.getByText("Dashed: quasi-static.").first().waitFor();
    await look("run");
    await scripts("run");
    // A link shows the same picture elsewhere.
    const link = page.url();
    const titles = await page.locator(".figure h3").allTextContents();
    const other = await context.newPage();
    await other.goto(link);
    await other.getByText("Dashed: quasi-static.").first().waitFor();
    await other.getByRole("heading", { name: /^Speed across/ }).waitFor();
    assert.deepEqual(await other.locator(".figure h3").allTextContents(), titles);
    await other.close();

    // Seasons: lags in numbers, steady states beside, snapshots by the slider.
    await open(`sweep/${transient}/seasons?with=${steady}`, /^Lag and amplitude of/);
    seen.lag = await page.getByTestId("lag-0").textContent();
    seen.alsoSwings = (await page.getByTestId("also-swings").textContent()).trim().replace(/\s+/g, " ");
    const slider = page.getByRole("slider", { name: /^Time/ });
    const before = await slider.getAttribute("aria-valuetext");
    await slider.press("ArrowRight");
    await page.waitForURL(/state=1/);
    seen.snapshots = [before, await slider.getAttribute("aria-valuetext")];
    await page.getByLabel("Loops over").selectOption("last");
    await page.getByRole("heading", { name: /over the last period/ }).first().waitFor();
    await look("seasons");
    await scripts("seasons");

    // Stability: a fold in numbers, growth rates of a point, the curve of folds.
    await open(`sweep/${branch}/stability`, /^Branch of steady states/);
    seen.fold = await page.getByTestId("folds").locator("tbody tr").first().locator("td").first().textContent();
    await page.getByRole("button", { name: "the first point" }).click();
    await page.getByRole("button", { name: "Next point" }).click();
    seen.verdict = await page.getByTestId("verdict").textContent();
    seen.rates = await page.getByTestId("growth").locator("tbody tr").first().locator("td").allTextContents();
    await page.getByLabel("Drawn upwards").selectOption("length_m");
    await page.getByRole("heading", { name: /: length L against/ }).waitFor();
    await look("stability");
    await scripts("stability");
    await open(`sweep/${folds}/stability`, /^Threshold of/);
    await look("folds");
    await scripts("folds");

    // What does not apply says so.
    await open(`sweep/${steady}/seasons`, "No seasons here");
    await withoutViolations(page);
    await open(`sweep/${steady}/stability`, "No branches here");
    await withoutViolations(page);

    // On a phone nothing is wider than the page.
    if (!isFirst) {
      await context.close();
      continue;
    }
    await page.setViewportSize({ width: 390, height: 844 });
    for (const place of [`sweep/${steady}/profiles`, `sweep/${transient}/seasons`, `sweep/${branch}/stability`]) {
      await open(place, /^(Speed along|Lag and amplitude of|Folds, and)/);
      const [wide, page_] = await page.evaluate("[document.documentElement.scrollWidth, innerWidth]");
      assert.ok(wide <= page_, `${place} is ${wide} px wide`);
    }
    await context.close();
  }
  assert.deepEqual(faults, [], "the page reported errors");
  console.log(JSON.stringify(seen));
} finally {
  await browser.close();
}

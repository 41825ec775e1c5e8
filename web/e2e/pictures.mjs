// Takes the README's pictures of the page, from the archive that `melange reproduce --out DIR` fills:
//   melange serve --data DIR/archive & node web/e2e/pictures.mjs http://127.0.0.1:8080 docs
import assert from "node:assert/strict";
import { join } from "node:path";
import { start } from "./browser.mjs";

const [url, folder] = process.argv.slice(2);
assert.ok(url && folder, "usage: node pictures.mjs URL FOLDER");

const { items } = await (await fetch(`${url}/api/v1/sweeps?limit=100`)).json();
/** Id of the ensemble whose name begins so. */
const sweep = (name) => {
  const found = items.find((item) => item.name.startsWith(name));
  assert.ok(found, `no ensemble begins with ${name}`);
  return found.id;
};
const PICTURES = [
  { file: "dashboard.png", place: `sweep/${sweep("Fig. 5")}/laws`, colorScheme: "light", height: 1250 },
  { file: "dashboard-profiles.png", place: `sweep/${sweep("Fig. 5")}/profiles`, colorScheme: "light", height: 1250 },
  { file: "dashboard-seasons.png", place: `sweep/${sweep("Fig. 7c, d")}/seasons?with=${sweep("Fig. 5")}`, colorScheme: "dark", height: 1250 },
];

const browser = await start();
try {
  for (const { file, place, colorScheme, height } of PICTURES) {
    const page = await (await browser.newContext({ viewport: { width: 1280, height }, colorScheme })).newPage();
    await page.goto(`${url}/#/${place}`);
    await page.locator("figure.figure .drawing canvas").first().waitFor();
    await page.waitForLoadState("networkidle");
    await page.locator("figure.figure[aria-busy=true]").waitFor({ state: "detached" });
    await page.screenshot({ path: join(folder, file) });
    await page.context().close();
  }
} finally {
  await browser.close();
}

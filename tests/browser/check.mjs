// Opens a report in a headless browser: `node check.mjs REPORT.html [FOLDER]`. At 375 and at 1440 pixels, in light and in
// dark, it must pass axe without a violation, fit the width, log no error and ask for nothing from elsewhere; the zoom must
// move the drawings. With a folder, a picture of each is kept there to be looked at.
//
// `run.sh` calls it where a browser and node are there, and fetches the packages of package.json beside this file.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const [report, folder] = process.argv.slice(2);
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const quiet = ["quic", "background-networking", "component-update", "sync"].map((what) => `--disable-${what}`);
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu", "--no-first-run", ...quiet],
});
const troubles = [];
for (const width of [375, 1440]) {
  for (const colorScheme of ["light", "dark"]) {
    const trouble = (text) => troubles.push(`${width} px, ${colorScheme}: ${text}`);
    const context = await browser.newContext({ viewport: { width, height: 900 }, colorScheme, bypassCSP: true });
    const page = await context.newPage();
    page.on("pageerror", (error) => trouble(error.message));
    page.on("request", (request) => request.url().startsWith("file:") || trouble(`asks for ${request.url()}`));
    await page.goto(pathToFileURL(resolve(report)).href);
    const scrolled = await page.evaluate(() => document.documentElement.scrollWidth);
    if (scrolled > width) trouble(`is ${scrolled} px wide`);
    if (folder) await page.screenshot({ path: `${folder}/${width}-${colorScheme}.png`, fullPage: true });
    // What can be opened is checked open.
    await page.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
    await page.evaluate(axe);
    const { violations } = await page.evaluate(() => window.axe.run());
    for (const { id, nodes } of violations) trouble(`${id}: ${nodes.map((node) => node.target).join(", ")}`);
    const layers = page.locator(".zoom .layers").first();
    const before = await layers.getAttribute("viewBox");
    await page.getByRole("button", { name: "Zoom in" }).first().click();
    if ((await layers.getAttribute("viewBox")) === before) trouble("the zoom moves nothing");
    await context.close();
  }
}
await browser.close();
troubles.forEach((trouble) => console.log(trouble));
console.log(`${report}: ${troubles.length ? `${troubles.length} troubles` : "no violation"}`);
process.exit(troubles.length ? 1 : 0);

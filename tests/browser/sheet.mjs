// Opens a sheet of figures in a headless browser: `node sheet.mjs index.html`. At 375 and at 1440 pixels it must pass axe without
// a violation and fit the width, and each figure must be drawn and have a caption.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";

const [sheet] = process.argv.slice(2);
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu", "--no-first-run"],
});
const troubles = [];
for (const width of [375, 1440]) {
  const page = await (await browser.newContext({ viewport: { width, height: 900 }, bypassCSP: true })).newPage();
  await page.goto(pathToFileURL(resolve(sheet)).href);
  const found = await page.evaluate(() => {
    const figures = [...document.querySelectorAll("figure")];
    const empty = figures.filter((figure) => {
      const picture = figure.querySelector("img");
      return !picture?.naturalWidth || !picture.alt || !figure.querySelector("figcaption")?.textContent;
    });
    return { figures: figures.length, empty: empty.map((figure) => figure.id), wide: document.documentElement.scrollWidth };
  });
  if (found.figures === 0) troubles.push("has no figure");
  for (const id of found.empty) troubles.push(`${width} px: the figure ${id} has no picture or no caption`);
  if (found.wide > width) troubles.push(`is ${found.wide} px wide at ${width} px`);
  await page.evaluate(axe);
  const violations = await page.evaluate(async () => (await window.axe.run({ resultTypes: ["violations"] })).violations);
  for (const { id, nodes } of violations) troubles.push(`${width} px: ${id}: ${nodes.slice(0, 5).map((node) => node.target).join(", ")}`);
}
await browser.close();
troubles.forEach((trouble) => console.log(trouble));
console.log(`${sheet}: ${troubles.length ? `${troubles.length} troubles` : "no violation"}`);
process.exit(troubles.length ? 1 : 0);

// Opens a report in a headless browser: `node check.mjs REPORT.html [FOLDER]`. At 375 and at 1440 pixels, in light and in
// dark, it must pass axe without a violation, fit the width, log no error and ask for nothing from elsewhere; a narrow page
// must not be too long; rows.mjs judges what is drawn and said, zoom.mjs plays what a reader does to see more. With a folder,
// a picture of each is kept there to be looked at, and the page on paper.
//
// `run.sh` calls it where a browser and node are there, and fetches the packages of package.json beside this file.
import { readFileSync, statSync } from "node:fs";
import { createRequire } from "node:module";
import { basename, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { chromium } from "playwright-core";
import { rows } from "./rows.mjs";
import { terms } from "./terms.mjs";
import { zoom } from "./zoom.mjs";

const [report, folder] = process.argv.slice(2);
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const quiet = ["quic", "background-networking", "component-update", "sync"].map((what) => `--disable-${what}`);
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu", "--no-first-run", ...quiet],
});
const troubles = [];
const longest = 14_000;
const largest = 3_000_000;
const name = basename(report, ".html");

// What lies beyond the right edge, or is cut off by what it stands in.
const clipped = () => {
  const beyond = [...document.querySelectorAll("th, td, figcaption, h2, h3, p, li")].filter((node) => {
    const box = node.closest(".scroll") ? null : node.getBoundingClientRect();
    return box && box.width > 0 && box.right > document.documentElement.clientWidth + 1;
  });
  return beyond.slice(0, 3).map((node) => node.textContent.slice(0, 60));
};
// Numbers and names along an axis that overlap.
const overlapping = () => {
  const rows = [...document.querySelectorAll(".chart")].flatMap((chart) => {
    const texts = [...chart.querySelectorAll("text.middle")].filter((text) => text.textContent && text.checkVisibility());
    const byRow = Map.groupBy(texts, (text) => Math.round(text.getBoundingClientRect().top));
    return [...byRow.values()];
  });
  const overlaps = rows.flatMap((row) => {
    const boxes = row.map((text) => text.getBoundingClientRect()).sort((a, b) => a.left - b.left);
    return boxes.slice(1).filter((box, k) => box.left < boxes[k].right - 0.5);
  });
  return overlaps.length;
};

const size = statSync(report).size;
if (size > largest) troubles.push(`${size} bytes`);
for (const width of [375, 1440]) {
  for (const colorScheme of ["light", "dark"]) {
    const trouble = (text) => troubles.push(`${width} px, ${colorScheme}: ${text}`);
    const context = await browser.newContext({ viewport: { width, height: 900 }, colorScheme, bypassCSP: true, hasTouch: true });
    const page = await context.newPage();
    page.setDefaultTimeout(5000);
    page.on("pageerror", (error) => trouble(error.message));
    page.on("request", (request) => request.url().startsWith("file:") || trouble(`asks for ${request.url()}`));
    await page.goto(pathToFileURL(resolve(report)).href);
    const [wide, long] = await page.evaluate(() => {
      const { scrollWidth, scrollHeight } = document.documentElement;
      return [scrollWidth, scrollHeight];
    });
    if (wide > width) trouble(`is ${wide} px wide`);
    if (long > longest) trouble(`is ${long} px long`);
    if (folder) await page.screenshot({ path: `${folder}/${name}-${width}-${colorScheme}.png`, fullPage: true });
    // What can be opened is checked open.
    await page.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = true)));
    for (const text of await page.evaluate(clipped)) trouble(`is cut off: ${text}`);
    await rows(page, trouble);
    const overlaps = await page.evaluate(overlapping);
    if (overlaps) trouble(`${overlaps} labels overlap`);
    await page.evaluate(axe);
    // What else it finds, of thousands of nodes, stays in the page. Dark pages differ in their colors alone.
    const violations = await page.evaluate(async (dark) => {
      const rules = dark ? { runOnly: ["color-contrast", "link-in-text-block"] } : {};
      return (await window.axe.run({ ...rules, resultTypes: ["violations"] })).violations;
    }, colorScheme === "dark");
    for (const { id, nodes } of violations) trouble(`${id}: ${nodes.slice(0, 5).map((node) => node.target).join(", ")}`);
    if (colorScheme === "light") {
      await page.evaluate(() => document.querySelectorAll("details").forEach((details) => (details.open = false)));
      await terms(page, trouble);
      await zoom(page, trouble);
    }
    await context.close();
  }
}
// On paper the legend keeps its colors, and what is closed is named as such.
const paper = await (await browser.newContext({ viewport: { width: 794, height: 1123 } })).newPage();
await paper.goto(pathToFileURL(resolve(report)).href);
await paper.emulateMedia({ media: "print" });
const uncolored = await paper.evaluate(() => {
  const style = (key) => getComputedStyle(key, "::before");
  const keys = [...document.querySelectorAll(".key")];
  return keys.filter((key) => style(key).borderTopColor === style(document.body).borderTopColor || style(key).printColorAdjust !== "exact").length;
});
if (uncolored) troubles.push(`on paper: ${uncolored} keys of legends have no color`);
const unnamed = await paper.evaluate(() => {
  const closed = [...document.querySelectorAll("details:not([open]) > summary")].filter((summary) => summary.checkVisibility());
  return document.querySelectorAll("details").length && closed.every((summary) => getComputedStyle(summary, "::after").content.includes("closed")) ? 0 : 1;
});
if (unnamed) troubles.push("on paper: what is closed is not named");
if (folder) await paper.pdf({ path: `${folder}/${name}.pdf`, format: "A4", printBackground: false });
await browser.close();
troubles.forEach((trouble) => console.log(trouble));
console.log(`${report}: ${troubles.length ? `${troubles.length} troubles` : "no violation"}`);
process.exit(troubles.length ? 1 : 0);

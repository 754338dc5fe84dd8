// Plays the events by which a reader zooms: rubber band, wheel with ctrl, two fingers, keys, buttons, double click.

// What the first signals over time show: the ends of their axis of time, the drawn paths, the numbers beside the axes.
const state = (page) =>
  page.evaluate(() => {
    const root = document.querySelector("[data-played]");
    const panels = [...root.querySelectorAll(".panel")];
    const numbers = (panel, group) => [...panel.querySelectorAll(`.${group} text`)].map((text) => text.textContent);
    return {
      shown: root.querySelector("[role=status]").textContent,
      paths: panels.map((panel) => panel.querySelector(".layers path:last-child").getAttribute("d")),
      up: panels.map((panel) => numbers(panel, "up").join(" ")),
      along: panels.map((panel) => numbers(panel, "along").join(" ")),
      points: panels[0].querySelector(".layers path:last-child").getAttribute("d").split(/[ML]/).length - 1,
      focus: document.activeElement.closest("[data-played]") === root,
    };
  });

const same = (a, b) => a.paths.every((path, k) => path === b.paths[k]);
const span = ({ shown }) => {
  const found = shown.match(/([-−\d.e]+) to ([-−\d.e]+) s/);
  return found ? found.slice(1).map((text) => Number(text.replaceAll("−", "-"))) : null;
};

export const zoom = async (page, trouble) => {
  // The first that is open.
  const found = await page.evaluate(() => {
    const open = [...document.querySelectorAll(".timeline")].find((node) => node.checkVisibility());
    open?.setAttribute("data-played", "");
    return Boolean(open);
  });
  if (!found) return trouble("has no signals over time");
  const root = page.locator("[data-played]");
  await root.scrollIntoViewIfNeeded();
  const panel = root.locator(".panel").first();
  const surface = panel.locator(".layers");
  await root.focus();
  await page.keyboard.press("Home");
  const whole = await state(page);
  const at = async (part) => {
    const box = await surface.boundingBox();
    return [box.x + part * box.width, box.y + box.height / 2];
  };
  const all = async (what) => {
    if (!same(await state(page), whole)) trouble(`${what} does not show all again`);
  };

  // A rubber band from 40 % to 60 % shows that part in all panels, with other numbers on both axes.
  await page.mouse.move(...(await at(0.4)));
  await page.mouse.down();
  await page.mouse.move(...(await at(0.5)));
  if (!(await panel.locator(".band").isVisible())) trouble("the rubber band is not seen");
  await page.mouse.move(...(await at(0.6)));
  await page.mouse.up();
  const banded = await state(page);
  if (banded.paths.some((path, k) => path === whole.paths[k])) trouble("the rubber band does not move all panels");
  if (banded.along.at(-1) === whole.along.at(-1)) trouble("the axis of time stays");
  const [from, to] = span(banded) ?? [0, 0];
  const length = await page.evaluate(() => {
    const { stretches } = JSON.parse(document.querySelector("[data-played] script").textContent);
    const { even, traces, t } = stretches[0];
    if (even) return even[1] * (atob(traces[0].low).length / 4 - 1);
    const times = new Float64Array(Uint8Array.from(atob(t), (letter) => letter.charCodeAt(0)).buffer);
    return times.at(-1) - times[0];
  });
  if (Math.abs((to - from) / length - 0.2) > 0.02) trouble(`the rubber band shows ${from} s to ${to} s of ${length} s`);
  // A double click shows all.
  await page.mouse.dblclick(...(await at(0.5)));
  await all("a double click");

  // The wheel with ctrl zooms about the pointer; without, it is the page's.
  await page.mouse.move(...(await at(0.25)));
  await page.mouse.wheel(0, 0.001);
  await all("the wheel without ctrl");
  await page.keyboard.down("Control");
  await page.mouse.wheel(0, -200);
  await page.keyboard.up("Control");
  await page.waitForTimeout(50);
  const wheeled = span(await state(page));
  if (!wheeled || (wheeled[1] - wheeled[0]) / length > 0.6) trouble(`the wheel shows ${wheeled} of ${length} s`);
  else if (Math.abs((wheeled[0] + 0.25 * (wheeled[1] - wheeled[0])) / length - 0.25) > 0.02) trouble(`the wheel zooms to ${wheeled}`);

  await keys(page, root, length, all, trouble);
  await deepest(page, root, whole, all, trouble);
  await piece(page, root, at, trouble);
  await page.keyboard.press("0");

  // The values below the pointer.
  await page.mouse.move(...(await at(0.3)));
  const readout = await root.locator(".readout").innerText();
  if (!/\d s\n/.test(readout) || !readout.includes("measured")) trouble(`below the pointer: ${readout}`);
  if ((await root.locator(".cursor:visible").count()) < 2) trouble("the line at the pointer is not in all panels");
  await page.mouse.move(1, 1);
  await fingers(page, root, at, state, span, trouble, length);
};

// Keys: all, in, later, earlier, out; the focus stays.
const keys = async (page, root, length, all, trouble) => {
  await root.focus();
  await page.keyboard.press("0");
  await all("the key 0");
  await page.keyboard.press("+");
  const closer = span(await state(page)) ?? [0, 0];
  if (Math.abs((closer[1] - closer[0]) / length - 0.5) > 0.01) trouble(`the key + shows ${closer}`);
  await page.keyboard.press("ArrowRight");
  const later = span(await state(page));
  if (!later || !(later[0] > closer[0])) trouble("the right arrow does not go on");
  await page.keyboard.press("ArrowLeft");
  if (span(await state(page))?.[0] !== closer[0]) trouble("the left arrow does not go back");
  await page.keyboard.press("-");
  await all("the key -");
  if (!(await state(page)).focus) trouble("the focus is lost");
};

// Zoomed in as far as it goes, samples are shown one by one; the button keeps the focus though it can do nothing more.
const deepest = async (page, root, whole, all, trouble) => {
  const zoomIn = root.getByRole("button", { name: "Zoom in" });
  await zoomIn.focus();
  for (let i = 0; i < 40 && (await zoomIn.getAttribute("aria-disabled")) !== "true"; i++) await page.keyboard.press("Enter");
  const deep = await state(page);
  const sampled = await page.evaluate(() => JSON.parse(document.querySelector("[data-played] script").textContent).stretches[0].per === 1);
  if (sampled && !deep.shown.includes("sample by sample")) trouble(`zoomed in, ${deep.shown}`);
  if (sampled && deep.points > 12) trouble(`zoomed in, ${deep.points} points are drawn`);
  if (!(await zoomIn.evaluate((button) => button === document.activeElement))) trouble("the button loses the focus");
  if (deep.up.join() === whole.up.join()) trouble("the axis of values stays");
  await root.getByRole("button", { name: "all: show all" }).click();
  await all("the button all");
};

// Where the columns of the drawing hold many samples each, those about the largest residual are shown one by one.
const piece = async (page, root, at, trouble) => {
  const found = await page.evaluate(() => {
    const { stretches } = JSON.parse(document.querySelector("[data-played] script").textContent);
    const times = ({ even, traces, t }) => {
      if (even) return [even[0], even[0] + even[1] * (atob(traces[0].low).length / 4 - 1)];
      const all = new Float64Array(Uint8Array.from(atob(t), (letter) => letter.charCodeAt(0)).buffer);
      return [all[0], all.at(-1)];
    };
    return stretches.length > 1 && { whole: times(stretches[0]), close: times(stretches[1]) };
  });
  if (!found) return;
  const { whole, close } = found;
  const middle = (close[0] + close[1]) / 2;
  await root.focus();
  await page.keyboard.down("Control");
  for (let i = 0; i < 60; i++) {
    const [from, to] = span(await state(page)) ?? whole;
    if (to - from < (close[1] - close[0]) / 4) break;
    await page.mouse.move(...(await at((middle - from) / (to - from))));
    await page.mouse.wheel(0, -200);
    await page.waitForTimeout(20);
  }
  await page.keyboard.up("Control");
  const { shown } = await state(page);
  if (!shown.includes("sample by sample")) trouble(`about the largest residual: ${shown}`);
};

// Two fingers that part show less, one finger moves on.
const fingers = async (page, root, at, state, span, trouble, length) => {
  const session = await page.context().newCDPSession(page);
  const touch = async (type, ...parts) => {
    const places = await Promise.all(parts.map(at));
    return session.send("Input.dispatchTouchEvent", { type, touchPoints: places.map(([x, y], id) => ({ x, y, id })) });
  };
  await touch("touchStart", 0.4, 0.6);
  for (const by of [0.05, 0.1, 0.15, 0.2]) await touch("touchMove", 0.4 - by, 0.6 + by);
  await touch("touchEnd");
  const pinched = span(await state(page));
  if (!pinched || Math.abs((pinched[1] - pinched[0]) / length - 1 / 3) > 0.05) return trouble(`two fingers show ${pinched} of ${length} s`);
  await touch("touchStart", 0.6);
  for (const part of [0.55, 0.5, 0.45, 0.4]) await touch("touchMove", part);
  await touch("touchEnd");
  const moved = span(await state(page));
  if (!moved || !(moved[0] > pinched[0])) trouble("one finger does not move on");
  await root.focus();
  await page.keyboard.press("0");
};

// Terms explain themselves: by a key and by a finger, and go away again.
export const terms = async (page, trouble) => {
  const term = page.locator(".term").first();
  if ((await term.count()) === 0) return trouble("explains no term");
  const meaning = page.locator(`#${await term.getAttribute("popovertarget")}`);
  await term.focus();
  await page.keyboard.press("Enter");
  if (!(await meaning.isVisible())) trouble("a term does not open by a key");
  const box = await meaning.boundingBox();
  const { width } = page.viewportSize();
  if (box && (box.x < 0 || box.x + box.width > width)) trouble(`an explanation stands from ${box.x} to ${box.x + box.width}`);
  await page.keyboard.press("Escape");
  if (await meaning.isVisible()) trouble("an explanation does not close");
  if (!(await term.evaluate((button) => button === document.activeElement))) trouble("a term loses the focus");
  await term.tap();
  if (!(await meaning.isVisible())) trouble("a term does not open by a finger");
  await page.keyboard.press("Escape");
};

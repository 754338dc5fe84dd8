// Zooming into time: by a rubber band, the wheel with ctrl, two fingers, keys and buttons.
const zoomable = (root) => {
  const timeline = new Timeline(root);
  const [first, last] = timeline.whole;
  if (!(last > first)) return;
  const status = Object.assign(document.createElement("p"), { className: "note" });
  status.setAttribute("role", "status");
  const readout = Object.assign(document.createElement("div"), { className: "readout", hidden: true });
  readout.setAttribute("aria-hidden", "true");

  const show = (begin, end) => {
    timeline.show(begin, end);
    const [from, to] = timeline.shown;
    const { per } = timeline.stretch();
    const detail = per > 1 ? `each column ${per} samples` : "sample by sample";
    const range = to - from < last - first ? `${digitsOf(from, 7)} to ${digitsOf(to, 7)} ${timeline.unit}` : "all";
    status.textContent = `Shown: ${range}, ${detail}`;
    buttons.forEach(([button, , possible]) => button.setAttribute("aria-disabled", String(!possible())));
  };
  // About a time that stays where it is on the screen.
  const scale = (by, about) => {
    const [begin, end] = timeline.shown;
    const width = Math.min(last - first, Math.max(timeline.deepest, by * (end - begin)));
    const from = about - ((about - begin) / (end - begin)) * width;
    show(from, from + width);
  };
  const move = (by) => {
    const [begin, end] = timeline.shown;
    show(begin + by * (end - begin), end + by * (end - begin));
  };
  const middle = () => (timeline.shown[0] + timeline.shown[1]) / 2;
  const all = () => show(first, last);
  const width = () => timeline.shown[1] - timeline.shown[0];

  const controls = Object.assign(document.createElement("span"), { className: "controls" });
  const buttons = [
    ["+", "Zoom in", () => scale(0.5, middle()), () => width() > timeline.deepest * (1 + 1e-9)],
    ["−", "Zoom out", () => scale(2, middle()), () => width() < last - first],
    ["◂", "Earlier", () => move(-0.5), () => timeline.shown[0] > first],
    ["▸", "Later", () => move(0.5), () => timeline.shown[1] < last],
    ["all", "Show all", all, () => width() < last - first],
  ].map(([sign, name, act, possible]) => {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: sign, title: name });
    button.setAttribute("aria-label", sign === "all" ? "all: show all" : name);
    // A button that can do nothing keeps the focus, and does nothing.
    button.addEventListener("click", () => possible() && act());
    button.setAttribute("aria-disabled", String(!possible()));
    controls.append(button);
    return [button, act, possible];
  });
  root.querySelector(".legend").append(controls);
  root.querySelector(".legend").after(status);
  root.append(readout);

  const box = ({ layers }) => layers.getBoundingClientRect();
  const timeAt = (panel, x) => {
    const { left, width: across } = box(panel);
    const part = Math.min(1, Math.max(0, (x - left) / across));
    return timeline.shown[0] + part * width();
  };
  const cursors = timeline.panels.map(({ node }) => {
    const cursor = Object.assign(document.createElement("div"), { className: "cursor", hidden: true });
    node.append(cursor);
    return cursor;
  });
  // A line through all panels at a time, and the values there beside it.
  const point = (t, panel) => {
    const found = timeline.at(panel, t);
    timeline.panels.forEach((other, k) => {
      const [inner, outer] = [box(other), other.node.getBoundingClientRect()];
      const x = inner.left - outer.left + ((found.t - timeline.shown[0]) / width()) * inner.width;
      cursors[k].hidden = found.t < timeline.shown[0] || found.t > timeline.shown[1];
      cursors[k].style.cssText = `left:${x}px;top:${inner.top - outer.top}px;height:${inner.height}px`;
    });
    readout.replaceChildren();
    const row = (tag, text) => readout.append(Object.assign(document.createElement(tag), { textContent: text }));
    row("b", `${digitsOf(found.t, 8)} ${timeline.unit}`);
    found.values.forEach(([name, value]) => row("span", `${name} ${value}`));
    readout.hidden = false;
    const [inner, outer] = [box(panel), root.getBoundingClientRect()];
    const right = found.t - timeline.shown[0] > width() / 2;
    const at = inner.left - outer.left + ((found.t - timeline.shown[0]) / width()) * inner.width;
    const beside = right ? `right:${outer.width - at + 10}px` : `left:${at + 10}px`;
    readout.style.cssText = `${beside};top:${inner.top - outer.top + 4}px`;
  };
  const unpoint = () => [readout, ...cursors].forEach((node) => (node.hidden = true));

  root.addEventListener("keydown", (event) => {
    const keys = {
      ArrowLeft: () => move(-0.25),
      ArrowRight: () => move(0.25),
      "+": () => scale(0.5, middle()),
      "=": () => scale(0.5, middle()),
      "-": () => scale(2, middle()),
      Home: all,
      0: all,
      Escape: all,
    };
    const act = keys[event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    act();
    point(middle(), timeline.panels[0]);
  });
  root.addEventListener("focusout", unpoint);
  // Plots in closed sections were drawn coarsely.
  const closed = root.closest("details");
  closed?.addEventListener("toggle", () => closed.open && show(...timeline.shown));
  timeline.panels.forEach((panel) => pointing(panel, { timeline, show, scale, all, point, unpoint, timeAt, box }));
};

// Gestures of mouse or fingers on one panel.
const pointing = (panel, { timeline, show, scale, all, point, unpoint, timeAt, box }) => {
  const { node } = panel;
  const band = Object.assign(document.createElement("div"), { className: "band", hidden: true });
  node.append(band);
  const fingers = new Map();
  let start = null;
  const stretchBand = (x) => {
    const [inner, outer] = [box(panel), node.getBoundingClientRect()];
    const [left, right] = [Math.max(inner.left, Math.min(start, x)), Math.min(inner.right, Math.max(start, x))];
    band.style.cssText = `left:${left - outer.left}px;width:${Math.max(0, right - left)}px;top:${inner.top - outer.top}px;height:${inner.height}px`;
    band.hidden = Math.abs(x - start) < 4;
  };
  const release = () => {
    [start, band.hidden] = [null, true];
    fingers.clear();
  };
  node.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    node.setPointerCapture(event.pointerId);
    if (event.pointerType === "mouse") start = event.clientX;
    else fingers.set(event.pointerId, event.clientX);
    point(timeAt(panel, event.clientX), panel);
  });
  node.addEventListener("pointermove", (event) => {
    if (start !== null) stretchBand(event.clientX);
    if (fingers.has(event.pointerId)) slide(event);
    else if (event.pointerType === "mouse") point(timeAt(panel, event.clientX), panel);
  });
  // One finger moves the time, two keep the times below them.
  const slide = (event) => {
    const before = [...fingers.values()];
    const held = before.map((x) => timeAt(panel, x));
    fingers.set(event.pointerId, event.clientX);
    const now = [...fingers.values()];
    const [begin, end] = timeline.shown;
    if (now.length === 1) {
      const by = timeAt(panel, now[0]) - held[0];
      if (end - begin < timeline.whole[1] - timeline.whole[0]) show(begin - by, end - by);
    } else if (now.length === 2 && Math.abs(now[1] - now[0]) > 8) {
      const by = Math.abs((before[1] - before[0]) / (now[1] - now[0]));
      scale(by, (held[0] + held[1]) / 2);
    }
  };
  node.addEventListener("pointerup", (event) => {
    if (start !== null && Math.abs(event.clientX - start) >= 4) {
      const [a, b] = [timeAt(panel, start), timeAt(panel, event.clientX)];
      unpoint();
      show(Math.min(a, b), Math.max(a, b));
    }
    fingers.delete(event.pointerId);
    [start, band.hidden] = [null, true];
  });
  node.addEventListener("pointercancel", release);
  node.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && unpoint());
  node.addEventListener("dblclick", all);
  const wheel = (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    scale(Math.exp(Math.max(-1, Math.min(1, event.deltaY * 0.005))), timeAt(panel, event.clientX));
  };
  node.addEventListener("wheel", wheel, { passive: false });
};
document.querySelectorAll(".timeline").forEach(zoomable);

"use strict";
// Buttons that narrow and move the part of time that the drawings of one output show.
for (const zoom of document.querySelectorAll(".zoom")) {
  const charts = [...zoom.querySelectorAll(".layers")].map((layers) => ({
    layers,
    ticks: layers.parentNode.querySelector(".along"),
    width: layers.viewBox.baseVal.width,
    height: layers.viewBox.baseVal.height,
    from: Number(layers.dataset.from),
    to: Number(layers.dataset.to),
  }));
  let [begin, end] = [0, 1];
  const deepest = 1 / 256;

  const round = (step) => {
    const power = 10 ** Math.floor(Math.log10(step));
    return [1, 2, 5, 10].find((part) => step <= part * power * (1 + 1e-9)) * power;
  };
  const mark = ({ layers, ticks, width, height, from, to }) => {
    layers.setAttribute("viewBox", `${begin * width} 0 ${(end - begin) * width} ${height}`);
    const [first, last] = [from + begin * (to - from), from + end * (to - from)];
    const step = round((last - first) / 5);
    const digits = Math.min(20, Math.max(0, -Math.floor(Math.log10(step))));
    const y = ticks.firstChild.getAttribute("y");
    ticks.textContent = "";
    for (let i = Math.ceil(first / step); i * step <= last; i++) {
      const text = document.createElementNS(layers.namespaceURI, "text");
      text.setAttribute("class", "tick middle");
      text.setAttribute("x", `${(100 * (i * step - first)) / (last - first)}%`);
      text.setAttribute("y", y);
      text.textContent = i ? (i * step).toFixed(digits).replace("-", "−") : "0";
      ticks.append(text);
    }
  };
  const show = (from, to) => {
    const width = Math.min(1, Math.max(deepest, to - from));
    begin = Math.min(1 - width, Math.max(0, (from + to - width) / 2));
    end = begin + width;
    charts.forEach(mark);
    buttons.forEach(([button, , possible]) => (button.disabled = !possible()));
  };
  const scaled = (by) => () => {
    const [middle, half] = [(begin + end) / 2, (by * (end - begin)) / 2];
    show(middle - half, middle + half);
  };
  const moved = (by) => () => show(begin + by * (end - begin), end + by * (end - begin));

  const controls = document.createElement("span");
  controls.className = "controls";
  const buttons = [
    ["+", "Zoom in", scaled(0.5), () => end - begin > deepest],
    ["−", "Zoom out", scaled(2), () => end - begin < 1],
    ["◂", "Earlier", moved(-0.5), () => begin > 0],
    ["▸", "Later", moved(0.5), () => end < 1],
    ["all", "Show all", () => show(0, 1), () => end - begin < 1],
  ].map(([sign, name, act, possible]) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = sign;
    button.title = name;
    button.setAttribute("aria-label", sign === "all" ? "all: show all" : name);
    button.addEventListener("click", act);
    controls.append(button);
    return [button, act, possible];
  });
  zoom.querySelector(".legend").append(controls);
  buttons.forEach(([button, , possible]) => (button.disabled = !possible()));

  // A dragged span is shown.
  for (const { layers } of charts) {
    const place = (event) => {
      const box = layers.getBoundingClientRect();
      return begin + ((event.clientX - box.left) / box.width) * (end - begin);
    };
    let start = null;
    layers.parentNode.addEventListener("pointerdown", (event) => {
      start = event.pointerType === "mouse" ? place(event) : null;
    });
    layers.parentNode.addEventListener("pointerup", (event) => {
      const stop = place(event);
      if (start !== null && Math.abs(stop - start) > 0.02 * (end - begin)) show(Math.min(start, stop), Math.max(start, stop));
      start = null;
    });
    layers.parentNode.addEventListener("dblclick", () => show(0, 1));
  }
}

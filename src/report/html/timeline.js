// Signals over time: their numbers, and the drawing of a part of them.
const columnsDrawn = 800;
const svgNode = (near, name, attributes) => {
  const { text = "", ...rest } = attributes;
  const node = document.createElementNS(near.namespaceURI, name);
  Object.entries(rest).forEach(([key, value]) => node.setAttribute(key, value));
  node.textContent = text;
  near.append(node);
};
const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
const unpacked = ({ per, even, t, traces }) => {
  const values = (text, shift) => Float64Array.from(new Float32Array(bytesOf(text)), (value) => value + shift);
  const lines = traces.map(({ shift, low, high, mean }) => {
    const least = values(low, shift);
    return { low: least, high: high ? values(high, shift) : least, mean: mean ? values(mean, shift) : least };
  });
  const count = lines.length ? lines[0].low.length : 0;
  const time = even ? Float64Array.from({ length: count }, (_, k) => even[0] + k * even[1]) : new Float64Array(bytesOf(t));
  return { per, time, lines };
};
// Number of the first column that begins after a time.
const columnAfter = (time, t) => {
  let [low, high] = [0, time.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (time[middle] > t) high = middle;
    else low = middle + 1;
  }
  return low;
};
// The columns of a line in a part of time, drawn at most so many: times of the first and last value, least and greatest,
// and whether they rise or fall all the way; null where the line is broken.
const columnsOf = ({ time }, low, high, [begin, end]) => {
  const [first, last] = [Math.max(0, columnAfter(time, begin) - 1), Math.min(time.length, columnAfter(time, end) + 1)];
  const width = last - first <= columnsDrawn ? 0 : (end - begin) / columnsDrawn;
  const columns = [];
  let [started, before, missing] = [-Infinity, -Infinity, false];
  for (let k = first; k < last; k++) {
    if (Number.isNaN(low[k])) {
      missing = true;
      continue;
    }
    const [apart, column] = [missing && time[k] - before > width, columns.at(-1)];
    if (column && !apart && time[k] - started < width) {
      column.least = Math.min(column.least, low[k]);
      column.greatest = Math.max(column.greatest, high[k]);
      [column.end, column.last] = [time[k], k];
    } else {
      if (apart && columns.length) columns.push(null);
      columns.push({ begin: time[k], end: time[k], least: low[k], greatest: high[k], first: k, last: k });
      started = time[k];
    }
    [before, missing] = [time[k], false];
  }
  for (const column of columns) {
    if (!column) continue;
    const { least, greatest, first, last } = column;
    column.rises = low[first] === least && high[last] === greatest;
    column.falls = high[first] === greatest && low[last] === least;
  }
  return columns;
};
const linePath = (columns, place, held) => {
  let [d, before] = ["", null];
  for (const column of columns) {
    if (!column) {
      before = null;
      continue;
    }
    const { begin, least, greatest, rises, falls } = column;
    const nearer = before === null || Math.abs(before - least) <= Math.abs(before - greatest);
    const upwards = rises === falls ? nearer : rises;
    const end = rises === falls ? begin : column.end;
    const [start, stop] = upwards ? [least, greatest] : [greatest, least];
    if (before === null) d += `M${place(begin, start)}L${place(begin, start)}`;
    else d += `${held && least === greatest ? `L${place(begin, before)}` : ""}L${place(begin, start)}`;
    if (start !== stop) d += `L${place(end, stop)}`;
    before = stop;
  }
  return d;
};
const bandPath = (means, halves, place) => {
  let [d, piece] = ["", []];
  const close = () => {
    const ends = [...piece.map(([t, m, h]) => place(t, m + h)), ...piece.reverse().map(([t, m, h]) => place(t, m - h))];
    if (ends.length) d += `M${ends.join("L")}Z`;
    piece = [];
  };
  // Of several columns in one of the drawing the mean stands for the line, and the widest half width for the band.
  means.forEach((column, k) => {
    if (column && halves[k]) piece.push([column.begin, (column.least + column.greatest) / 2, halves[k].greatest]);
    else close();
  });
  close();
  return d;
};
const isBand = ({ style }) => style === "confidence" || style === "prediction";

class Timeline {
  constructor(root) {
    const { panels, stretches, time, time_unit: unit } = JSON.parse(root.querySelector("script").textContent);
    this.root = root;
    this.time = time;
    this.unit = unit;
    this.stretches = stretches.map(unpacked);
    let first = 0;
    this.panels = [...root.querySelectorAll(".panel")].map((node, k) => {
      const panel = { ...panels[k], node, first, layers: node.querySelector(".layers") };
      first += panel.lines.length;
      return panel;
    });
    const { time: all, per } = this.stretches[0];
    this.whole = [all[0], all[all.length - 1]];
    const step = (this.whole[1] - this.whole[0]) / Math.max(1, all.length * per - 1);
    this.deepest = Math.min(this.whole[1] - this.whole[0], 4 * step);
    this.shown = [...this.whole];
  }

  // The stretch that shows most of what is shown: sample by sample, if one covers it.
  stretch() {
    const [begin, end] = this.shown;
    const covers = ({ time }) => time[0] <= begin && time[time.length - 1] >= end;
    return this.stretches.slice(1).find(covers) ?? this.stretches[0];
  }

  show(begin, end) {
    const [first, last] = this.whole;
    const width = Math.min(last - first, Math.max(this.deepest, end - begin));
    const from = Math.min(last - width, Math.max(first, (begin + end - width) / 2));
    this.shown = [from, from + width];
    const stretch = this.stretch();
    this.panels.forEach((panel) => this.draw(panel, stretch));
  }

  draw({ node, layers, lines, first, name, unit, kind }, stretch) {
    const { width, height } = layers.viewBox.baseVal;
    const across = axisOf(...this.shown);
    const columns = lines.map((line, k) => {
      const { low, high } = stretch.lines[first + k];
      return isBand(line) ? columnsOf(stretch, low, low, this.shown) : columnsOf(stretch, low, high, this.shown);
    });
    const center = lines.findIndex(({ style }) => style === "predicted");
    const means = center < 0 ? [] : columnsOf(stretch, stretch.lines[first + center].mean, stretch.lines[first + center].mean, this.shown);
    let [least, greatest] = [Infinity, -Infinity];
    lines.forEach((line, k) => {
      if (isBand(line)) {
        // A state may move by less than is known of it.
        if (kind !== "state") return;
        means.forEach((mean, c) => {
          const half = mean && columns[k][c]?.greatest;
          if (half) [least, greatest] = [Math.min(least, mean.least - half), Math.max(greatest, mean.greatest + half)];
        });
        return;
      }
      for (const column of columns[k]) {
        if (column) [least, greatest] = [Math.min(least, column.least), Math.max(greatest, column.greatest)];
      }
    });
    if (least > greatest) [least, greatest] = [0, 1];
    if (greatest - least <= 1e-13 * Math.abs(greatest)) {
      const room = Math.abs(greatest) / 10 || 1;
      [least, greatest] = [least - room, greatest + room];
    }
    const room = 0.05 * (greatest - least);
    const upwards = axisOf(least - room, greatest + room);
    const short = (value) => Math.round(value * 100) / 100;
    const place = (t, value) => `${short(width * across.at(t))} ${short(height * (1 - upwards.at(value)))}`;
    lines.forEach((line, k) => {
      const path = layers.children[k];
      if (!path) return;
      if (!isBand(line)) return path.setAttribute("d", linePath(columns[k], place, line.held));
      path.setAttribute("d", bandPath(means, columns[k], place));
    });
    this.mark(node, across, upwards, height, name, unit);
  }

  mark(node, across, upwards, height, name, unit) {
    const [up, along, titles] = [node.querySelector(".up"), node.querySelector(".along"), node.querySelectorAll(".name")];
    up.replaceChildren();
    for (const { at, label } of upwards.ticks) {
      const y = height * (1 - at);
      svgNode(up, "line", { class: "grid", x2: "100%", y1: y, y2: y });
      svgNode(up, "text", { class: "tick end", x: -6, y, dy: 4, text: label });
    }
    const numbered = along.querySelector("text") !== null;
    along.replaceChildren();
    for (const { at, label } of across.ticks) {
      const x = `${100 * at}%`;
      svgNode(along, "line", { class: "grid", x1: x, x2: x, y2: height });
      if (numbered) svgNode(along, "text", { class: "tick middle", x, y: height + 16, text: label });
    }
    titles[0].textContent = upwards.title(name, unit);
    if (titles[1]) titles[1].textContent = across.title(this.time, this.unit);
  }

  // The values of a panel nearest to a time.
  at({ first, lines }, t) {
    const stretch = this.stretch();
    const after = columnAfter(stretch.time, t);
    const nearer = after > 0 && (after === stretch.time.length || t - stretch.time[after - 1] <= stretch.time[after] - t);
    const k = nearer ? after - 1 : after;
    const values = lines.map((line, i) => {
      const { low, high } = stretch.lines[first + i];
      const [least, greatest] = [digitsOf(low[k], 5), digitsOf(high[k], 5)];
      if (isBand(line)) return [line.name, `± ${least}`];
      return [line.name, least === greatest ? least : `${least} … ${greatest}`];
    });
    return { t: stretch.time[k], values };
  }
}

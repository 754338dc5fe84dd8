// What a reader of a page must be able to rely on, judged on what the browser has drawn. Each row is a function that runs in
// the page and names what is wrong; `helpers` comes first.

const helpers = () => {
  const texts = (root, query) => [...root.querySelectorAll(query)].map((node) => node.textContent);
  const numberOf = (text) => Number(text.replaceAll("−", "-").replaceAll(",", ""));
  const floats = (text) => new Float32Array(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
  // The pieces of a path, each a list of places.
  const pieces = (path) =>
    (path.getAttribute("d") ?? "").split("M").slice(1).map((piece) =>
      piece.replace("Z", "").split("L").map((place) => place.trim().split(/[\s,]+/).map(Number)));
  const stretchOf = ({ even, t, traces }) => {
    const low = traces.map((trace) => Array.from(floats(trace.low), (value) => value + trace.shift));
    const bytes = Uint8Array.from(atob(t), (letter) => letter.charCodeAt(0));
    const time = even ? Array.from(low[0], (_, k) => even[0] + k * even[1]) : [...new Float64Array(bytes.buffer)];
    return { time, low };
  };
  const timelines = () =>
    [...document.querySelectorAll(".timeline")].filter((root) => root.checkVisibility()).map((root) => {
      const data = JSON.parse(root.querySelector("script").textContent);
      let first = 0;
      const panels = [...root.querySelectorAll(".panel")].map((node, k) => {
        const lines = data.panels[k].lines.map((line, i) => ({ ...line, trace: first + i }));
        first += lines.length;
        const layers = node.querySelector(".layers");
        return { ...data.panels[k], node, layers, lines, view: layers.viewBox.baseVal };
      });
      return { root, data, panels, whole: stretchOf(data.stretches[0]) };
    });
  // The power of ten that an axis is labelled in.
  const factor = (title) => Number(/\((1e-?\d+) /.exec(title)?.[1] ?? 1);
  window.rows = { texts, numberOf, pieces, timelines, factor };
};

// A band is as wide on the screen as its numbers are.
const bands = () => {
  const { texts, numberOf, pieces, timelines, factor } = window.rows;
  const area = (places) =>
    Math.abs(places.reduce((sum, [x, y], k) => {
      const [a, b] = places[(k + 1) % places.length];
      return sum + x * b - a * y;
    }, 0)) / 2;
  return timelines().flatMap(({ panels, whole }) =>
    panels.flatMap(({ name, node, lines, layers }) => {
      const ticks = [...node.querySelectorAll(".up line")].map((line) => Number(line.getAttribute("y1")));
      const labels = texts(node, ".up text").map(numberOf);
      const scale = factor(node.querySelector(".name").textContent);
      const perPixel = (scale * Math.abs(labels.at(-1) - labels[0])) / Math.abs(ticks.at(-1) - ticks[0]);
      return lines.flatMap((line, k) => {
        if (line.style !== "confidence" && line.style !== "prediction") return [];
        const halves = whole.low[line.trace].filter(Number.isFinite);
        const expected = halves.reduce((sum, half) => sum + half, 0) / halves.length;
        const drawn = pieces(layers.children[k]).filter((places) => places.length > 2);
        const covered = drawn.reduce((sum, places) => {
          const across = places.map(([x]) => x);
          return sum + Math.max(...across) - Math.min(...across);
        }, 0);
        const half = (perPixel * drawn.reduce((sum, places) => sum + area(places), 0)) / covered / 2;
        const close = Math.abs(half - expected) < 0.3 * expected + 0.3 * perPixel;
        return close ? [] : [`the band "${line.name}" of ${name} is drawn ± ${half}, and is ± ${expected}`];
      });
    }));
};

// Signals take the width of their axis, and time counts from the start of the record.
const time = () => {
  const { texts, numberOf, pieces, timelines, factor } = window.rows;
  return timelines().flatMap(({ data, panels, whole }) => {
    const across = pieces(panels[0].layers.lastElementChild).flat().map(([x]) => x);
    const width = Math.max(...across) - Math.min(...across);
    const { node } = panels.at(-1);
    const title = [...node.querySelectorAll(".name")].at(-1).textContent;
    const latest = Math.max(...texts(node, ".along text").map(numberOf)) * factor(title);
    const found = [];
    if (width < 0.9 * panels[0].view.width) found.push(`signals take ${width} of ${panels[0].view.width}`);
    if (!title.startsWith(data.time)) found.push(`the axis of time is called ${title}`);
    if (latest > whole.time.at(-1) * 1.001) found.push(`the axis of time goes to ${latest} s`);
    return found;
  });
};

// No line crosses time without samples.
const gaps = () => {
  const { pieces, timelines } = window.rows;
  return timelines().flatMap(({ panels, whole: { time, low } }) => {
    const length = time.at(-1) - time[0];
    const empty = time.map((t, k) => [t, time[k + 1]]).filter(([t, next], k) => next - t > 0.01 * length && low.every((line) => Number.isNaN(line[k])));
    return panels.flatMap(({ name, layers, view }) =>
      empty.filter(([from, to]) => {
        const middle = (view.width * ((from + to) / 2 - time[0])) / length;
        const crossing = (places) => places.some(([x], k) => k > 0 && places[k - 1][0] < middle && x > middle);
        return [...layers.querySelectorAll(".line")].some((path) => pieces(path).some(crossing));
      }).map(([from, to]) => `${name} is drawn through the gap from ${from} s to ${to} s`));
  });
};

// Numbers have no more digits than anyone reads; a hash has.
const digits = () => {
  const text = document.body.innerText.replace(/\b[0-9a-f]{64}\b/g, "");
  const numbers = [...text.matchAll(/\d+\.\d+|\d{14,}/g)].map(([number]) => number);
  // A time stamp has ten digits before its point.
  const long = (number) => number.replace(".", "").replace(/^0+/, "").length > (/^\d{10}\./.test(number) ? 15 : 11);
  return numbers.filter(long).slice(0, 3).map((number) => `${number} is written`);
};

// The plot of the autocorrelation names the result of the test that stands in the table.
const tests = () =>
  [...document.querySelectorAll("figcaption")].flatMap((caption) => {
    const result = /judges all lags together, and (passes|fails)/.exec(caption.textContent)?.[1];
    if (!result) return [];
    const row = [...caption.closest("article").querySelectorAll("tr")].find((row) => row.textContent.startsWith("Ljung-Box"));
    return row?.textContent.includes(result) ? [] : [`the plot says ${result}, the table ${row?.textContent}`];
  });

// Advice can be followed, nothing is said twice, and a note bears no sign of approval.
const reasons = () => {
  const { timelines } = window.rows;
  const inputs = timelines().flatMap(({ data }) => data.panels.filter(({ kind }) => kind === "input").map(({ name }) => name));
  const text = document.body.innerText;
  const weightings = [...text.matchAll(/a weighting by (\S+) makes/g)].map(([, name]) => name);
  const items = [...document.querySelectorAll(".reasons li")];
  const said = items.map((item) => item.textContent);
  return [
    ...weightings.filter((name) => ![...inputs, "t", "time"].includes(name)).map((name) => `a weighting by ${name} is advised`),
    ...said.filter((one, k) => said.indexOf(one) !== k).map((one) => `said twice: ${one}`),
    ...items.filter((item) => getComputedStyle(item, "::before").content.includes("✓")).map((item) => `approved: ${item.textContent}`),
    ...[...text.matchAll(/\b0\.00? times|at least 100 %/g)].map(([words]) => words),
  ];
};

// A profile rises to the same height on both sides, unless a bound ends it or it is open.
const profiles = () => {
  const { pieces } = window.rows;
  return [...document.querySelectorAll("#profiles figure")].flatMap((figure) => {
    const caption = figure.querySelector("figcaption").textContent;
    const line = figure.querySelector(".line.main");
    const heights = line ? pieces(line).flat().map(([, y]) => y) : [];
    const height = figure.querySelector(".layers").viewBox.baseVal.height;
    const even = Math.abs(heights.at(0) - heights.at(-1)) < 0.1 * height;
    return even || /bound|open/.test(caption) ? [] : [`${caption}: ends at ${heights.at(0)} and ${heights.at(-1)} of ${height}`];
  });
};

// Labels beside levels and marks are crossed by no curve.
const labels = () =>
  [...document.querySelectorAll(".chart")].filter((chart) => chart.checkVisibility()).flatMap((chart) => {
    const boxes = [...chart.querySelectorAll("text.note")].map((note) => [note.textContent, note.getBoundingClientRect()]);
    const points = [...chart.querySelectorAll(".line")].flatMap((path) => {
      const matrix = path.getScreenCTM();
      const length = boxes.length ? path.getTotalLength() : 0;
      return Array.from({ length: length ? 400 : 0 }, (_, i) => path.getPointAtLength((i / 399) * length).matrixTransform(matrix));
    });
    const inside = ({ x, y }, box) => x > box.left + 1 && x < box.right - 1 && y > box.top + 2 && y < box.bottom - 2;
    return boxes.filter(([, box]) => points.some((point) => inside(point, box))).map(([text]) => `a curve crosses the label "${text}"`);
  });

// What a reader looks for is there: inputs below the outputs, lags in seconds, profiles with their labels, initial states
// apart, correlations as numbers, what is needed to make it again.
const present = () => {
  const { texts, timelines } = window.rows;
  const found = [];
  const expect = (holds, text) => holds || found.push(text);
  for (const { panels, data } of timelines()) {
    const kinds = panels.map(({ kind }) => kind === "input");
    expect(kinds.every((input, k) => input || !kinds.slice(0, k).includes(true)), "an output stands below an input");
    const tops = panels.map(({ node }) => node.getBoundingClientRect().top);
    expect(tops.every((top, k) => k === 0 || top > tops[k - 1]), "panels are not below each other");
    expect(data.stretches.length > 0, "nothing to zoom into");
  }
  const figures = [...document.querySelectorAll("figure")].map((figure) => [figure, figure.querySelector("figcaption")?.textContent ?? ""]);
  for (const [figure, caption] of figures.filter(([, caption]) => /^(Autoc|C)orrelation(;| with)/.test(caption))) {
    const axis = figure.querySelector(".name.end").textContent;
    expect(/^lag \((1e-?\d+ )?s\)$/.test(axis), `${caption}: the axis is ${axis}`);
  }
  for (const figure of document.querySelectorAll("#profiles figure")) {
    const notes = texts(figure, ".note").join();
    expect(/estimate/.test(notes) && /\d % threshold/.test(notes), `a profile is labelled ${notes}`);
    expect(figure.querySelector(".line.main"), "a profile has no curve");
  }
  for (const id of ["starts", "convergence"]) {
    const section = document.getElementById(id);
    expect(!section || section.querySelector(".line"), `${id} has no curve`);
  }
  const compared = document.getElementById("compare");
  // The gallery's comparison has both; another page may have validation alone.
  const uses = location.pathname.endsWith("/compared.html") ? [/estimation/, /validation/] : [/estimation|validation/];
  expect(!compared || uses.every((use) => use.test(compared.textContent)), "what the data compared were used for is not said");
  const even = timelines()[0]?.data.stretches[0].even;
  expect(!even || figures.some(([, caption]) => caption.startsWith("Spectrum")), "there is no spectrum");
  const states = document.getElementById("initial-states");
  expect(!states || states.querySelector("details"), "initial states are open");
  expect(!texts(document, "#parameters figure:not(#initial-states *) text").some((text) => text.includes("(0)")), "initial states stand among the parameters");
  const numbers = texts(document, "#correlations td");
  expect(numbers.length > 0 && numbers.every((text) => text === "-" || /^-?[\d.e-]+$/.test(text)), `correlations: ${numbers}`);
  const made = document.getElementById("reproduce");
  const named = texts(made, "th");
  const needed = ["model", "hold", "integrator", "noise", "covariance", "greybox version"];
  for (const name of needed) expect(named.includes(name), `to reproduce: no ${name}`);
  expect(!named.includes("file") || /SHA-256 [0-9a-f]{64}/.test(made.textContent), "a file has no hash");
  return found;
};

export const rows = async (page, trouble) => {
  await page.evaluate(helpers);
  for (const row of [bands, time, gaps, digits, tests, reasons, profiles, labels, present]) {
    for (const text of await page.evaluate(row)) trouble(text);
  }
};

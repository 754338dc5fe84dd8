// Axes as the page was made with: round numbers, and what they count from where they are far from zero.
const roundStep = (step) => {
  const power = 10 ** Math.floor(Math.log10(step));
  return [1, 2, 5, 10].find((part) => step <= part * power * (1 + 1e-9)) * power;
};
const digitsOf = (value, digits) => {
  if (!Number.isFinite(value)) return "–";
  const text = Number(value.toPrecision(digits));
  return (Math.abs(text) >= 1e7 ? text.toExponential() : String(text)).replace("-", "−");
};
const axisOf = (from, to) => {
  const [span, size] = [to - from, Math.max(Math.abs(from), Math.abs(to))];
  const power = 10 ** (Math.floor(Math.log10(span)) + 1);
  const base = span > 1e-4 * size ? 0 : Math.floor(from / power) * power;
  const largest = Math.max(Math.abs(from - base), Math.abs(to - base));
  const exponent = largest >= 1e-2 && largest < 1e5 ? 0 : Math.floor(Math.log10(largest) / 3) * 3;
  const factor = 10 ** exponent;
  const [first, last] = [(from - base) / factor, (to - base) / factor];
  const step = roundStep((last - first) / 5);
  const digits = Math.min(20, Math.max(0, -Math.floor(Math.log10(step))));
  const ticks = [];
  for (let i = Math.ceil(first / step); i * step <= last && ticks.length < 12; i++) {
    const label = i ? (i * step).toFixed(digits).replace("-", "−") : "0";
    ticks.push({ at: (i * step - first) / (last - first), label });
  }
  const title = (name, unit) => {
    const scaled = `${exponent ? `1e${exponent} ` : ""}${unit === "1" ? "" : unit}`.trim();
    const short = name.length > 36 ? `${name.slice(0, 35)}…` : name;
    return `${short}${base ? `, above ${digitsOf(base, 15)}` : ""}${scaled ? ` (${scaled})` : ""}`;
  };
  return { ticks, title, at: (value) => (value - from) / span };
};

// The false colours of the maps: lightness rises evenly from dark violet to pale yellow, as in map.png.

// every fifteenth of the 256 colours of the picture
export const ANCHORS = [
  "#1a0034", "#2c0042", "#40004d", "#560054", "#6d0058", "#810e57", "#951e55", "#a82d51", "#ba3d4b",
  "#ca4e45", "#d8603c", "#e57334", "#ef872c", "#f79c27", "#fdb22c", "#ffc83f", "#ffde58", "#fff467",
];
const UNKNOWN = [0, 200, 255];

const TABLE = Array.from({ length: 256 }, (_, index) => {
  const place = Math.min(index / 15, ANCHORS.length - 1);
  const low = Math.floor(place);
  const [from, to] = [parts(ANCHORS[low]), parts(ANCHORS[Math.min(low + 1, ANCHORS.length - 1)])];
  return from.map((part, channel) => Math.round(part + (to[channel] - part) * (place - low)));
});

/** From values to shares of the colours, and what to write beside the bar. */
export class Scale {
  constructor(low, high, logarithmic) {
    Object.assign(this, { low, high, logarithmic });
  }

  share(value) {
    const { low, high } = this;
    if (!this.logarithmic) return (value - low) / (high - low);
    return value > 0 ? Math.log(value / low) / Math.log(high / low) : 0;
  }

  colour(value) {
    if (value === null) return UNKNOWN;
    return TABLE[Math.min(Math.max(Math.floor(this.share(value) * 256), 0), 255)];
  }

  /** Round numbers within: 1, 2, 5, 10, ... or even steps. */
  ticks() {
    const { low, high } = this;
    if (this.logarithmic && high / low > 3) {
      const decades = Array.from({ length: Math.ceil(Math.log10(high)) - Math.floor(Math.log10(low)) + 1 }, (_, index) => Math.floor(Math.log10(low)) + index);
      const steps = high / low < 1e3 ? [1, 2, 5] : [1];
      return decades.flatMap((decade) => steps.map((step) => Number((step * 10 ** decade).toPrecision(3)))).filter((tick) => tick >= low * 0.999 && tick <= high * 1.001);
    }
    const rough = (high - low) / 4;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].find((each) => each * power >= rough) * power;
    const ticks = [];
    for (let tick = Math.ceil(low / step) * step; tick <= high + step / 1e6; tick += step) ticks.push(Number(tick.toPrecision(6)));
    return ticks;
  }
}

/** From the 0.5th to the 99.9th percentile of what is above zero, evenly from 0 to the 99th: lamps are few. A reflectance has 0 to 1, an index -1 to 1. */
export function chooseScale(planes, { unit, logarithmic }) {
  const all = planes.flat(2).filter((value) => value !== null);
  if (unit === "1") return new Scale(percentile(all, 0.005) < -0.01 ? -1 : 0, 1, false);
  const lit = all.filter((value) => value > 0);
  if (!lit.length) return new Scale(0.1, 1, logarithmic);
  if (!logarithmic) return new Scale(0, percentile(lit, 0.99), false);
  let [low, high] = [percentile(lit, 0.005), percentile(lit, 0.999)];
  const missing = 0.3 - Math.log10(high / low);
  if (missing > 0) [low, high] = [low / 10 ** (missing / 2), high * 10 ** (missing / 2)];
  return new Scale(low, high, true);
}

function percentile(values, share) {
  if (!values.length) return 0;
  const sorted = Float64Array.from(values).sort();
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
}

function parts(hex) {
  return [1, 3, 5].map((at) => Number.parseInt(hex.slice(at, at + 2), 16));
}

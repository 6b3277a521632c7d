/* Dense curves by pixel column: first, lowest, highest and last value of each, whatever the zoom. The
   extremes of blocks are found once, so that a million points cost no more than the pixels. */

const BLOCK = 64;

function extremes(ys, from, to) {
  let low = Infinity, high = -Infinity;
  for (let i = from; i < to; i++) {
    const y = ys[i];
    if (y < low) low = y;
    if (y > high) high = y;
  }
  return [low, high];
}

function blocksOf(ys) {
  const count = Math.floor(ys.length / BLOCK);
  const lows = new Float64Array(count), highs = new Float64Array(count);
  for (let b = 0; b < count; b++) [lows[b], highs[b]] = extremes(ys, b * BLOCK, (b + 1) * BLOCK);
  return { lows, highs };
}

/* The blocks of a column without gaps, found once. */
const knownBlocks = new WeakMap();

function blocksFor(ys) {
  if (!knownBlocks.has(ys)) knownBlocks.set(ys, blocksOf(ys));
  return knownBlocks.get(ys);
}

/* Lowest and highest of ys[from] to ys[to - 1]. */
function extremesOf(ys, blocks, from, to) {
  const first = Math.ceil(from / BLOCK), last = Math.floor(to / BLOCK);
  if (last <= first) return extremes(ys, from, to);
  let [low, high] = extremes(ys, from, first * BLOCK);
  for (let b = first; b < last; b++) {
    if (blocks.lows[b] < low) low = blocks.lows[b];
    if (blocks.highs[b] > high) high = blocks.highs[b];
  }
  const [below, above] = extremes(ys, last * BLOCK, to);
  return [Math.min(low, below), Math.max(high, above)];
}

/* First index in [from, to) whose x is at least `least`, else `to`. */
function firstAtLeast(xs, least, from, to) {
  while (from < to) {
    const middle = (from + to) >> 1;
    if (xs[middle] < least) from = middle + 1; else to = middle;
  }
  return from;
}

/* Pixel columns of xs[first..last] on a scale from `min` over `width` pixels up to `max`: calls
   each(column, firstValue, low, high, lastValue) from left to right; columns without a point are left out. */
function eachColumn(xs, ys, blocks, first, last, min, max, width, each) {
  const perPixel = (max - min) / width;
  let from = first;
  while (from <= last) {
    const column = Math.floor((xs[from] - min) / perPixel);
    const to = Math.max(firstAtLeast(xs, min + (column + 1) * perPixel, from, last + 1), from + 1);
    const [low, high] = extremesOf(ys, blocks, from, to);
    each(column, ys[from], low, high, ys[to - 1]);
    from = to;
  }
}

/* A path builder of uPlot for curves without gaps and bands. */
function columnPaths() {
  return (u, at, first, last) => {
    const xs = u.data[0], ys = u.data[at];
    const blocks = blocksFor(ys);
    const { min, max } = u.scales.x;
    const { left, top, width, height } = u.bbox;
    const y = u.scales.y, scale = height / (y.max - y.min);
    const row = (value) => top + height - (value - y.min) * scale;
    const stroke = new Path2D();
    let started = false;
    eachColumn(xs, ys, blocks, first, last, min, max, width, (column, entry, low, high, exit) => {
      const px = left + column + 0.5;
      if (started) stroke.lineTo(px, row(entry)); else stroke.moveTo(px, row(entry));
      started = true;
      if (high > low) { stroke.lineTo(px, row(low)); stroke.lineTo(px, row(high)); stroke.lineTo(px, row(exit)); }
    });
    return { stroke, fill: null, clip: null, band: null, gaps: null, flags: 1 };
  };
}

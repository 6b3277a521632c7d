/* Dense curves by pixel column: first, lowest, highest and last value of each, whatever the zoom. The
   extremes of blocks are found once, so that a million points cost no more than the pixels. */

const BLOCK = 32;

/* Levels of extremes: of blocks of 32 values, of 32 such blocks, and so on up to a single one. */
function levelsOf(ys) {
  const levels = [];
  let lows = ys, highs = ys;
  while (lows.length >= BLOCK) {
    const count = Math.floor(lows.length / BLOCK);
    const level = { lows: new Float64Array(count), highs: new Float64Array(count) };
    for (let b = 0; b < count; b++) {
      let low = Infinity, high = -Infinity;
      for (let i = b * BLOCK; i < (b + 1) * BLOCK; i++) {
        if (lows[i] < low) low = lows[i];
        if (highs[i] > high) high = highs[i];
      }
      level.lows[b] = low;
      level.highs[b] = high;
    }
    levels.push(level);
    ({ lows, highs } = level);
  }
  return levels;
}

/* The levels of a column without gaps, found once. */
const knownLevels = new WeakMap();

function levelsFor(ys) {
  if (!knownLevels.has(ys)) knownLevels.set(ys, levelsOf(ys));
  return knownLevels.get(ys);
}

/* Lowest and highest of ys[from] to ys[to - 1], from at most 62 values of each level. */
function extremesOf(ys, levels, from, to) {
  let low = Infinity, high = -Infinity, lows = ys, highs = ys;
  for (let height = 0; from < to; height++) {
    const above = levels[height];
    const first = above ? Math.min(Math.ceil(from / BLOCK) * BLOCK, to) : to;
    const last = above ? Math.max(Math.floor(to / BLOCK) * BLOCK, first) : to;
    for (let i = from; i < first; i++) {
      if (lows[i] < low) low = lows[i];
      if (highs[i] > high) high = highs[i];
    }
    for (let i = last; i < to; i++) {
      if (lows[i] < low) low = lows[i];
      if (highs[i] > high) high = highs[i];
    }
    if (!above) break;
    from = first / BLOCK;
    to = last / BLOCK;
    ({ lows, highs } = above);
  }
  return [low, high];
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
function eachColumn(xs, ys, levels, first, last, min, max, width, each) {
  const perPixel = (max - min) / width;
  let from = first;
  while (from <= last) {
    const column = Math.floor((xs[from] - min) / perPixel);
    const to = Math.max(firstAtLeast(xs, min + (column + 1) * perPixel, from, last + 1), from + 1);
    const [low, high] = extremesOf(ys, levels, from, to);
    each(column, ys[from], low, high, ys[to - 1]);
    from = to;
  }
}

/* A path builder of uPlot for curves without gaps and bands. */
function columnPaths() {
  return (u, at, first, last) => {
    const xs = u.data[0], ys = u.data[at];
    const levels = levelsFor(ys);
    const { min, max } = u.scales.x;
    const { left, top, width, height } = u.bbox;
    const y = u.scales.y, scale = height / (y.max - y.min);
    const row = (value) => top + height - (value - y.min) * scale;
    const stroke = new Path2D();
    let started = false;
    eachColumn(xs, ys, levels, first, last, min, max, width, (column, entry, low, high, exit) => {
      const px = left + column + 0.5;
      if (started) stroke.lineTo(px, row(entry)); else stroke.moveTo(px, row(entry));
      started = true;
      if (high > low) { stroke.lineTo(px, row(low)); stroke.lineTo(px, row(high)); stroke.lineTo(px, row(exit)); }
    });
    return { stroke, fill: null, clip: null, band: null, gaps: null, flags: 1 };
  };
}

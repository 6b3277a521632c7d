/* One live plot in the place of its drawing: every point, thinned only while drawing. */

const PLOT_HEIGHT = 250, STRIP_HEIGHT = 165, COLOURS = 6;
const LINE = 1.5, DENSE = 4;
const FONT = "12px system-ui, sans-serif";

/* A point of a curve with as many decimals as its series allows. */
function quantityText(value, expanded, series) {
  if (value === null || value === undefined) return "–";
  const shown = (number) => number.toFixed(series.decimals).replace(/^-(?=[0.]*$)/, "");
  const text = series.band_label.startsWith("±") && expanded !== null
    ? `${shown(value)} ± ${shown(expanded)}`
    : shown(value);
  return `${text} ${series.unit}`.trim().replaceAll("-", "−");
}

/* Values with no neighbour to be joined to, which only a dot can show. */
function alone(u, index) {
  const column = u.data[index];
  const [first, last] = u.series[0].idxs;
  const found = [];
  for (let i = first; i <= last; i++) {
    if (column[i] !== null && (column[i - 1] ?? null) === null && (column[i + 1] ?? null) === null) found.push(i);
  }
  return found;
}

/* Dense curves are thin lines: a step cannot be told from a slope there, and thick ones cost a frame. */
function pathsOf(step, plain) {
  const sparse = step ? uPlot.paths.stepped({ align: 1 }) : uPlot.paths.linear();
  const thin = plain ? columnPaths() : uPlot.paths.linear();
  return (u, at, first, last) => {
    const dense = last - first > DENSE * u.bbox.width;
    u.series[at].width = dense ? 1 / devicePixelRatio : LINE;
    return (dense ? thin : sparse)(u, at, first, last);
  };
}

function seriesOf(spec, data) {
  const list = [{ label: spec.x_label }];
  const bands = [], places = [];
  const banded = spec.series.some((series) => series.low && series.high);
  spec.series.forEach((series, i) => {
    const stroke = () => colour(`--c${(i % COLOURS) + 1}`);
    places.push(list.length);
    const points = { show: false };
    const gappy = Array.isArray(data[list.length]);
    const paths = pathsOf(series.step, !gappy && !banded);
    const dots = gappy ? { show: true, size: 3, filter: alone } : points;
    list.push({ label: series.label, auto: false, stroke, width: LINE, paths, points: dots, spanGaps: false });
    if (series.low && series.high) {
      const edge = { stroke: "transparent", width: 0, points, auto: false };
      list.push({ ...edge, label: "high" }, { ...edge, label: "low" });
      bands.push({ series: [list.length - 2, list.length - 1], fill: () => colour(`--band${(i % COLOURS) + 1}`) });
    }
  });
  return { list, bands, places };
}

async function dataOf(spec, read) {
  const columns = [await read(spec.x)];
  for (const series of spec.series) {
    columns.push(await read(series.values));
    if (series.low && series.high) columns.push(await read(series.high), await read(series.low));
  }
  return columns;
}

function axisOf(label, extra) {
  const grid = { stroke: () => colour("--grid"), width: 1 };
  const values = (_, splits) => splits.map((value) => (value === null ? "" : String(+value.toPrecision(12)).replace("-", "−")));
  return { stroke: () => colour("--muted"), font: FONT, labelFont: FONT, label, labelSize: 18, labelGap: 2, grid, ticks: grid, values, ...extra };
}

function drawLines(u, spec) {
  const { ctx, bbox } = u;
  const line = (x0, y0, x1, y1) => { ctx.beginPath(); ctx.moveTo(x0, y0); ctx.lineTo(x1, y1); ctx.stroke(); };
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.lineWidth = 1.5 * devicePixelRatio;
  ctx.setLineDash([6 * devicePixelRatio, 4 * devicePixelRatio]);
  ctx.strokeStyle = colour("--limit");
  for (const limit of spec.limits) {
    const y = u.valToPos(limit.value, "y", true);
    line(bbox.left, y, bbox.left + bbox.width, y);
  }
  ctx.setLineDash([2 * devicePixelRatio, 3 * devicePixelRatio]);
  ctx.strokeStyle = colour("--mark");
  for (const mark of spec.marks) {
    const x = u.valToPos(mark.x, "x", true);
    line(x, bbox.top, x, bbox.top + bbox.height);
  }
  ctx.restore();
}

function drawTolerance(u, spec) {
  if (!spec.tolerance) return;
  const [low, high] = spec.tolerance.map((value) => u.valToPos(value, "y", true));
  const { ctx, bbox } = u;
  const top = Math.max(high, bbox.top), bottom = Math.min(low, bbox.top + bbox.height);
  ctx.fillStyle = colour("--tolerance");
  ctx.fillRect(bbox.left, top, bbox.width, Math.max(bottom - top, 0));
}

/* How far a band may stretch the y axis beyond the values, in spans of the values. */
const BAND_REACH = 0.5;

/* Lowest and highest value in view of the columns, [Infinity, -Infinity] if there is none. */
function extentOf(u, columns) {
  const [first, last] = u.series[0].idxs;
  let low = Infinity, high = -Infinity;
  for (const column of columns) {
    if (column instanceof Float64Array) {
      const [least, most] = extremesOf(column, levelsFor(column), first, last + 1);
      low = Math.min(low, least);
      high = Math.max(high, most);
      continue;
    }
    for (let i = first; i <= last; i++) {
      const value = column[i];
      if (value === null || value === undefined) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return [low, high];
}

/* Range of y: the values in view, the limits, and bands as far as curves stay readable. uPlot finds
   none itself (auto: false), since it would look at every point. */
function rangeOf(spec, bands, places) {
  return (u) => {
    let [bottom, top] = extentOf(u, places.map((i) => u.data[i]));
    const reach = BAND_REACH * (top - bottom) || Infinity;
    const edges = extentOf(u, bands.flatMap((band) => band.series).map((i) => u.data[i]));
    bottom = Math.min(bottom, Math.max(edges[0], bottom - reach));
    top = Math.max(top, Math.min(edges[1], top + reach));
    for (const limit of spec.limits) { bottom = Math.min(bottom, limit.value); top = Math.max(top, limit.value); }
    if (!(top >= bottom)) return [0, 1];
    const air = 0.06 * (top - bottom || Math.abs(top) || 1);
    return [bottom - air, top + air];
  };
}

async function makePlot(figure, spec, read, bus) {
  const data = await dataOf(spec, read);
  if (data[0].length < 2) return null;
  const { list, bands, places } = seriesOf(spec, data);
  const height = spec.compact ? STRIP_HEIGHT : PLOT_HEIGHT;
  const box = figure.querySelector(".live");
  const now = figure.querySelectorAll(".now");
  const extent = [data[0][0], data[0][data[0].length - 1]];
  const plot = { figure, spec, extent, u: null };
  plot.words = (index) => spec.series.map((series, i) => {
    const value = data[places[i]][index];
    const high = series.low && series.high ? data[places[i] + 1][index] : null;
    return quantityText(value, high === null ? null : high - value, series);
  });
  plot.tell = (index) => {
    const words = index === null ? [] : plot.words(index);
    now.forEach((place, i) => { place.textContent = words[i] ?? ""; });
  };
  plot.u = new uPlot({
    width: Math.max(box.clientWidth, 280), height, series: list, bands,
    legend: { show: false },
    padding: [8, 12, 0, 0],
    scales: { x: { time: false }, y: { range: rangeOf(spec, bands, places) } },
    axes: [axisOf(`${spec.x_label} [${spec.x_unit}]`, { size: 30 }), axisOf(spec.y_label, { size: 52 })],
    cursor: { y: false, drag: { x: true, y: false, setScale: true }, bind: { mouseleave: () => null } },
    hooks: {
      setCursor: [(u) => bus.moved(plot, u)],
      setScale: [(u, key) => { if (key === "x") bus.zoomed(plot, u.scales.x.min, u.scales.x.max); }],
      drawClear: [(u) => drawTolerance(u, spec)],
      draw: [(u) => drawLines(u, spec)],
    },
  }, data, box);
  new ResizeObserver(() => {
    if (box.clientWidth > 0 && box.clientWidth !== plot.u.width) plot.u.setSize({ width: box.clientWidth, height });
  }).observe(box);
  return plot;
}

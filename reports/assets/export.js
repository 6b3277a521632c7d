/* What a plot shows, as CSV: the zoomed range of its columns at their stored resolution. */

/* A cell as RFC 4180 has it; text that a spreadsheet would take for a formula is set in a quote. */
function csvText(text) {
  const plain = /^[=+\-@\t\r]/.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(plain) ? `"${plain.replaceAll('"', '""')}"` : plain;
}

function csvOf(plot) {
  const { spec, u } = plot;
  const named = (label, unit) => (unit ? `${label} [${unit}]` : label);
  const header = [named(spec.x_label, spec.x_unit)];
  for (const series of spec.series) {
    header.push(named(series.label, series.unit));
    if (series.low && series.high) header.push(named(`${series.label}, upper edge`, series.unit), named(`${series.label}, lower edge`, series.unit));
  }
  const { min, max } = u.scales.x;
  const lines = [header.map(csvText).join(",")];
  const xs = u.data[0];
  for (let i = 0; i < xs.length; i++) {
    if (xs[i] < min || xs[i] > max) continue;
    lines.push(u.data.map((column) => column[i] ?? "").join(","));
  }
  return `${lines.join("\r\n")}\r\n`;
}

function watchExport(plot) {
  const button = plot.figure.querySelector("button.csv");
  button.hidden = false;
  button.addEventListener("click", () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([csvOf(plot)], { type: "text/csv" }));
    link.download = `${plot.figure.id}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
}

/* Camera pictures: the last one taken before the cursor's time is shown. */

function makeFrames(figure, spec) {
  const images = figure.querySelectorAll("img");
  const told = figure.querySelector("output");
  const seconds = spec.frames.map((frame) => frame.seconds);
  let shown = 0;
  return {
    domain: spec.domain,
    x: seconds,
    show: (at) => {
      if (at === undefined) return;
      const next = Math.max(seconds.findLastIndex((second) => second <= at), 0);
      images[shown].hidden = true;
      images[next].hidden = false;
      shown = next;
      told.textContent = `${seconds[next].toFixed(2)} s`;
      figure.dataset.cursor = String(seconds[next]);
    },
  };
}

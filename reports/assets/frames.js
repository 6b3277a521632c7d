/* Camera pictures: the one taken nearest to the cursor's time is shown. */

function makeFrames(figure, spec) {
  const images = figure.querySelectorAll("img");
  const told = figure.querySelector("output");
  const seconds = spec.frames.map((frame) => frame.seconds);
  const followers = [];
  let shown = 0;
  return {
    domain: spec.domain,
    x: seconds,
    show: (at) => {
      if (at === undefined) return;
      const next = nearest(seconds, at);
      images[shown].hidden = true;
      images[next].hidden = false;
      shown = next;
      told.textContent = `${seconds[next].toFixed(2)} s`;
      figure.dataset.cursor = String(seconds[next]);
      followers.forEach((follow) => follow(images[next], seconds[next]));
    },
    follow: (one) => followers.push(one),
  };
}

/* The first screen's copy of the camera: the same picture at the same moment. */
function makeSeen(figure, frames) {
  const image = figure.querySelector("img"), told = figure.querySelector("output");
  frames.follow((shown, seconds) => {
    if (image.src !== shown.src) image.src = shown.src;
    image.alt = shown.alt;
    told.textContent = `${seconds.toFixed(2)} s`;
    figure.dataset.cursor = String(seconds);
  });
}

/* The camera in the corner of the window while its own place is out of sight; a button closes it. */
function makeFollower(frames, places) {
  const figure = document.getElementById("follow"), button = document.getElementById("camera");
  const image = figure.querySelector("img");
  const seen = new Set();
  const settle = () => { figure.hidden = seen.size > 0 || button.getAttribute("aria-pressed") !== "true"; };
  frames.follow((shown) => {
    if (image.src !== shown.src) image.src = shown.src;
    image.alt = shown.alt;
  });
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) seen[entry.isIntersecting ? "add" : "delete"](entry.target);
    settle();
  });
  places.forEach((place) => observer.observe(place));
  button.addEventListener("click", () => {
    button.setAttribute("aria-pressed", String(button.getAttribute("aria-pressed") !== "true"));
    settle();
  });
  button.hidden = false;
}

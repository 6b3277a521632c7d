/* Light and dark: the system's choice until the reader makes one. */

const systemDark = matchMedia("(prefers-color-scheme: dark)");

function isDark() {
  const chosen = document.documentElement.dataset.theme;
  return chosen ? chosen === "dark" : systemDark.matches;
}

let styles = {};

/* The value of a style sheet variable, such as colour("--c1"). */
function colour(name) {
  if (!(name in styles)) {
    styles[name] = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }
  return styles[name];
}

function watchTheme(redraw) {
  const button = document.getElementById("theme");
  const refresh = () => {
    styles = {};
    button.textContent = isDark() ? "Light" : "Dark";
    redraw();
  };
  button.hidden = false;
  button.addEventListener("click", () => {
    document.documentElement.dataset.theme = isDark() ? "light" : "dark";
    refresh();
  });
  systemDark.addEventListener("change", refresh);
  refresh();
}

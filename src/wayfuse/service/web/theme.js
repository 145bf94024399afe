// Colours of the map, light and dark; the page's own are in page.css. Kept for the next visit: it says nothing of anybody.

const KEY = "wayfuse-theme";
const ORDER = ["system", "light", "dark"];
const dark = matchMedia("(prefers-color-scheme: dark)");

export const PALETTES = {
  light: {
    ground: "#eef0f2", floor: "#ffffff", edge: "#8a949e", unit: "#e3e8ee", room: "#f4f6f8", unitEdge: "#b4bec8",
    wall: "#59636e", door: "#ffffff", connector: "#d9cdf2", landing: "#6f42c1", text: "#24292f", halo: "#ffffff",
    next: "#bc4c00", point: "#116329", dotEdge: "#ffffff", lost: "#b35900", zone: "#0a6c74",
  },
  dark: {
    ground: "#0d1117", floor: "#1b2129", edge: "#6e7a86", unit: "#2a323c", room: "#222932", unitEdge: "#46525e",
    wall: "#9aa6b2", door: "#1b2129", connector: "#3c2f5c", landing: "#b99cf0", text: "#e6edf3", halo: "#0d1117",
    next: "#f0883e", point: "#56d364", dotEdge: "#0d1117", lost: "#f0883e", zone: "#4cc9d4",
  },
};

// told apart also by people who do not tell red from green (Okabe and Ito, 2008), darker where the ground is light
const TRACKS = {
  light: ["#0064a8", "#b34700", "#00785a", "#a8487f", "#2479ad", "#8a6500", "#3b3f45", "#7a3db8"],
  dark: ["#56b4e9", "#e69f00", "#2fc79a", "#dd8fbb", "#79a8ff", "#f0e442", "#c9d1d9", "#c29cff"],
};

let chosen = ORDER.includes(localStorage.getItem(KEY)) ? localStorage.getItem(KEY) : "system";
const told = new Set();

export const themeName = () => (chosen === "system" ? (dark.matches ? "dark" : "light") : chosen);
export const palette = () => PALETTES[themeName()];

/** A track's colour: always the same one. */
export function trackColour(track) {
  let sum = 0;
  for (const c of track) sum = (31 * sum + c.codePointAt(0)) % 9973;
  return TRACKS[themeName()][sum % TRACKS.light.length];
}

export const onTheme = (work) => told.add(work);

function apply(button) {
  document.documentElement.dataset.theme = themeName();
  button.textContent = `Theme: ${chosen}`;
  for (const work of told) work();
}

/** Let a button choose the theme. */
export function startTheme(button) {
  apply(button);
  button.addEventListener("click", () => {
    chosen = ORDER[(ORDER.indexOf(chosen) + 1) % ORDER.length];
    localStorage.setItem(KEY, chosen);
    apply(button);
  });
  dark.addEventListener("change", () => apply(button));
}

// Elements without markup: text is always text, whatever a phone or a plan calls itself.

/** An element with properties and children; `data` and `aria` objects become attributes. */
export function el(tag, props = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (name === "data") Object.assign(made.dataset, value);
    else if (name === "aria") for (const [k, v] of Object.entries(value)) made.setAttribute(`aria-${k}`, v);
    else if (name === "on") for (const [k, v] of Object.entries(value)) made.addEventListener(k, v);
    else if (name in made) made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

export const byId = (id) => document.getElementById(id);

/** Say something on the map, or, with an empty text, nothing. */
export function notice(text) {
  const at = byId("notice");
  at.textContent = text;
  at.hidden = !text;
}

export const metres = (value, digits = 1) => (value === null || value === undefined ? "–" : `${value.toFixed(digits)} m`);
export const percent = (value) => (value === null || value === undefined ? "–" : `${Math.round(100 * value)} %`);

/** Seconds as people say them. */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  const s = Math.max(0, Math.round(seconds));
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${s % 60} s`;
  return `${Math.floor(s / 3600)} h ${Math.floor((s % 3600) / 60)} min`;
}

/** The same in one number. */
export function age(seconds) {
  if (seconds < 2) return "now";
  const [size, unit] = [[86_400, "d"], [3600, "h"], [60, "min"], [1, "s"]].find(([size]) => seconds >= size);
  return `${Math.floor(seconds / size)} ${unit}`;
}

export const ago = (seconds) => (seconds < 2 ? "just now" : `${age(seconds)} ago`);

/** A function that runs work and says in an element what went wrong, or nothing. */
export const trying = (said) => async (work) => {
  try {
    await work();
    said.textContent = "";
  } catch (error) {
    said.textContent = error.message;
  }
};

/** A control that runs `work` when pressed, is busy meanwhile, and says what went wrong. */
export function action(text, work, props = {}) {
  const said = el("span", { role: "status", className: "said" });
  const button = el("button", { type: "button", textContent: text, ...props });
  button.addEventListener("click", async () => {
    button.disabled = true;
    said.textContent = "";
    try {
      said.textContent = (await work()) ?? "";
    } catch (error) {
      said.textContent = error.message;
    } finally {
      button.disabled = false;
    }
  });
  return el("span", { className: "action" }, button, said);
}

// Lists sites and tracks, once a second; the token stays in the memory of the page.
const said = document.getElementById("said");
let token = "";

async function ask(path) {
  const answer = await fetch(path, { headers: { Authorization: `Bearer ${token}` } });
  const body = await answer.json();
  if (!answer.ok) throw new Error(`${body.error} (${body.remedy})`);
  return body;
}

function fill(id, rows) {
  const body = document.querySelector(`#${id} tbody`);
  body.replaceChildren(...rows.map((cells) => {
    const row = document.createElement("tr");
    for (const text of cells) row.appendChild(document.createElement("td")).textContent = text;
    return row;
  }));
}

async function show() {
  const [{ sites }, { features }] = await Promise.all([ask("/api/v1/sites"), ask("/api/v1/positions")]);
  fill("sites", sites.map((s) => [s.name, s.levels.join(", "), s.radio_map ?? "none", s.tracks]));
  fill("tracks", features.map(({ properties: p }) => [
    p.track, p.site, p.level, p.x?.toFixed(1) ?? "", p.y?.toFixed(1) ?? "", p.radius_m_95?.toFixed(1) ?? "", p.state,
  ]));
}

async function keepShowing() {
  try {
    await show();
    said.textContent = "";
    setTimeout(keepShowing, 1000);
  } catch (error) {
    said.textContent = error.message;
  }
}

document.getElementById("login").addEventListener("submit", (event) => {
  event.preventDefault();
  token = document.getElementById("token").value.trim();
  keepShowing();
});

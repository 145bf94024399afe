// The server: requests with the token, and the stream of events (a plain EventSource cannot send a token).

const KEY = "wayfuse-token";
let token = sessionStorage.getItem(KEY) ?? "";

export const hasToken = () => token !== "";

export function keepToken(text) {
  token = text.trim();
  if (token) sessionStorage.setItem(KEY, token);
  else sessionStorage.removeItem(KEY);
}

/** An answer that is no success. */
export class Refused extends Error {
  constructor(status, body) {
    super(body.error ? `${body.error}${body.remedy ? ` (${body.remedy})` : ""}` : `the server answered ${status}`);
    this.status = status;
  }
}

async function request(path, query, options) {
  const search = new URLSearchParams(Object.entries(query).filter(([, v]) => v !== undefined && v !== ""));
  const headers = { Authorization: `Bearer ${token}`, ...options.headers };
  const answer = await fetch(`${path}${search.size ? `?${search}` : ""}`, { ...options, headers });
  if (!answer.ok) throw new Refused(answer.status, await answer.json().catch(() => ({})));
  return answer;
}

export const get = async (path, query = {}, signal = undefined) => (await request(path, query, { signal })).json();

async function send(method, path, query, body) {
  const isFile = body instanceof Blob;
  const headers = { "Content-Type": isFile ? "application/octet-stream" : "application/json" };
  return (await request(path, query, { method, headers, body: isFile ? body : JSON.stringify(body ?? {}) })).json();
}

export const post = (path, query, body) => send("POST", path, query, body);
export const put = (path, query, body) => send("PUT", path, query, body);

/** Save an answer as a file of a name. */
export async function save(path, query, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(await (await request(path, query, {})).blob());
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

export const remove = async (path, query = {}) => (await request(path, query, { method: "DELETE" })).json();

/** Events of a text stream, as they come: { id, event, data }. */
async function* events(body) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    rest += value;
    const blocks = rest.split("\n\n");
    rest = blocks.pop();
    for (const block of blocks) {
      const found = { id: "", event: "message", data: "" };
      for (const line of block.split("\n")) {
        const at = line.indexOf(": ");
        if (at > 0) found[line.slice(0, at)] = line.slice(at + 2);
      }
      if (found.data) yield found;
    }
  }
}

const pause = (ms) => new Promise((done) => setTimeout(done, ms));

/**
 * Listen to a site until the signal aborts; goes on where it was after every break.
 * told(event, data) for every event; state("on" | "off" | "refused", error) as the connection comes and goes.
 */
export async function listen(site, told, state, signal) {
  let last = "";
  let wait = 500;
  while (!signal.aborted) {
    try {
      const headers = last ? { "Last-Event-ID": last } : {};
      const answer = await request("/api/v1/events", { site }, { headers, signal });
      state("on");
      wait = 500;
      for await (const { id, event, data } of events(answer.body)) {
        last = id || last;
        told(event, JSON.parse(data));
      }
      state("off");
    } catch (error) {
      if (signal.aborted) return;
      if (error instanceof Refused && [401, 403].includes(error.status)) {
        state("refused", error);
        return;
      }
      state("off", error);
    }
    await pause(wait);
    wait = Math.min(2 * wait, 10_000);
  }
}

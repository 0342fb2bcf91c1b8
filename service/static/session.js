/**
 * Calls to the service. One that asks for an API key gets it from a field, and the tab keeps it until it is
 * closed. The key goes into a header, never into an address, so pictures and events are fetched as well.
 */

const STORED = "gcvec-key";
const PAUSE = 1000; // ms before a service that was away is asked again
const HIDDEN_PAUSE = 5000; // ms between two looks at a job from a tab that nobody sees
const SILENCE = 40_000; // ms without a word after which a stream is given up: the service speaks every 15 s
const LONGEST_MAKING = 120_000; // ms that a file may take to be made

let asking = null;

/** Whether the tab keeps a key. */
export const hasKey = () => sessionStorage.getItem(STORED) !== null;

/** Forget the key. */
export function forgetKey() {
  sessionStorage.removeItem(STORED);
}

/** `fetch` with the key; asks for one, until it is accepted, where the service wants it. */
export async function call(url, options = {}) {
  for (;;) {
    const key = sessionStorage.getItem(STORED);
    const headers = new Headers(options.headers);
    headers.set("X-Requested-With", "fetch"); // files come from here then, not by a redirect to a bucket
    if (key !== null) headers.set("Authorization", `Bearer ${key}`);
    const answer = await fetch(url, { ...options, headers });
    if (answer.status !== 401) return answer;
    // another call may have got a new key meanwhile
    if (key === sessionStorage.getItem(STORED)) await (asking ??= askForKey(key !== null).finally(() => (asking = null)));
  }
}

/** The answer, asked for again as long as the service is away or busy; `onAway` is told so every time. */
async function callPatiently(url, options, onAway = () => {}) {
  for (;;) {
    const answer = await call(url, options).catch(() => null);
    options.signal?.throwIfAborted();
    if (answer && answer.status < 500 && answer.status !== 429) return answer;
    onAway();
    await pause(answer ? secondsToWait(answer) * 1000 || PAUSE : PAUSE);
  }
}

const pause = (milliseconds) => new Promise((resume) => setTimeout(resume, milliseconds));

const secondsToWait = (answer) => Number(answer.headers.get("Retry-After")) || 0;

/** What the service, or a proxy, refuses. */
class ProblemError extends Error {}

/** The answer. Throws a ProblemError with the problem's words; a proxy's own page has none for us. */
async function checked(answer) {
  if (answer.ok) return answer;
  const problem = await answer.json().catch(() => null);
  throw new ProblemError(problem?.detail || problem?.title || `HTTP ${answer.status}`);
}

/** The answer of the service. Throws an Error with the problem's words. */
export const callChecked = async (url, options) => checked(await call(url, options));

/** The JSON of an answer. Throws an Error with the problem's words. */
export const callJson = async (url, options) => (await callChecked(url, options)).json();

/** The same, across outages; `onAway` is told of them. */
export const awaitJson = async (url, onAway) => JSON.parse(await awaited(url, (answer) => answer.text(), onAway));

/** A file as a Blob, across outages. */
export const awaitBlob = (url) => awaited(url, (answer) => answer.blob());

/** What `read` takes out of an answer, which is asked for again where it breaks off, too. */
async function awaited(url, read, onAway = () => {}) {
  for (;;) {
    const answer = await checked(await callPatiently(url, {}, onAway));
    const content = await read(answer).catch(() => null);
    if (content !== null) return content;
    onAway();
    await pause(PAUSE);
  }
}

/** A file as a Blob. */
export const callBlob = async (url) => (await callFile(url)).blob();

/** The answer that holds a file; one that is made on demand is asked for until it is there, or takes too long. */
export async function callFile(url) {
  const end = Date.now() + LONGEST_MAKING;
  for (;;) {
    const answer = await call(url);
    const again = secondsToWait(answer);
    if (answer.status !== 409 || !again) return checked(answer);
    if (Date.now() > end) throw new Error("The file is still being made. Try again later.");
    await pause(1000 * again);
  }
}

/**
 * The events of a job, { event, data } with the data parsed, to the final one; across broken connections, of
 * which `onAway` is told. Browsers keep few connections to a service for all tabs together, so a hidden tab
 * holds none: it looks at the job now and then, which is told as a snapshot, and gets the events once it is shown.
 */
export async function* eventsOf({ self, events }, onAway) {
  let last = "0";
  for (;;) {
    if (document.hidden) {
      const job = await awaitJson(self, onAway);
      yield { event: job.finished_at ? "state" : "snapshot", data: job };
      if (job.finished_at) return;
      await untilShown(HIDDEN_PAUSE);
      continue;
    }
    const connection = new Connection();
    try {
      const options = { headers: { "Last-Event-ID": last }, signal: connection.signal };
      const answer = await checked(await callPatiently(events, options, onAway));
      if (answer.status === 204) return;
      for await (const { id, event, data } of parsed(answer.body, connection)) {
        last = id ?? last;
        yield { event, data: JSON.parse(data) };
        if (event === "state") return;
      }
    } catch (error) {
      if (error instanceof ProblemError) throw error;
      console.debug(error); // the connection broke
    } finally {
      connection.close();
    }
    if (!document.hidden) await pause(PAUSE);
  }
}

/** Something to abort a stream by: when the tab is hidden, and when nothing has come for long. */
class Connection {
  constructor() {
    this._control = new AbortController();
    this.signal = this._control.signal;
    document.addEventListener("visibilitychange", () => document.hidden && this.close(), { signal: this.signal });
  }

  /** To be told whenever something comes. */
  alive() {
    clearTimeout(this._silence);
    this._silence = setTimeout(() => this.close(), SILENCE);
  }

  close() {
    clearTimeout(this._silence);
    this._control.abort();
  }
}

/** Wait so long, or until the tab is shown. */
async function untilShown(milliseconds) {
  const over = new AbortController();
  const shown = new Promise((resume) => document.addEventListener("visibilitychange", resume, { signal: over.signal }));
  await Promise.race([shown, pause(milliseconds)]);
  over.abort();
}

/** Server-sent events as they come in: { id, event, data } of each. */
async function* parsed(body, connection) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  for (;;) {
    connection.alive();
    const { value, done } = await reader.read();
    if (done) return;
    const blocks = (text + value).split(/\r?\n\r?\n/);
    text = blocks.pop();
    for (const block of blocks) {
      const fields = {};
      for (const line of block.split(/\r?\n/)) {
        const [, name, content] = /^(\w*): ?(.*)$/.exec(line) ?? [];
        if (name) fields[name] = name === "data" && "data" in fields ? `${fields.data}\n${content}` : content;
      }
      if ("data" in fields) yield fields;
    }
  }
}

function askForKey(refused) {
  const dialog = document.createElement("dialog");
  dialog.className = "card key";
  dialog.innerHTML = `
    <form method="dialog">
      <h2>API key</h2>
      <p class="error" role="alert" hidden>This key is not accepted.</p>
      <label for="key">The service asks for a key. This tab keeps it until it is closed.</label>
      <input id="key" type="password" autocomplete="off" pattern="[!-~]+" required />
      <button type="submit" class="primary">Go on</button>
    </form>`;
  dialog.querySelector(".error").hidden = !refused;
  dialog.addEventListener("cancel", (event) => event.preventDefault());
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.querySelector("form").addEventListener("submit", () => {
      sessionStorage.setItem(STORED, dialog.querySelector("input").value.trim());
      dialog.remove();
      resolve();
    });
  });
}

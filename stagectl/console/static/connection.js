// The connection to the console's process: log-in, ticket, websocket, and what it says, in `store`.
// Nothing here draws.

export const store = {
  loggedIn: null, // null: not known yet
  connected: false,
  state: {}, // parts of the state by name, as the process sends them
  notices: [],
  toasts: [],
};

const watchers = new Set();
export function watch(watcher) {
  watchers.add(watcher);
  return () => watchers.delete(watcher);
}
function changed() {
  for (const watcher of watchers) watcher();
}

const sampleWatchers = new Set();
export function watchSamples(watcher) {
  sampleWatchers.add(watcher);
  wantSamples();
  return () => { sampleWatchers.delete(watcher); wantSamples(); };
}

const lostWatchers = new Set();
export function watchLoss(watcher) {
  lostWatchers.add(watcher);
  return () => lostWatchers.delete(watcher);
}

let socket = null;
let number = 0;
const waiting = new Map();
const MOST_NOTICES = 2000;

export function toast(text, tone = "bad") {
  const entry = { text, tone, key: ++number };
  store.toasts = [...store.toasts.slice(-3), entry];
  setTimeout(() => { store.toasts = store.toasts.filter((t) => t !== entry); changed(); }, 8000);
  changed();
}

export class Failed extends Error {
  constructor(text, status, problems = []) {
    super(text);
    this.status = status;
    this.problems = problems;
  }
}

async function answerOf(response) {
  const body = await response.json().catch(() => ({}));
  if (response.status === 401 && store.loggedIn) { store.loggedIn = false; changed(); }
  if (!response.ok) throw new Failed(body.error || response.statusText, response.status);
  return body;
}

export async function get(path) {
  return answerOf(await fetch(path, { credentials: "same-origin" }));
}

export async function post(path, values = {}, more = {}) {
  return answerOf(await fetch(path, {
    method: "POST", credentials: "same-origin", body: JSON.stringify(values),
    headers: { "Content-Type": "application/json" }, ...more,
  }));
}

// A command of the protocol; resolves with its result.
export function ask(command, more = {}) {
  return new Promise((resolve, reject) => {
    if (!socket || socket.readyState !== WebSocket.OPEN) {
      reject(new Failed("not connected", 0));
      return;
    }
    const id = ++number;
    waiting.set(id, { resolve, reject });
    socket.send(JSON.stringify({ id, ask: command, ...more }));
  });
}

// The same for a button: what is refused is shown.
export async function order(command, more = {}) {
  try {
    return await ask(command, more);
  } catch (why) {
    toast(why.message);
    return undefined;
  }
}

// Over both ways, since either may be stuck; a second stop does no harm.
export function stop() {
  toast("Stop sent", "warning");
  ask({ op: "stop" }).catch(() => {});
  post("/api/stop", {}, { keepalive: true, priority: "high" }).catch((why) => toast("Stop: " + why.message));
}

export const me = {
  get name() { return localStorage.getItem("operator") || ""; },
  set name(name) { localStorage.setItem("operator", name); changed(); },
  // so that a page that is loaded again goes on commanding, unless somebody else does
  get commanded() { return sessionStorage.getItem("commands") === "yes"; },
  set commanded(yes) { sessionStorage.setItem("commands", yes ? "yes" : "no"); },
};

export async function take(force) {
  await ask({ op: "take", force });
  me.commanded = true;
}

export async function release() {
  me.commanded = false;
  await order({ op: "release" });
}

export async function logIn(token) {
  await post("/api/login", { token });
  store.loggedIn = true;
  changed();
  if (me.name) connect();
}

function wantSamples() {
  if (socket && socket.readyState === WebSocket.OPEN) {
    socket.send(JSON.stringify({ samples: sampleWatchers.size > 0 && !document.hidden }));
  }
}
document.addEventListener("visibilitychange", wantSamples);

export async function start() {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  if (token) {
    history.replaceState(null, "", location.pathname);
    try { await logIn(token); } catch (why) { toast(why.message); }
  }
  if (me.name) connect();
  else if (!store.loggedIn) {
    try { await get("/api/recipes"); store.loggedIn = true; } catch { store.loggedIn = false; }
    changed();
  }
}

let connecting = false;
export async function connect() {
  if (connecting || (socket && socket.readyState <= WebSocket.OPEN)) return;
  connecting = true;
  try {
    const { ticket } = await post("/api/ticket", { name: me.name });
    store.loggedIn = true;
    open(ticket);
  } catch (why) {
    if (why.status === 401) { store.loggedIn = false; changed(); }
    else setTimeout(connect, 1000);
  } finally {
    connecting = false;
  }
}

function open(ticket) {
  const made = new WebSocket(location.origin.replace(/^http/, "ws") + "/ws?ticket=" + ticket);
  socket = made;
  made.binaryType = "arraybuffer";
  made.onopen = () => { store.connected = true; wantSamples(); changed(); };
  made.onmessage = ({ data }) => {
    if (typeof data === "string") take_in(JSON.parse(data));
    else for (const watcher of sampleWatchers) watcher(data);
  };
  made.onclose = () => {
    if (socket !== made) return;
    socket = null;
    store.connected = false;
    store.state = {};
    for (const { reject } of waiting.values()) reject(new Failed("not connected", 0));
    waiting.clear();
    for (const watcher of lostWatchers) watcher();
    changed();
    setTimeout(connect, 500);
  };
}

function take_in(message) {
  if ("id" in message) {
    const { resolve, reject } = waiting.get(message.id) || {};
    waiting.delete(message.id);
    if (resolve && !("refused" in message)) resolve(message.result);
    else if (reject) reject(new Failed(message.refused.text, 409, message.refused.problems));
    return;
  }
  const { notices, ...parts } = message.changed;
  if ("generation" in parts) store.notices = [];
  if (notices) store.notices = [...store.notices, ...notices].slice(-MOST_NOTICES);
  const before = store.state;
  store.state = { ...store.state, ...parts };
  if (before.me && before.me.commands && !store.state.me.commands && store.state.lease) {
    me.commanded = false;
    toast(store.state.lease.holder + " has taken command", "warning");
  }
  if (!before.doing && store.state.doing && me.commanded && !store.state.lease) take(false).catch(() => {});
  changed();
}

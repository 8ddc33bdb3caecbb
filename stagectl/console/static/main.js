// The frame of all pages: who is here, the state, who commands, alarms, Stop.

import { Badge, Confirm, commands, html, render, useEffect, useState, useStore } from "./parts.js";
import { connect, logIn, me, order, post, release, start, stop, store, take, toast } from "./connection.js";
import { NOT_CONNECTED, NO_SERVER, STATES, clock, lasting } from "./format.js";
import { Live } from "./live.js";
import { Move } from "./move.js";
import { Run } from "./run.js";
import { Friction, Gap, Runs } from "./records.js";

const PAGES = { live: ["Live", Live], move: ["Move", Move], run: ["Run", Run], friction: ["Friction", Friction], gap: ["Gap", Gap], runs: ["Runs", Runs] };
const here = () => (location.hash.slice(1) in PAGES ? location.hash.slice(1) : "live");

addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || event.repeat || !store.loggedIn) return;
  event.preventDefault();
  stop();
}, true);

function Console() {
  const { loggedIn, state, connected, toasts } = useStore();
  const [page, setPage] = useState(here());
  useEffect(() => {
    const go = () => setPage(here());
    addEventListener("hashchange", go);
    return () => removeEventListener("hashchange", go);
  }, []);
  if (loggedIn === false) return html`<${LogIn} /><${Toasts} of=${toasts} />`;
  if (!me.name) return html`<${WhoIsThere} />`;
  const Page = PAGES[page][1];
  const served = connected && state.server && state.doing;
  return html`
    <header class="top">
      <${StateNow} />
      <${WhoCommands} />
      <button type="button" class="stop" onClick=${stop} title="Quick stop of all axes, then power off. This is no emergency stop.">STOP<small>Esc</small></button>
    </header>
    <nav aria-label="Pages">
      ${Object.entries(PAGES).map(([key, [name]]) => html`<a key=${key} href=${"#" + key} aria-current=${key === page ? "page" : undefined}>${name}</a>`)}
      <span class="space"></span>
      <${Theme} />
    </nav>
    <${Alarms} />
    <main class=${served ? "" : "waits"}>${served || page === "runs" ? html`<${Page} />` : html`<${Starting} />`}</main>
    <footer>STOP is a quick stop by software over network and bus. It is <strong>no emergency stop</strong>: for danger to people use the one on the machine.
      ${state.server ? html` <span class="nowrap">${state.server.machine} on ${state.server.simulated ? "virtual drives" : state.server.bus}</span>` : ""}</footer>
    <${Toasts} of=${toasts} />`;
}

function StateNow() {
  const { state, connected } = store;
  const [word, mark, tone] = !connected ? NOT_CONNECTED : STATES[state.doing] || NO_SERVER;
  const run = state.run;
  useEffect(() => { document.title = `${word} · stagectl`; }, [word]);
  const details = [];
  const begun = run && !["preparing", "finishing"].includes(run.phase);
  if (run) details.push(`${run.recipe}: ${begun && run.of ? `${run.done} of ${run.of}` : run.phase === "finishing" ? "its files are made" : run.phase}`);
  if (run && run.left != null) details.push(`${lasting(run.left)} left`);
  if (!run && state.what && state.what.toLowerCase() !== word.toLowerCase()) details.push(state.what);
  if (state.hold_left != null) details.push(`power goes off in ${lasting(state.hold_left)}`);
  if (state.doing && !state.homed) details.push("not homed");
  return html`<div class="now ${tone}" role="status" data-state=${state.doing || "none"}>
    <i aria-hidden="true">${mark}</i>
    <div><b>${word}</b><span>${details.join(" · ") || " "}</span></div>
    ${state.server && state.server.simulated ? html`<${Badge} tone="quiet">Virtual stage<//>` : ""}
  </div>`;
}

function WhoCommands() {
  const { state } = store;
  const [asking, setAsking] = useState(false);
  const mine = commands(), lease = state.lease;
  const other = lease && !mine;
  const begin = async (force) => { try { await take(force); } catch (why) { toast(why.message); } };
  return html`<div class="who">
    <div><small>In command</small><b>${mine ? "You, " + me.name : lease ? lease.holder : "nobody"}</b>
      ${other ? html`<small>since ${clock(lease.since)}; you watch</small>` : ""}</div>
    ${mine ? html`<button type="button" onClick=${release}>Give back</button>`
      : html`<button type="button" class="main" disabled=${!state.doing} onClick=${() => (other ? setAsking(true) : begin(false))}>${other ? "Take over" : "Take command"}</button>`}
    ${asking ? html`<${Confirm} text=${`${lease ? lease.holder : "Somebody"} commands the stage. Take over? They will only watch from then on.`}
      yes="Take over" act=${() => begin(true)} close=${() => setAsking(false)} />` : ""}
  </div>`;
}

function Alarms() {
  const alarms = store.state.alarms || [];
  if (!alarms.length) return "";
  return html`<section class="alarms" role="alert">${alarms.map((alarm) => html`<div class="alarm" key=${alarm.id}>
    <i aria-hidden="true">▲</i>
    <div><b>${alarm.axis ? `Axis ${alarm.axis}: ` : ""}${alarm.text}</b><span>${alarm.advice}</span><small>${clock(alarm.time)}</small></div>
    <button type="button" disabled=${!commands()} title=${commands() ? "" : "Take command first"} onClick=${() => order({ op: "acknowledge", alarm: alarm.id })}>Acknowledge</button>
  </div>`)}</section>`;
}

// While there is no server: what it is doing, or why it is not there.
function Starting() {
  const { connected, state } = store;
  if (!connected) return html`<section class="wait"><h2>Connecting to the console</h2>
    <p>If this stays, the console's process has ended or the network is down. The stage goes on as it was; its server is another process.</p></section>`;
  const started = state.process;
  return html`<section class="wait">
    <h2>${started && started.runs ? "The stage server is starting" : "There is no stage server"}</h2>
    <p>${started && started.runs ? "The first start after an installation compiles for some tens of seconds; later ones take a few." : state.why}</p>
    ${started && started.lines.length ? html`<pre>${started.lines.join("\n")}</pre>` : ""}
    ${started && !started.runs ? html`<p>${started.code != null ? `It has ended with code ${started.code}.` : ""}</p>
      <button type="button" class="main" onClick=${() => post("/api/server/start").catch((why) => toast(why.message))}>Start the stage server</button>
      <p class="note">Nothing moves by itself then: the queue is kept, and begins when you start it.</p>` : ""}
  </section>`;
}

function LogIn() {
  const submit = (event) => {
    event.preventDefault();
    logIn(event.target.token.value.trim()).catch((why) => toast(why.message));
  };
  return html`<form class="door" onSubmit=${submit}><h1>stagectl</h1>
    <label>Token <input name="token" type="password" autocomplete="current-password" required autofocus /></label>
    <p class="note">It is in the address that “stagectl console” has printed, or in its token file.</p>
    <button class="main">Open</button></form>`;
}

function WhoIsThere() {
  const submit = (event) => {
    event.preventDefault();
    const name = event.target.name.value.trim();
    if (name) { me.name = name; connect(); }
  };
  return html`<form class="door" onSubmit=${submit}><h1>Who is there?</h1>
    <label>Name <input name="name" maxlength="40" required autofocus autocomplete="name" /></label>
    <p class="note">Others see it when you command the stage; it is stored with your runs.</p>
    <button class="main">Continue</button></form>`;
}

function Theme() {
  const [name, setName] = useState(localStorage.getItem("theme") || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
  useEffect(() => {
    document.documentElement.dataset.theme = name;
    localStorage.setItem("theme", name);
    dispatchEvent(new Event("theme"));
  }, [name]);
  return html`<button type="button" class="plain" onClick=${() => setName(name === "dark" ? "light" : "dark")}>${name === "dark" ? "Light" : "Dark"}</button>`;
}

function Toasts({ of }) {
  return html`<div class="toasts" role="status">${of.map((t) => html`<p key=${t.key} class=${t.tone}>${t.text}</p>`)}</div>`;
}

render(html`<${Console} />`, document.getElementById("console"));
start();

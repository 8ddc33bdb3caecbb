// Run: a recipe chosen, checked and queued; the queue; the run under way with its results.

import { html, useStore, useEffect, useMemo, useRef, useState, Badge, Command, Confirm, Facts } from "./parts.js";
import { ask, get, me, order, toast } from "./connection.js";
import { Key, Table, siteState } from "./table.js";
import { results } from "./results.js";
import { lasting, ms } from "./format.js";

export function Run() {
  const { state } = useStore();
  return html`${state.run ? html`<${UnderWay} run=${state.run} />` : ""}
    <div class="run"><${Choose} /><${Queue} /></div>
    ${state.run ? "" : html`<${LastResult} />`}`;
}

function Choose() {
  const { state } = useStore();
  const [names, setNames] = useState([]);
  const [name, setName] = useState(sessionStorage.getItem("recipe") || "");
  const [text, setText] = useState("");
  const [plan, setPlan] = useState(null);
  const [problems, setProblems] = useState([]);
  const [note, setNote] = useState("");
  const [twins, setTwins] = useState([]);
  const [twin, setTwin] = useState(sessionStorage.getItem("twin") || "");
  const believe = (folder) => { setTwin(folder); sessionStorage.setItem("twin", folder); };
  const latest = useRef(0);
  useEffect(() => { get("/api/gaps").then((found) => { const withTwin = found.filter((g) => g.files.includes("twin.yaml")).map((g) => g.folder); setTwins(withTwin); if (!withTwin.includes(twin)) believe(""); }).catch((why) => toast(why.message)); }, []);
  useEffect(() => { get("/api/recipes").then((found) => { setNames(found); if (!found.includes(name)) setName(found[0] || ""); }).catch((why) => toast(why.message)); }, []);
  useEffect(() => {
    if (!name) return;
    sessionStorage.setItem("recipe", name);
    get("/api/recipes/" + encodeURIComponent(name)).then((found) => setText(found.text)).catch((why) => toast(why.message));
  }, [name]);
  useEffect(() => { // checked while it is typed, the last text only
    if (!text) return undefined;
    const number = ++latest.current;
    const timer = setTimeout(async () => {
      try {
        const found = await ask({ op: "check_recipe", recipe: text, source: name });
        if (number === latest.current) { setPlan(found); setProblems([]); }
      } catch (why) {
        if (number === latest.current) { setPlan(null); setProblems(why.problems && why.problems.length ? why.problems : [why.message]); }
      }
    }, 300);
    return () => clearTimeout(timer);
  }, [text]);
  const add = async (begin) => {
    const done = await order({ op: "queue_add", recipe: text, source: name, operator: me.name, ...(note.trim() ? { comment: note.trim() } : {}), ...(twin ? { machine: { text: "", source: twin } } : {}), start: begin });
    if (!done) return;
    toast(begin ? "Queued, and the queue runs" : "Queued", "good");
    if (begin) scrollTo({ top: 0 }); // where the run will be shown
  };
  const lines = new Set(problems.map((p) => place(p)).filter(Boolean).map(([line]) => line));
  return html`<section class="panel choose"><div class="row head"><h2>Recipe</h2>
      <select aria-label="Recipe" value=${name} onChange=${(e) => setName(e.target.value)}>${names.map((n) => html`<option key=${n} value=${n} selected=${n === name}>${n}</option>`)}</select>
      ${plan ? html`<${Badge} tone="good" mark="✓">can be run<//>` : problems.length ? html`<${Badge} tone="bad" mark="✕">${problems.length} problem${problems.length > 1 ? "s" : ""}<//>` : ""}</div>
    <${Editor} text=${text} change=${setText} marked=${lines} />
    ${problems.length ? html`<ul class="problems">${problems.map((p) => html`<${Problem} key=${p} text=${p} />`)}</ul>` : ""}
    ${plan ? html`<${Plan} plan=${plan} info=${state.server} />` : ""}
    <div class="row"><label class="wide">Note <input maxlength="300" value=${note} onInput=${(e) => setNote(e.target.value)} placeholder="stored with the run" /></label></div>
    ${twins.length ? html`<div class="row"><label class="wide">Model <select aria-label="Model" value=${twin} onChange=${(e) => believe(e.target.value)}><option value="" selected=${!twin}>of the server's machine file</option>${twins.map((t) => html`<option key=${t} value=${t} selected=${t === twin}>twin of ${t}</option>`)}</select></label></div>` : ""}
    <div class="row below"><${Command} kind="main" disabled=${!plan} act=${() => add(true)}>Queue and start<//>
      <${Command} disabled=${!plan} act=${() => add(false)}>Queue<//><span class="note">by ${me.name}</span></div>
  </section>`;
}

// FILE:LINE:COLUMN: reason
function place(problem) {
  const match = /:(\d+):(\d+): /.exec(problem);
  return match && [Number(match[1]), Number(match[2]), problem.slice(match.index + match[0].length)];
}

function Problem({ text }) {
  const at = place(text);
  const go = () => {
    const area = document.getElementById("recipe"), before = area.value.split("\n").slice(0, at[0] - 1);
    const start = before.reduce((sum, line) => sum + line.length + 1, 0) + at[1] - 1;
    area.focus();
    area.setSelectionRange(start, start);
    area.scrollTop = (at[0] - 4) * parseFloat(getComputedStyle(area).lineHeight);
  };
  return html`<li>${at ? html`<button type="button" class="link" onClick=${go}>line ${at[0]}, column ${at[1]}</button> ${at[2]}` : text}</li>`;
}

function Editor({ text, change, marked }) {
  const gutter = useRef();
  const lines = useMemo(() => text.split("\n").length, [text]);
  return html`<div class="editor">
    <div class="gutter" ref=${gutter} aria-hidden="true">${Array.from({ length: lines }, (_, k) => html`<span key=${k} class=${marked.has(k + 1) ? "marked" : ""}>${marked.has(k + 1) ? "▶ " : ""}${k + 1}</span>`)}</div>
    <textarea id="recipe" aria-label="Text of the recipe" spellcheck="false" wrap="off" rows="14" value=${text} onInput=${(e) => change(e.target.value)} onScroll=${(e) => { gutter.current.scrollTop = e.target.scrollTop; }}></textarea>
  </div>`;
}

function Plan({ plan, info }) {
  const moves = Object.entries(plan.moves || {}).map(([kind, count]) => `${count} ${kind}`).join(", ");
  const used = (plan.limits || []).filter((l) => l.unit !== "m").map((l) => l.used / l.limit);
  return html`<div class="plan"><${Table} travel=${info.axes.map((a) => a.travel)} axes=${info.axes.map((a) => a.name)} path=${plan.positions} />
    <div><${Facts} of=${[["Takes at least", lasting(plan.duration)], ["Sites", plan.sites || null], ["Moves", moves], ["Path", `${(plan.path_length * 1e3).toFixed(1)} mm`], ["Limits used", used.length ? `up to ${Math.round(100 * Math.max(...used))} %` : null]]} />
      ${(plan.notes || []).map((n) => html`<p class="note" key=${n}>${n}</p>`)}</div></div>`;
}

const STATUS = { waiting: ["quiet", "waits", "◌"], running: ["busy", "runs", "▶"], finishing: ["busy", "files are made", "▶"], interrupted: ["warning", "interrupted", "▲"] };
const OUTCOME = { completed: ["good", "completed", "✓"], aborted: ["warning", "aborted", "■"], fault: ["bad", "fault", "✕"] };

function Queue() {
  const { state } = useStore();
  const queue = state.queue || [], waiting = queue.filter((e) => e.status === "waiting");
  const shown = [...queue.filter((e) => e.status !== "waiting").slice(-6), ...waiting];
  return html`<section class="panel queue"><div class="row head"><h2>Queue</h2>
      ${state.queue_runs ? html`<${Badge} tone="busy" mark="▶">runs by itself<//>` : html`<${Badge} tone="quiet" mark="■">halted<//>`}
      <span class="space"></span>
      ${state.queue_runs ? html`<${Command} act=${() => order({ op: "queue_halt" })}>Halt after this run<//>`
        : html`<${Command} kind="main" disabled=${!waiting.length} act=${() => order({ op: "queue_start" })}>Start queue<//>`}</div>
    ${shown.length ? html`<ol class="entries">${shown.map((entry) => {
      const [tone, word, mark] = (entry.status === "done" && OUTCOME[entry.outcome]) || STATUS[entry.status] || ["quiet", entry.status, ""];
      const at = waiting.indexOf(entry);
      return html`<li key=${entry.id}><div><b>${entry.recipe}</b> <${Badge} tone=${tone} mark=${mark}>${word}<//>
          ${entry.verdict ? html` <${Badge} tone=${entry.verdict === "pass" ? "good" : "bad"} mark=${entry.verdict === "pass" ? "✓" : "✕"}>limits: ${entry.verdict}<//>` : ""}
          <small>${[entry.lot && "lot " + entry.lot, entry.wafer && "wafer " + entry.wafer, entry.operator, entry.machine && "with " + entry.machine.split("/").slice(-2).join("/"), entry.comment].filter(Boolean).join(" · ")}</small>
          ${entry.reason ? html`<small class="bad">${entry.reason}</small>` : ""}</div>
        <span class="row">${entry.status === "done" && entry.folder ? html`<a href=${reportOf(entry.folder)} target="_blank" rel="noopener noreferrer">Report</a>` : ""}
          ${at >= 0 ? html`<${Command} disabled=${at === 0} act=${() => order({ op: "queue_reorder", id: entry.id, place: at - 1 })} aria-label="earlier">↑<//>
          <${Command} disabled=${at === waiting.length - 1} act=${() => order({ op: "queue_reorder", id: entry.id, place: at + 1 })} aria-label="later">↓<//>` : ""}
          ${entry.status === "waiting" || entry.status === "done" || entry.status === "interrupted" ? html`<${Command} act=${() => order({ op: "queue_remove", id: entry.id })} aria-label="remove">Remove<//>` : ""}</span></li>`;
    })}</ol>` : html`<p class="note">Empty. What is queued is kept, also when the server ends; nothing starts by itself then.</p>`}
  </section>`;
}

const folderName = (folder) => folder.split("/").filter(Boolean).pop();
const reportOf = (folder) => `/files/${encodeURIComponent(folderName(folder))}/report.html`;

function UnderWay({ run }) {
  const { state, notices } = useStore();
  const [asking, setAsking] = useState(false);
  const share = run.moves_of ? Math.max(0, run.moves - 1) / run.moves_of : 0;
  const paused = run.paused_since != null;
  return html`<section class="panel underway" data-run=${paused ? "paused" : run.phase}><div class="row head"><h2>${run.recipe}</h2>
      <span class="phase">${run.site ? `site ${run.site}: ` : ""}${run.phase}</span><span class="space"></span>
      ${paused ? html`<${Command} kind="main large" act=${() => order({ op: "resume" })}>Resume<//>` : html`<${Command} kind="large" disabled=${state.doing !== "running"} act=${() => order({ op: "pause" })}>Pause after this site<//>`}
      <${Command} kind="large" act=${() => setAsking(true)}>Abort<//></div>
    <progress max="1" value=${share} aria-label="Progress"></progress>
    <${Facts} of=${[["Sites done", run.of ? `${run.done} of ${run.of}` : null], ["Moves begun", `${run.moves} of ${run.moves_of}`], ["Since the first move", lasting(run.elapsed)], ["Left", run.left == null ? "not known yet" : lasting(run.left)],
      ["Paused for", paused ? `${lasting(state.time - run.paused_since)}, at most ${lasting(state.server.pause_limit)}` : null]]} />
    <${Results} run=${run} sites=${state.sites || []} of=${results(notices, run.entry, run.limits)} />
    ${asking ? html`<${Confirm} text="Abort this run? It ends with a controlled stop; the axes stay held, and what is recorded is kept." yes="Abort the run" act=${() => order({ op: "abort", reason: "aborted in the console" })} close=${() => setAsking(false)} />` : ""}
  </section>`;
}

// Settling and friction per site, on the wafer and in figures, as they come.
function Results({ run, sites, of }) {
  const { state } = useStore();
  if (!sites.length) return "";
  const axes = state.server.axes.map((a) => a.name);
  const marked = sites.map(([x, y], k) => {
    const found = of.sites.get(k + 1) || {};
    return { x, y, state: siteState(k + 1, { site: run.site, done: run.done, failed: of.failed, passed: of.passed, total: sites.length }), label: found.micro == null ? "" : ms(found.micro), text: found.micro == null ? "" : `settled in ${ms(found.micro)} ms` };
  });
  const rows = [...of.sites.entries()].sort(([a], [b]) => b - a);
  return html`<div class="results"><div><${Table} close travel=${state.server.axes.map((a) => a.travel)} axes=${axes} sites=${marked} />
      <${Key} states=${[of.passed.size ? "passed" : "done", "current", "next", "waiting", "failed"]} /><p class="note">Figures: settling of the micro-move, ms, as the run saw it; what counts is evaluated from the recording at its end.</p></div>
    <div class="scroll tall"><table class="sites"><thead><tr><th>Site</th><th class="n">Macro, ms</th><th class="n">Micro, ms</th><th></th>${axes.map((a) => html`<th class="n" key=${a}>Fc ${a}, N</th>`)}</tr></thead>
      <tbody>${rows.map(([site, found]) => html`<tr key=${site}><td>${site}</td><td class="n">${ms(found.macro)}</td><td class="n">${ms(found.micro)}</td>
        <td>${of.failed.has(site) ? html`<${Badge} tone="bad" mark="✕">${found.settled ? "over the limit" : "not settled"}<//>` : of.passed.has(site) ? html`<${Badge} tone="good" mark="✓">pass<//>` : ""}</td>
        ${axes.map((a) => { const f = (of.friction.get(site) || {})[a]; return html`<td class="n" key=${a}>${f ? `${f.value.toFixed(2)} ± ${(2 * f.sigma).toFixed(2)}` : "–"}</td>`; })}</tr>`)}</tbody></table>
      <p class="note">Fc: Coulomb friction with its 95 % band.</p></div></div>`;
}

function LastResult() {
  const { state, notices } = useStore();
  const last = [...(state.queue || [])].reverse().find((e) => e.status === "done" && e.folder);
  if (!last) return "";
  const of = results(notices, last.id);
  const [tone, word, mark] = OUTCOME[last.outcome] || ["quiet", last.outcome || "", ""];
  return html`<section class="panel"><div class="row head"><h2>Last run: ${last.recipe}</h2><${Badge} tone=${tone} mark=${mark}>${word}<//>
      ${last.verdict ? html`<${Badge} tone=${last.verdict === "pass" ? "good" : "bad"} mark=${last.verdict === "pass" ? "✓" : "✕"}>limits: ${last.verdict}<//>` : ""}
      <span class="space"></span><a class="button" href=${reportOf(last.folder)} target="_blank" rel="noopener noreferrer">Open the report</a></div>
    <p class="note">${of.sites.size} sites settled${last.reason ? `; ${last.reason}` : ""}. What it has shown in full is in the report.</p></section>`;
}

// Runs, diagnoses of the gap, friction maps: what is on disk, each report one click away.

import { html, useStore, useEffect, useState, Badge, Command, Confirm } from "./parts.js";
import { get, me, post, release, store, toast } from "./connection.js";
import { day, lasting, ms } from "./format.js";

const OUTCOME = { completed: ["good", "✓"], running: ["busy", "▶"], aborted: ["warning", "■"], fault: ["bad", "✕"], killed: ["bad", "✕"], unreadable: ["bad", "✕"] };
const fileOf = (...parts) => "/files/" + parts.map(encodeURIComponent).join("/");
const Open = ({ to, children }) => html`<a href=${to} target="_blank" rel="noopener noreferrer">${children}</a>`;

function useLoaded(path, ...again) {
  const [found, setFound] = useState(null);
  useEffect(() => { get(path).then(setFound).catch((why) => { setFound([]); toast(why.message); }); }, [path, ...again]);
  return found;
}

const ended = () => (store.state.queue || []).filter((e) => e.status === "done").length;

export function Runs() {
  useStore();
  const runs = useLoaded("/api/runs", ended());
  const [filter, setFilter] = useState({ recipe: "", lot: "", wafer: "", outcome: "" });
  const [chosen, setChosen] = useState([]);
  if (!runs) return html`<p class="note">Reading the runs …</p>`;
  const outcome = (run) => (run.verdict === "fail" ? "limits missed" : run.outcome);
  const of = { recipe: (r) => r.recipe, lot: (r) => r.lot || "", wafer: (r) => r.wafer || "", outcome };
  const shown = runs.filter((run) => Object.entries(filter).every(([key, value]) => !value || of[key](run) === value));
  const choose = (run) => setChosen(chosen.includes(run) ? chosen.filter((r) => r !== run) : [...chosen, run].slice(-2));
  return html`<section class="panel"><div class="row head"><h2>Runs</h2>
      ${Object.keys(of).map((key) => html`<label key=${key}>${key[0].toUpperCase() + key.slice(1)} <select value=${filter[key]} onChange=${(e) => setFilter({ ...filter, [key]: e.target.value })}>
        <option value="">all</option>${[...new Set(runs.map(of[key]))].filter(Boolean).sort().map((v) => html`<option key=${v}>${v}</option>`)}</select></label>`)}
      <span class="note">${shown.length} of ${runs.length}</span></div>
    <div class="scroll"><table class="records"><thead><tr><th></th><th>Started</th><th>Recipe</th><th>Lot</th><th>Wafer</th><th>Operator</th><th>Outcome</th><th class="n">Settling, ms</th><th>Reports</th><th>Note</th></tr></thead>
      <tbody>${shown.slice(0, 500).map((run) => html`<tr key=${run.folder}>
        <td><input type="checkbox" aria-label=${"compare " + run.folder} checked=${chosen.includes(run)} onChange=${() => choose(run)} /></td>
        <td>${day(run.started)}</td><td>${run.recipe || run.folder}${run.simulated ? html` <small>virtual</small>` : ""}</td><td>${run.lot}</td><td>${run.wafer}</td><td>${run.operator}</td>
        <td><${Badge} tone=${(run.verdict === "fail" ? ["bad"] : OUTCOME[run.outcome] || ["quiet"])[0]} mark=${(run.verdict === "fail" ? ["", "✕"] : OUTCOME[run.outcome] || ["", ""])[1]}>${outcome(run)}<//>${run.of && run.outcome !== "completed" ? html` <small>${run.done} of ${run.of}</small>` : ""}</td>
        <td class="n">${ms(run.settling)}</td>
        <td>${run.pages.map((name) => html`<${Open} key=${name} to=${fileOf(run.folder, name)}>${name.replace(".html", "")}<//> `)}${run.recorded ? html`<a href=${fileOf(run.folder, "recording.h5")} download>HDF5</a>` : ""}</td>
        <td class="text">${run.reason || run.comment}</td></tr>`)}</tbody></table></div>
    ${chosen.length === 2 ? html`<${Compare} runs=${chosen} />` : html`<p class="note">Tick two runs to compare them.</p>`}
  </section>`;
}

function Compare({ runs }) {
  const [found, setFound] = useState([]);
  const [gap, setGap] = useState(null);
  const ordered = [...runs].sort((a, b) => (a.started < b.started ? -1 : 1));
  const models = () => {
    setGap("comparing …");
    post("/api/runs/compare", { before: ordered[0].folder, after: ordered[1].folder }).then(setGap).catch((why) => { setGap(null); toast(why.message); });
  };
  useEffect(() => {
    setGap(null);
    Promise.all(ordered.map((run) => get(fileOf(run.folder, "summary.json")))).then(setFound).catch((why) => toast(why.message));
  }, [runs.map((r) => r.folder).join()]);
  if (found.length !== 2) return "";
  const rows = [];
  for (const kind of ["macro", "micro"]) {
    const windows = Object.keys((found[0][kind] || {}).settling_median || {});
    for (const window of windows) {
      rows.push([`${kind}: settling to ±${(Number(window) * 1e9).toFixed(0)} nm, median, ms`, ...found.map((s) => ms(((s[kind] || {}).settling_median || {})[window]))]);
    }
    rows.push([`${kind}: moves`, ...found.map((s) => (s[kind] || {}).count ?? "–")]);
  }
  return html`<h3>Side by side</h3><table class="narrow"><thead><tr><th></th>${ordered.map((r) => html`<th class="n" key=${r.folder}>${r.folder}</th>`)}</tr></thead>
    <tbody>${rows.map(([name, a, b]) => html`<tr key=${name}><td>${name}</td><td class="n">${a}</td><td class="n">${b}</td></tr>`)}
      ${gap && gap.gap ? Object.entries(gap.gap).flatMap(([axis, of]) => Object.entries(of).map(([what, g]) => html`<tr key=${axis + what}><td>${axis}: gap of its machine file in ${what}, ${g.unit === "m" ? "nm" : g.unit}</td><td class="n">${inUnit(g.nominal, g.unit)}</td><td class="n">${inUnit(g.explained, g.unit)}</td></tr>`)) : ""}</tbody></table>
    ${gap && gap.gap ? html`<p class="hint">On both recordings, the machine file of the later run closes ${Math.round(100 * gap.gap_closed)} % of the earlier one's gap above its floor.</p>`
      : html`<div class="row"><button type="button" disabled=${gap !== null || runs.some((r) => !r.recorded)} onClick=${models}>Compare their machine files, too</button>${typeof gap === "string" ? html`<span class="note">${gap}</span>` : ""}</div>`}`;
}

const inUnit = (value, unit) => (value == null ? "–" : unit === "m" ? (value * 1e9).toFixed(1) : value.toFixed(3));

export function Gap() {
  const { state } = useStore();
  const job = state.job_beside;
  const runs = useLoaded("/api/runs", ended());
  const gaps = useLoaded("/api/gaps", job && job.ended);
  const [chosen, setChosen] = useState([]);
  const active = job && job.ended == null;
  const moves = ["moving", "running", "homing"].includes(state.doing);
  const toggle = (name) => setChosen(chosen.includes(name) ? chosen.filter((n) => n !== name) : [...chosen, name].slice(-20));
  const begin = () => post("/api/gaps/start", { runs: chosen }).catch((why) => toast(why.message));
  return html`<section class="panel"><div class="row head"><h2>Diagnose the gap between simulation and recordings</h2></div>
      <p class="note">A diagnosis takes minutes and runs beside the stage with the lowest priority.${moves ? " This computer moves a stage now: rather wait for the end of the run." : ""}</p>
      <${JobBeside} job=${job} />
      <div class="scroll tall"><table class="records"><tbody>${(runs || []).filter((r) => r.recorded).slice(0, 200).map((run) => html`<tr key=${run.folder}><td><label class="check"><input type="checkbox" checked=${chosen.includes(run.folder)} onChange=${() => toggle(run.folder)} /> ${run.folder}</label></td><td>${day(run.started)}</td><td>${run.recipe}</td><td>${run.outcome}</td></tr>`)}</tbody></table></div>
      <div class="row"><button type="button" class="main" disabled=${!chosen.length || active} onClick=${begin}>Diagnose ${chosen.length || ""} recording${chosen.length === 1 ? "" : "s"}</button></div>
    </section>
    <section class="panel"><h2>Diagnoses</h2><table class="records"><tbody>${(gaps || []).map((gap) => html`<tr key=${gap.folder}><td>${gap.folder}</td><td>
      ${gap.files.includes("report.html") ? html`<${Open} to=${fileOf("gaps", gap.folder, "report.html")}>Report<//>` : html`<small>no report</small>`}</td>
      <td>${gap.files.includes("twin.yaml") ? html`<a href=${fileOf("gaps", gap.folder, "twin.yaml")} download>Twin (machine file)</a>` : ""}</td>
      <td>${gap.files.includes("twin.yaml") ? html`<button type="button" onClick=${() => { sessionStorage.setItem("twin", gap.folder); location.hash = "run"; }}>Run with it …</button>` : ""}</td>
      <td>${gap.files.includes("diagnosis.json") ? html`<a href=${fileOf("gaps", gap.folder, "diagnosis.json")} download>JSON</a>` : ""}</td></tr>`)}</tbody></table>
      ${gaps && gaps.length ? html`<p class="note">A run with a twin uses its model for the feedforward; drives and limits stay as they are. What it changed is shown under Runs, by two runs side by side.</p>` : html`<p class="note">None yet.</p>`}</section>`;
}

export function Friction() {
  useStore();
  const [again, setAgain] = useState(0);
  const [found, setFound] = useState(null);
  const [why, setWhy] = useState("");
  const [asking, setAsking] = useState(null);
  const [page, setPage] = useState("");
  useEffect(() => { get("/api/maps").then((f) => { setFound(f); setWhy(""); }).catch((e) => setWhy(e.message)); }, [again]);
  const act = (path, values) => post(path, values).then((done) => { toast(done.said, "good"); setAgain(again + 1); }).catch((e) => toast(e.message));
  const show = (number) => post("/api/maps/page", number == null ? {} : { number }).then((made) => setPage(made.page + "?" + Date.now())).catch((e) => toast(e.message));
  const versions = (found && found.maps) || [];
  const job = store.state.job_beside;
  useEffect(() => { if (job && job.ended) setAgain((n) => n + 1); }, [job && job.ended]);
  return html`<section class="panel"><div class="row head"><h2>Friction maps</h2><span class="space"></span>
      <${Command} disabled=${!versions.length} act=${() => setAsking(["Return to the map that was in use before this one?", "Roll back", () => act("/api/maps/rollback", {})])}>Roll back<//></div>
    ${why ? html`<p class="hint">${why}</p>` : ""}
    <table class="records"><thead><tr><th>Version</th><th>Made</th><th>Sites</th><th>Comment</th><th></th><th></th></tr></thead><tbody>${[...versions].reverse().map((v) => html`<tr key=${v.map}>
      <td>${v.map} ${v.active ? html`<${Badge} tone="good" mark="✓">in use<//>` : ""}</td><td>${day(new Date(v.made * 1e3).toISOString())} UTC</td><td>${Object.entries(v.sites).map(([axis, count]) => `${axis}: ${count}`).join(", ")}</td><td class="text">${v.comment || ""}</td>
      <td><button type="button" onClick=${() => show(v.map)}>Draw</button></td>
      <td><${Command} disabled=${v.active} act=${() => setAsking([`Use map ${v.map} in further runs?`, "Activate", () => act("/api/maps/activate", { number: v.map })])}>Activate<//></td></tr>`)}</tbody></table>
    ${found && !versions.length ? html`<p class="note">There is no map in this history yet.</p>` : ""}
    ${page ? html`<p class="hint good"><${Open} to=${page}>Open the map: uncertainty, trend of every site, changes<//></p>` : ""}
    <p class="note">Runs use the active map.</p>
    ${asking ? html`<${Confirm} text=${asking[0]} yes=${asking[1]} act=${asking[2]} close=${() => setAsking(null)} />` : ""}
  </section><${Calibrate} />`;
}

// A calibration is a command of its own on the stage server, so this page gives command back to it.
function Calibrate() {
  const { state } = useStore();
  const names = useLoaded("/api/calibrations") || [];
  const [chosen, setChosen] = useState("");
  const [due, setDue] = useState(null);
  const [asking, setAsking] = useState(null);
  const sites = chosen || names[0] || "";
  const job = state.job_beside, active = job && job.ended == null;
  const asked = (only) => ({ sites, due: only, operator: me.name });
  const look = () => { setDue("looking …"); post("/api/calibrations/due", asked(true)).then((f) => setDue(f.would_visit || [])).catch((e) => { setDue(null); toast(e.message); }); };
  const begin = async (only) => {
    await release();
    post("/api/calibrations/start", asked(only)).catch((e) => toast(e.message));
  };
  const confirm = (only) => setAsking(only);
  return html`<section class="panel"><div class="row head"><h2>Calibrate</h2>
      <select aria-label="Sites" value=${sites} onChange=${(e) => { setChosen(e.target.value); setDue(null); }}>${names.map((n) => html`<option key=${n} value=${n}>${n}</option>`)}</select>
      <button type="button" disabled=${!sites || active} onClick=${look}>Which sites are due?</button>
      <${Command} disabled=${!sites || active || state.run} act=${() => confirm(true)}>Calibrate due sites<//>
      <${Command} disabled=${!sites || active || state.run} act=${() => confirm(false)}>Calibrate all sites<//></div>
    ${due === null ? "" : typeof due === "string" ? html`<p class="note">${due}</p>` : html`<p class="hint">${due.length ? `Due: ${due.map(([x, y]) => `(${+(x * 1e3).toFixed(3)}, ${+(y * 1e3).toFixed(3)})`).join(", ")} mm` : "No site is due."}</p>`}
    <${JobBeside} job=${job} />
    <p class="note">Friction is measured at fixed sites, and a new version of the map is made; it is used once it is activated.</p>
    ${asking === null ? "" : html`<${Confirm} text="Calibrate? The stage moves. Command is given back, and passes to the calibration; Stop works as always." yes="Calibrate" act=${() => begin(asking)} close=${() => setAsking(null)} />`}
  </section>`;
}

// A command that runs beside the stage server.
function JobBeside({ job }) {
  if (!job) return "";
  const active = job.ended == null, good = job.code === 0;
  return html`<p class="hint ${active ? "" : good ? "good" : "bad"}">${active ? "▶ " : good ? "✓ " : "✕ "}${job.what}: ${active ? `under way for ${lasting(Date.now() / 1e3 - job.began)}` : good ? "done" : "failed"}${job.line ? html`<br /><small>${job.line}</small>` : ""}
    ${active ? html` <button type="button" onClick=${() => post("/api/gaps/cancel").catch((why) => toast(why.message))}>Cancel</button>` : ""}</p>`;
}

// Live: the table, each axis in figures, the scope, what has happened.

import { html, useStore, useState, Badge, Facts } from "./parts.js";
import { Key, Table, siteState } from "./table.js";
import { Scope } from "./scope.js";
import { results } from "./results.js";
import { clock, mm, newton, nm } from "./format.js";

export function Live() {
  const { state, notices } = useStore();
  const axes = state.axes || [];
  return html`
    <div class="live">
      <div class="column"><section class="panel"><${StageTable} /></section>
        <section class="panel slim"><${Facts} of=${[
          ["SYNC period", `${(state.server.period * 1e3).toFixed(3)} ms`], ["Bus load", state.bus_load == null ? "–" : `${(100 * state.bus_load).toFixed(1)} %`], ["Late SYNCs", state.late], ["Missed samples", state.missed],
          ["Program", state.server.program]]} /></section>
        <${Happened} notices=${notices} /></div>
      <div class="column"><div class="cards">${axes.map((axis, k) => html`<${AxisCard} key=${axis.name} axis=${axis} number=${k} />`)}</div>
        ${axes.length ? html`<${Scope} axes=${axes.map((a) => a.name)} period=${state.server.period} />` : ""}</div>
    </div>`;
}

// The table with the sites of the run under way.
export function StageTable({ close }) {
  const { state, notices } = useStore();
  const axes = state.axes || [], info = state.server.axes;
  const run = state.run, sites = state.sites || [];
  const of = run ? results(notices, run.entry, run.limits) : null;
  const shown = sites.map(([x, y], k) => ({
    x, y, state: siteState(k + 1, { site: run.site, done: run.done, failed: of && of.failed, passed: of && of.passed, total: sites.length }),
  }));
  return html`<${Table} close=${close} travel=${info.map((a) => a.travel)} axes=${info.map((a) => a.name)} sites=${shown}
      position=${axes.length > 1 ? axes.map((a) => a.position) : null} />
    ${sites.length ? html`<${Key} states=${[of && of.passed.size ? "passed" : "done", "current", "next", "waiting", "failed"]} />` : ""}`;
}

export function AxisCard({ axis, number }) {
  const off = !/enabled/i.test(axis.status);
  return html`<section class="panel axis" data-axis-number=${number}>
    <h2>Axis ${axis.name} <${Badge} tone=${/fault/i.test(axis.status) ? "bad" : off ? "quiet" : "good"}>${axis.status.toLowerCase()}<//>
      ${axis.homed ? "" : html`<${Badge} tone="warning">not homed<//>`}</h2>
    <div class="figure"><b>${mm(axis.position)}</b><small>mm</small></div>
    <dl class="values">
      <div><dt>Following error</dt><dd>${nm(axis.error)}<small> nm</small></dd></div>
      <div><dt>Force</dt><dd>${newton(axis.force)}<small> N</small></dd></div>
      <div><dt>Force offset</dt><dd>${newton(axis.offset)}<small> N</small></dd></div>
      ${axis.brake == null ? "" : html`<div><dt>Brake</dt><dd class="word">${axis.brake ? "set" : "released"}</dd></div>`}
      ${axis.sto == null ? "" : html`<div><dt>Safe torque off</dt><dd class=${axis.sto ? "word bad" : "word"}>${axis.sto ? "▲ active" : "not active"}</dd></div>`}
    </dl>
  </section>`;
}

const QUIET = new Set(["move_started", "waiting", "settled", "friction", "exposed", "mark_found", "segment_done"]);

function Happened({ notices }) {
  const [all, setAll] = useState(false);
  const shown = notices.filter((n) => all || !QUIET.has(n.kind)).slice(-(all ? 200 : 12)).reverse();
  return html`<section class="panel"><div class="row head"><h2>What has happened</h2>
      <label class="check"><input type="checkbox" checked=${all} onChange=${(e) => setAll(e.target.checked)} /> every move</label></div>
    <ol class="log">${shown.map((n) => html`<li key=${n.number} class=${n.kind === "alarm" ? "bad" : ""}><time>${clock(n.time)}</time><span>${n.kind === "alarm" ? "▲ Alarm: " : ""}${n.text}</span></li>`)}</ol>
    ${shown.length ? "" : html`<p class="note">Nothing yet.</p>`}
  </section>`;
}

// Move: power, home, moves by figures, steps and by holding a button.

import { html, useStore, useState, Command, Segments, commands } from "./parts.js";
import { order } from "./connection.js";
import { Hold } from "./hold.js";
import { AxisCard, StageTable } from "./live.js";

const STEPS = [[1e-6, "1 µm"], [1e-5, "10 µm"], [1e-4, "100 µm"], [1e-3, "1 mm"], [1e-2, "10 mm"]];
const SPEEDS = [[1e-4, "0.1 mm/s"], [1e-3, "1 mm/s"], [1e-2, "10 mm/s"], [5e-2, "50 mm/s"]];

export function Move() {
  const { state } = useStore();
  const [reset, setReset] = useState(true);
  const [step, setStep] = useState(1e-4);
  const [speed, setSpeed] = useState(1e-3);
  const axes = state.axes || [];
  const busy = Boolean(state.run);
  const idle = state.doing === "held";
  return html`
    ${busy ? html`<p class="hint warning">▲ A run is under way: motion by hand comes after it. Stop works as always.</p>` : ""}
    ${!commands() ? html`<p class="hint">You watch. To move the stage, take command above.</p>` : ""}
    <section class="panel"><div class="row head"><h2>Power</h2>
      <${Command} kind="main" disabled=${busy || state.enabled} act=${() => order({ op: "enable", reset })}>Enable<//>
      <${Command} disabled=${busy || !state.enabled} act=${() => order({ op: "disable" })}>Disable<//>
      <${Command} kind=${state.homed ? "" : "main"} disabled=${busy} act=${() => order({ op: "home", force: state.homed, reset })}>${state.homed ? "Home again" : "Home"}<//>
      <label class="check"><input type="checkbox" checked=${reset} onChange=${(e) => setReset(e.target.checked)} /> reset faults first</label>
    </div></section>
    <div class="moves">
      ${axes.map((axis, k) => html`<div key=${axis.name}>
        <${AxisCard} axis=${axis} number=${k} />
        <section class="panel"><h3>Steps of ${STEPS.find(([s]) => s === step)[1]}</h3>
          <div class="row pair">
            <${Command} kind="large" disabled=${!idle} act=${() => order({ op: "move", axis: axis.name, distance: -step })}>−${" "}${axis.name}<//>
            <${Command} kind="large" disabled=${!idle} act=${() => order({ op: "move", axis: axis.name, distance: step })}>+${" "}${axis.name}<//>
          </div>
          <h3>Hold to move</h3>
          <div class="row pair">
            <${Hold} axis=${axis.name} velocity=${-speed} disabled=${busy || !state.enabled} label=${`hold to move ${axis.name} in minus direction`}>◀ hold<//>
            <${Hold} axis=${axis.name} velocity=${speed} disabled=${busy || !state.enabled} label=${`hold to move ${axis.name} in plus direction`}>hold ▶<//>
          </div>
          <h3>To a position, or by a distance</h3>
          <${ByFigures} axis=${axis.name} idle=${idle} travel=${state.server.axes[k].travel} />
        </section>
      </div>`)}
      <div>
        <section class="panel"><${StageTable} /></section>
        <section class="panel"><h3>Step</h3><${Segments} label="Step" of=${STEPS} value=${step} choose=${setStep} />
          <h3>Speed while held</h3><${Segments} label="Speed while held" of=${SPEEDS} value=${speed} choose=${setSpeed} />
          <p class="note">An axis moves while its button is held, and stops when it is released, when this window is hidden or loses the focus, and when the connection is lost.</p></section>
      </div>
    </div>`;
}

function ByFigures({ axis, idle, travel }) {
  const [text, setText] = useState("");
  const value = Number(text.replace(",", ".")) * 1e-3;
  const known = text.trim() !== "" && Number.isFinite(value);
  const outside = known && (value < travel[0] || value > travel[1]);
  return html`<div class="row">
    <label><input class="short" inputmode="decimal" aria-label=${`figure for ${axis} in mm`} value=${text} onInput=${(e) => setText(e.target.value)} /> mm</label>
    <${Command} disabled=${!idle || !known || outside} act=${() => order({ op: "move", axis, position: value })}>Go to<//>
    <${Command} disabled=${!idle || !known} act=${() => order({ op: "move", axis, distance: value })}>Go by<//>
    ${outside ? html`<small class="bad">outside the travel, ${travel[0] * 1e3} to ${travel[1] * 1e3} mm</small>` : ""}
  </div>`;
}

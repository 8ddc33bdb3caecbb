// The scope: any signal over the last minute, with trigger, pause, cursors, zoom and export.
// Samples come at the SYNC rate; what is drawn is their minimum and maximum per pixel.

import { html, useEffect, useRef, useState, Segments } from "./parts.js";
import { watchSamples, store } from "./connection.js";
import { Ring } from "./samples.js";

const SIGNALS = { // name -> [label, unit, factor from SI, digits]
  error: ["Error", "nm", 1e9, 1], force: ["Force", "N", 1, 3], offset: ["Offset", "N", 1, 3],
  position: ["Position", "mm", 1e3, 6], demand: ["Demand", "mm", 1e3, 6], status: ["Status", "", 1, 0],
};
const WINDOWS = [[0.1, "0.1 s"], [0.5, "0.5 s"], [2, "2 s"], [10, "10 s"], [60, "60 s"]];
const ring = new Ring();

export function Scope({ axes, period }) {
  const [signals, setSignals] = useState(axes.map((axis) => axis + ".error"));
  const [width, setWidth] = useState(2);
  const [running, setRunning] = useState(true);
  const [trigger, setTrigger] = useState({ mode: "off", signal: axes[0] + ".error", edge: "rising", level: 100 });
  const [range, setRange] = useState(null);
  const [cursors, setCursors] = useState([]);
  const place = useRef();
  const live = useRef({});
  live.current = { ...live.current, signals, width, running, trigger, period, setRange, setRunning, setCursors, cursors };

  useEffect(() => {
    const view = live.current;
    view.shown = null;
    const plot = makePlot(place.current, signals, live);
    view.plot = plot;
    draw(live.current, true);
    const again = () => { plot.setSize({ width: place.current.clientWidth, height: 270 }); plot.redraw(); };
    addEventListener("resize", again);
    addEventListener("theme", again);
    return () => { removeEventListener("resize", again); removeEventListener("theme", again); plot.destroy(); };
  }, [signals.join(), axes.join()]);
  useEffect(() => {
    let pending = 0;
    const stop = watchSamples((buffer) => {
      ring.take(buffer);
      if (!pending) pending = requestAnimationFrame(() => { pending = 0; draw(live.current, false); });
    });
    return () => { stop(); cancelAnimationFrame(pending); };
  }, []);
  useEffect(() => { draw(live.current, true); }, [width, running, trigger]);
  useEffect(() => { live.current.plot.redraw(false); }, [cursors]);

  const toggle = (name) => setSignals(signals.includes(name) ? signals.filter((s) => s !== name) : [...signals, name].slice(-6));
  const pick = (part) => setTrigger({ ...trigger, ...part });
  const download = (kind) => {
    const [first, end] = range || [ring.first, ring.end];
    const link = document.createElement("a");
    link.href = `/api/scope.${kind}?first=${Math.max(0, Math.floor(first))}&count=${Math.ceil(end - first)}`;
    link.download = "scope." + kind;
    link.click();
  };
  return html`<section class="panel scope">
    <div class="row head"><h2>Scope</h2>
      <button type="button" class=${running ? "" : "main"} onClick=${() => setRunning(!running)}>${running ? "Pause" : "Go on"}</button>
      <${Segments} label="Time shown" of=${WINDOWS} value=${width} choose=${setWidth} />
      <label>Trigger <select value=${trigger.mode} onChange=${(e) => pick({ mode: e.target.value })}>
        <option value="off">off</option><option value="auto">auto</option><option value="normal">normal</option><option value="single">single</option></select></label>
      ${trigger.mode === "off" ? "" : html`
        <select aria-label="Signal of the trigger" value=${trigger.signal} onChange=${(e) => pick({ signal: e.target.value })}>
          ${axes.flatMap((axis) => Object.entries(SIGNALS).map(([name, [label]]) => html`<option key=${axis + name} value=${axis + "." + name}>${axis} ${label}</option>`))}</select>
        <select aria-label="Edge" value=${trigger.edge} onChange=${(e) => pick({ edge: e.target.value })}><option>rising</option><option>falling</option></select>
        <label>at <input type="number" step="any" class="short" value=${trigger.level} onChange=${(e) => pick({ level: Number(e.target.value) })} /> ${SIGNALS[trigger.signal.split(".")[1]][1]}</label>`}
      <span class="space"></span>
      <button type="button" onClick=${() => download("csv")}>CSV</button><button type="button" onClick=${() => download("h5")}>HDF5</button>
    </div>
    <div class="row chips">${axes.map((axis, k) => html`<span class="group" key=${axis}><b>${axis}</b>${Object.entries(SIGNALS).map(([name, [label]]) => html`
      <button type="button" key=${name} class="chip" data-axis-number=${k} aria-pressed=${String(signals.includes(axis + "." + name))} onClick=${() => toggle(axis + "." + name)}>${label}</button>`)}</span>`)}</div>
    <div class="plot" ref=${place}></div>
    <p class="note" id="cursors">${readout(cursors, period) || "Click to place two cursors. Drag to zoom in, double-click to zoom out."}</p>
  </section>`;
}

function readout(cursors, period) {
  if (!cursors.length) return "";
  const [a, b] = cursors;
  const values = (c) => c.values.map(([label, value]) => `${label} ${value}`).join(", ");
  if (!b) return `A: ${values(a)}`;
  const dt = (b.number - a.number) * period;
  return `A: ${values(a)} · B: ${values(b)} · B − A: ${(dt * 1e3).toFixed(1)} ms${dt ? `, ${Math.abs(1 / dt).toFixed(1)} Hz` : ""}`;
}

const rowOf = (name) => (store.state.columns || []).indexOf(name);
const DASHES = { offset: [6, 4], demand: [6, 4], force: [], error: [], position: [], status: [2, 3] };

function makePlot(element, signals, live) {
  const described = signals.map((name) => ({ name, axis: name.split(".")[0], kind: name.split(".")[1] }));
  const units = [...new Set(described.map(({ kind }) => SIGNALS[kind][1]))];
  const names = [...new Set((store.state.columns || []).slice(2).map((c) => c.split(".")[0]))];
  const [x, y] = page.axes("s", page.plainTicks);
  const series = described.map(({ axis, kind }) => {
    const [label, unit, , digits] = SIGNALS[kind];
    return {
      label: `${axis} ${label}${unit ? ", " + unit : ""}`, scale: unit || "1", width: 1.3, dash: DASHES[kind],
      stroke: () => page.css("--axis-" + (names.indexOf(axis) % 4)), points: { show: false }, spanGaps: false,
      value: (chart, v) => (v == null ? "–" : v.toFixed(digits)),
    };
  });
  const range = (chart, low, high) => {
    const pad = 0.08 * (high - low) || Math.max(Math.abs(high) * 0.1, 1e-6);
    return low == null ? [-1, 1] : [low - pad, high + pad];
  };
  const scales = { x: { time: false } };
  for (const unit of units) scales[unit || "1"] = { range };
  const chart = page.plot(element, {
    height: 270, scales, series: [{ label: "s", value: (c, v) => (v == null ? "–" : v.toFixed(4)) }, ...series],
    axes: [x, ...units.slice(0, 3).map((unit, k) => ({ ...y, scale: unit || "1", side: k === 0 ? 3 : 1, label: unit || "statusword", labelFont: y.font, labelSize: 20, grid: { ...y.grid, show: k === 0 } }))],
    cursor: { drag: { x: true, y: false }, focus: { prox: 24 } },
    hooks: {
      setSelect: [(c) => { // zooming stops the picture: it would run away
        if (c.select.width > 4) live.current.setRunning(false);
      }],
      ready: [(c) => c.over.addEventListener("click", () => placeCursor(c, described, live))],
      draw: [(c) => drawCursors(c, live.current)],
    },
  }, [[], ...signals.map(() => [])]);
  chart.over.addEventListener("dblclick", () => { live.current.setCursors([]); draw(live.current, true); });
  return chart;
}

function placeCursor(chart, described, live) {
  const view = live.current;
  if (!view.shown || chart.cursor.left < 0 || chart.select.width > 4) return;
  const number = Math.round(view.shown.zero + chart.posToVal(chart.cursor.left, "x") / view.period);
  if (number < ring.first || number >= ring.end) return;
  const values = described.map(({ name, axis, kind }) => {
    const [label, unit, factor, digits] = SIGNALS[kind], value = ring.at(rowOf(name), number) * factor;
    return [`${axis} ${label.toLowerCase()}`, value === value ? `${value.toFixed(digits)} ${unit}` : "missed"];
  });
  view.setCursors([...view.cursors, { number, values }].slice(view.cursors.length >= 2 ? -1 : 0));
}

function drawCursors(chart, view) {
  if (!view.shown) return;
  const { ctx, bbox } = chart;
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = page.css("--ink");
  ctx.setLineDash([4, 4]);
  ctx.font = `${13 * devicePixelRatio}px system-ui, sans-serif`;
  view.cursors.forEach(({ number }, k) => {
    const at = chart.valToPos((number - view.shown.zero) * view.period, "x", true);
    if (at < bbox.left || at > bbox.left + bbox.width) return;
    ctx.beginPath();
    ctx.moveTo(at, bbox.top);
    ctx.lineTo(at, bbox.top + bbox.height);
    ctx.stroke();
    ctx.fillText("AB"[k], at + 4, bbox.top + 14 * devicePixelRatio);
  });
  ctx.restore();
}

// The latest crossing of the trigger that has half a window on either side; else null.
function findTrigger({ signal, edge, level }, width) {
  const row = rowOf(signal);
  if (row < 0) return null;
  const factor = SIGNALS[signal.split(".")[1]][2], up = edge === "rising";
  for (let n = ring.end - Math.ceil(width / 2); n > ring.first + 1 && n > ring.end - 10 * width; n--) {
    const before = ring.at(row, n - 1) * factor, after = ring.at(row, n) * factor;
    if (up ? before < level && after >= level : before > level && after <= level) return n;
  }
  return null;
}

function draw(view, always) {
  const { plot, running, trigger, signals } = view;
  if (!plot || !ring.kept || (!running && !always && view.shown)) return;
  const count = Math.max(2, Math.round(view.width / view.period));
  let end = view.shown && !running ? view.shown.end : ring.end, zero = end;
  if (running && trigger.mode !== "off") {
    const at = findTrigger(trigger, count);
    if (at == null && trigger.mode !== "auto") return;
    if (at != null) {
      zero = at;
      end = Math.min(ring.end, at + Math.ceil(count / 2));
      if (trigger.mode === "single") view.setRunning(false);
    }
  }
  const first = Math.max(ring.first, end - count);
  const rows = signals.map(rowOf);
  if (rows.some((row) => row < 0)) return;
  const [numbers, found] = ring.decimated(rows, first, end, Math.max(200, plot.bbox.width / devicePixelRatio));
  view.shown = { first, end, zero };
  const scaled = found.map((values, k) => { const f = SIGNALS[signals[k].split(".")[1]][2]; return values.map((v) => (v == null ? null : v * f)); });
  plot.setData([numbers.map((n) => (n - zero) * view.period), ...scaled], false);
  plot.setScale("x", { min: (end - count - zero) * view.period, max: (end - zero) * view.period });
  view.setRange([first, end]);
}

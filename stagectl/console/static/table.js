// The stage's table from above: travel, path, sites and the position, in one SVG. x to the right, y up.

import { html } from "./parts.js";

const WORDS = { done: "done", passed: "passed", failed: "failed", current: "now", next: "next", waiting: "waiting" };

// A mark for each state of a site, distinguished by shape first.
function Mark({ state, x, y, r, title }) {
  const name = html`<title>${title}</title>`;
  const at = `translate(${x} ${y})`;
  if (state === "failed") return html`<g class="site failed" transform=${at}>${name}<rect x=${-r} y=${-r} width=${2 * r} height=${2 * r} rx=${0.3 * r} /><path d="M${-r * 0.5} ${-r * 0.5}L${r * 0.5} ${r * 0.5}M${-r * 0.5} ${r * 0.5}L${r * 0.5} ${-r * 0.5}" /></g>`;
  if (state === "done" || state === "passed") return html`<g class="site ${state}" transform=${at}>${name}<circle r=${r} /><path d="M${-r * 0.5} 0L${-r * 0.1} ${r * 0.42}L${r * 0.55} ${-r * 0.42}" /></g>`;
  if (state === "current") return html`<g class="site current" transform=${at}>${name}<circle r=${1.25 * r} /><circle class="dot" r=${0.5 * r} /></g>`;
  if (state === "next") return html`<g class="site next" transform=${at}>${name}<path d="M0 ${-1.2 * r}L${1.2 * r} 0L0 ${1.2 * r}L${-1.2 * r} 0Z" /></g>`;
  return html`<circle class="site waiting" cx=${x} cy=${y} r=${0.55 * r}>${name}</circle>`;
}

export function siteState(number, { site, done, failed, passed, total }) {
  if (failed && failed.has(number)) return "failed";
  if (passed && passed.has(number)) return "passed";
  if (number <= done) return "done";
  if (number === site) return "current";
  if (number === (site == null ? done + 1 : Math.max(site, done) + 1) && number <= total) return "next";
  return "waiting";
}

// travel: [[low, high], [low, high]] [m]; sites: [{x, y, state, text}] [m]; path: [[x, y]] [m].
export function Table({ travel, sites = [], path = [], position, axes, close = false }) {
  let [[x0, x1], [y0, y1]] = travel.map((pair) => pair.map((v) => v * 1e3));
  const xs = sites.map((s) => s.x * 1e3), ys = sites.map((s) => s.y * 1e3);
  if (close && sites.length > 1) { // the sites alone, for their values
    const pad = 0.12 * Math.max(Math.max(...xs) - Math.min(...xs), Math.max(...ys) - Math.min(...ys), 1);
    [x0, x1, y0, y1] = [Math.min(...xs) - pad, Math.max(...xs) + pad, Math.min(...ys) - 1.6 * pad, Math.max(...ys) + pad];
  }
  const w = x1 - x0, h = y1 - y0, size = Math.max(w, h), m = 0.055 * size;
  const spacing = nearest(sites);
  const r = Math.min(0.024 * size, Math.max(0.004 * size, 0.3 * spacing * 1e3));
  const X = (v) => v * 1e3 - x0, Y = (v) => y1 - v * 1e3;
  const font = 0.032 * size;
  return html`<svg class="table" viewBox="${-m * 1.6} ${-m * 0.6} ${w + 2.2 * m} ${h + 2.2 * m}" role="img" aria-label="The table from above">
    <rect class="travel" width=${w} height=${h} />
    ${ticks(x0, x1).map((t) => html`<g key=${"x" + t}><path class="grid" d="M${t - x0} 0V${h}" /><text x=${t - x0} y=${h + 1.25 * font} font-size=${font} text-anchor="middle">${t}</text></g>`)}
    ${ticks(y0, y1).map((t) => html`<g key=${"y" + t}><path class="grid" d="M0 ${y1 - t}H${w}" /><text x=${-0.4 * font} y=${y1 - t + 0.35 * font} font-size=${font} text-anchor="end">${t}</text></g>`)}
    <text x=${w - 0.4 * font} y=${h - 0.5 * font} font-size=${font} text-anchor="end">${axes[0]}, mm</text>
    <text x=${0.4 * font} y=${1.15 * font} font-size=${font}>${axes[1]}, mm</text>
    ${path.length > 1 ? html`<path class="path" d=${"M" + path.map(([a, b]) => X(a).toFixed(3) + " " + Y(b).toFixed(3)).join("L")} stroke-width=${0.0035 * size} />` : ""}
    ${sites.map((s, k) => html`<${Mark} key=${k} state=${s.state} x=${X(s.x)} y=${Y(s.y)} r=${r} title=${`site ${k + 1}: ${s.text || WORDS[s.state]}`} />`)}
    ${close ? sites.map((s, k) => s.label && html`<text key=${"l" + k} class="label" x=${X(s.x)} y=${Y(s.y) + 2.1 * r + 0.2 * font} font-size=${0.9 * font} text-anchor="middle">${s.label}</text>`) : ""}
    ${position && position[0] != null && position[1] != null ? html`<g class="here" transform="translate(${X(position[0])} ${Y(position[1])})">
      <path d="M${-0.045 * size} 0H${0.045 * size}M0 ${-0.045 * size}V${0.045 * size}" stroke-width=${0.006 * size} /><circle r=${0.014 * size} stroke-width=${0.005 * size} /></g>` : ""}
  </svg>`;
}

function ticks(low, high) {
  const raw = (high - low) / 5, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((f) => f * power).find((s) => s >= raw);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9; k++) found.push(+(k * step).toPrecision(6));
  return found;
}

function nearest(sites) {
  let best = Infinity;
  for (let k = 1; k < sites.length; k++) best = Math.min(best, Math.hypot(sites[k].x - sites[k - 1].x, sites[k].y - sites[k - 1].y) || Infinity);
  return best === Infinity ? 1 : best;
}

export function Key({ states }) {
  return html`<p class="key">${states.map((state) => html`<span key=${state}>
    <svg viewBox="-1.4 -1.4 2.8 2.8"><${Mark} state=${state} x=${0} y=${0} r=${1} title=${WORDS[state]} /></svg>${WORDS[state]}</span>`)}</p>`;
}

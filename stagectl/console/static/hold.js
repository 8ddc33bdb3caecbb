// Hold to move: an axis moves for as long as the button is held, by renewals that this page sends.
// Anything that could mean that nobody holds it any more ends the motion; so does silence, after 0.2 s.

import { html, commands, useEffect, useRef, useState } from "./parts.js";
import { ask, toast, watchLoss } from "./connection.js";

export const RENEWAL = 80; // ms

let held = null; // {axis, timer, show}: one at a time

export function begin(axis, velocity, show) {
  end();
  const send = (begins) => ask({ op: "jog", axis, velocity }, begins ? { begin: true } : {}).catch((why) => {
    if (held && held.axis === axis) { end(); toast(why.message); }
  });
  held = { axis, show, timer: setInterval(send, RENEWAL, false) };
  show(true);
  send(true);
}

export function end() {
  if (!held) return;
  const { axis, timer, show } = held;
  held = null;
  clearInterval(timer);
  show(false);
  ask({ op: "jog", axis, velocity: 0 }).catch(() => {});
}

document.addEventListener("visibilitychange", () => { if (document.hidden) end(); });
addEventListener("blur", end); // of the window: that of an element does not bubble
for (const event of ["pagehide", "pointerup", "pointercancel", "contextmenu", "freeze"]) addEventListener(event, end, true);
addEventListener("keydown", (event) => { if (event.key === "Escape") end(); }, true);
watchLoss(end);

export function Hold({ axis, velocity, children, disabled, label }) {
  const [active, show] = useState(false);
  const button = useRef();
  useEffect(() => end, []); // the page was left
  const press = (event) => {
    if (event.button !== 0 || !commands() || disabled) return;
    event.preventDefault();
    button.current.setPointerCapture(event.pointerId);
    begin(axis, velocity, show);
  };
  const key = (event) => {
    if ((event.key !== " " && event.key !== "Enter") || disabled) return;
    event.preventDefault();
    if (!event.repeat) begin(axis, velocity, show);
  };
  return html`<button type="button" ref=${button} class="hold ${active ? "active" : ""}" aria-label=${label}
    disabled=${!commands() || disabled} onPointerDown=${press} onLostPointerCapture=${end}
    onKeyDown=${key} onKeyUp=${end} onBlur=${end}>${children}</button>`;
}

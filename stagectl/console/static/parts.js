// What the pages have in common: the view library, and components that know the store.

import { html, render, useEffect, useMemo, useRef, useState } from "./vendor/preact-htm.module.js";
import { store, watch } from "./connection.js";

export { html, render, useEffect, useMemo, useRef, useState };

// Draws the component again whenever the store changes.
export function useStore() {
  const [, again] = useState(0);
  useEffect(() => watch(() => again((n) => n + 1)), []);
  return store;
}

export const commands = () => Boolean(store.state.me && store.state.me.commands);

// A control that moves the stage or changes the queue: only for whoever commands.
export function Command({ act, children, disabled, kind = "", ...more }) {
  const may = commands();
  return html`<button type="button" class=${kind} disabled=${!may || disabled} onClick=${act}
    title=${may ? "" : "Take command first"} ...${more}>${children}</button>`;
}

export function Badge({ tone, mark, children }) {
  return html`<span class="badge ${tone}">${mark ? html`<i aria-hidden="true">${mark}</i> ` : ""}${children}</span>`;
}

export function Facts({ of }) {
  return html`<dl class="facts">${of.filter(([, value]) => value != null && value !== "").map(([name, value]) => html`
    <div key=${name}><dt>${name}</dt><dd>${value}</dd></div>`)}</dl>`;
}

export function Segments({ of, value, choose, label }) {
  return html`<span class="segments" role="group" aria-label=${label}>${of.map(([key, text]) => html`
    <button type="button" key=${key} aria-pressed=${String(key === value)} onClick=${() => choose(key)}>${text}</button>`)}</span>`;
}

// Asks before what another operator would notice.
export function Confirm({ text, yes, act, close }) {
  const dialog = useRef();
  useEffect(() => { dialog.current.showModal(); }, []);
  return html`<dialog ref=${dialog} onClose=${close}>
    <p>${text}</p>
    <div class="row end">
      <button type="button" onClick=${() => dialog.current.close()}>Cancel</button>
      <button type="button" class="main" onClick=${() => { dialog.current.close(); act(); }}>${yes}</button>
    </div>
  </dialog>`;
}

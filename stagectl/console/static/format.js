// Values in words, with the units that operators read.

const signed = (text) => text.replace("-", "−");
export const mm = (metres, digits = 6) => (metres == null ? "–" : signed((metres * 1e3).toFixed(digits)));
export const nm = (metres) => {
  if (metres == null) return "–";
  const value = metres * 1e9;
  return signed(Math.abs(value) < 1e5 ? value.toFixed(Math.abs(value) < 100 ? 1 : 0) : value.toExponential(2));
};
export const newton = (value, digits = 2) => (value == null ? "–" : signed(value.toFixed(digits)));
export const ms = (seconds) => (seconds == null ? "–" : (seconds * 1e3).toFixed(seconds < 0.1 ? 1 : 0));

export function lasting(seconds) {
  if (seconds == null) return "–";
  const whole = Math.max(0, Math.round(seconds));
  if (whole < 60) return whole + " s";
  if (whole < 3600) return Math.floor(whole / 60) + " min " + String(whole % 60).padStart(2, "0") + " s";
  return Math.floor(whole / 3600) + " h " + String(Math.floor((whole % 3600) / 60)).padStart(2, "0") + " min";
}

export const clock = (time) => new Date(time * 1e3).toLocaleTimeString([], { hour12: false });
export const day = (iso) => (iso ? iso.slice(0, 16).replace("T", " ") : "–");

// State of the stage: word, mark and tone; never colour alone.
export const STATES = {
  starting: ["Starting", "◌", "busy"],
  off: ["Off", "○", "rest"],
  disabled: ["Disabled", "○", "rest"],
  booting: ["Booting", "◌", "busy"],
  homing: ["Homing", "⌂", "busy"],
  enabling: ["Enabling", "◌", "busy"],
  held: ["Held", "■", "good"],
  moving: ["Moving", "▶", "busy"],
  running: ["Running", "▶", "busy"],
  paused: ["Paused", "❚❚", "warning"],
  stopping: ["Stopping", "▼", "warning"],
  fault: ["Fault", "✕", "bad"],
};
export const NO_SERVER = ["No stage server", "◌", "warning"];
export const NOT_CONNECTED = ["Not connected", "✕", "bad"];

// What the charts of all pages share: style, zoom, the choice of a move, the theme. No network, no state.
"use strict";
const page = (() => {
  const root = document.documentElement;
  const find = (id) => document.getElementById(id);
  const css = (name) => getComputedStyle(root).getPropertyValue(name).trim();
  const FONT = "15px system-ui, 'Liberation Sans', sans-serif";
  const charts = new Map(); // element id -> the charts in it

  const number = (digits) => (chart, value) => (value == null ? "–" : value.toFixed(digits));

  // As wide as its longest figure: stiffnesses have seven digits, errors three.
  const yWidth = (chart, values) =>
    Math.max(76, 24 + 9 * Math.max(0, ...(values || []).map((value) => String(value).length)));

  function axes(xLabel, yValues, options = {}) {
    const common = {
      stroke: () => css("--soft"), font: FONT,
      grid: { stroke: () => css("--grid"), width: 1 }, ticks: { stroke: () => css("--line"), width: 1 },
    };
    return [
      { ...common, label: xLabel, labelFont: FONT, labelSize: 24, size: 34, ...options.x },
      { ...common, size: yWidth, values: yValues },
    ];
  }

  const plainTicks = (chart, ticks) => ticks.map((tick) => (tick == null ? "" : String(+tick.toPrecision(6))));

  function draw(id, build) {
    for (const chart of charts.get(id) || []) chart.destroy();
    charts.set(id, build(find(id)));
  }

  function plot(element, options, values) {
    const full = { width: Math.max(element.clientWidth, 300), padding: [12, 16, 0, 0], ...options };
    return new uPlot(full, values, element);
  }

  function segments(element, names, label, chosen, choose) {
    element.replaceChildren(...names.map((name) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = label(name);
      button.setAttribute("aria-pressed", String(name === chosen()));
      button.addEventListener("click", () => {
        choose(name);
        segments(element, names, label, chosen, choose);
      });
      return button;
    }));
  }

  // The select and the two buttons beside it; `show` is called with the number of the entry chosen.
  function chooser(names, first, show) {
    const select = find("move");
    const choose = (index) => {
      select.value = String((index + names.length) % names.length);
      show(Number(select.value));
    };
    names.forEach((name, i) => select.add(new Option(name, String(i))));
    select.value = String(first);
    select.addEventListener("change", () => show(Number(select.value)));
    find("previous").addEventListener("click", () => choose(Number(select.value) - 1));
    find("next").addEventListener("click", () => choose(Number(select.value) + 1));
  }

  // Draw everything: now, in another theme, at another width.
  function start(drawAll) {
    const theme = (name) => {
      root.dataset.theme = name;
      find("theme").textContent = name === "dark" ? "Light" : "Dark";
    };
    theme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
    find("theme").hidden = false;
    find("theme").addEventListener("click", () => {
      theme(root.dataset.theme === "dark" ? "light" : "dark");
      drawAll();
    });
    // Paper is light: the style sheets see to the rest, but a canvas keeps the colours it was drawn in.
    let onScreen = "light";
    addEventListener("beforeprint", () => {
      onScreen = root.dataset.theme;
      if (onScreen === "dark") { theme("light"); drawAll(); }
    });
    addEventListener("afterprint", () => {
      if (onScreen === "dark") { theme("dark"); drawAll(); }
    });
    drawAll();
    let pending = 0;
    addEventListener("resize", () => {
      cancelAnimationFrame(pending);
      pending = requestAnimationFrame(drawAll);
    });
  }

  return { find, css, number, axes, plainTicks, draw, plot, segments, chooser, start };
})();

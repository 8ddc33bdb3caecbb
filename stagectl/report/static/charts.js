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

  // Where a logarithmic axis has lines: at powers of ten, or at 1, 2 and 5.
  function logTicks(low, high) {
    const decades = Math.log10(high / low);
    const digits = decades < 2.7 ? [1, 2, 5] : [1];
    const ticks = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power++) {
      for (const digit of digits) ticks.push(digit * 10 ** power);
    }
    const every = Math.ceil(decades / 7);
    return ticks.filter((tick, i) => tick >= low * 0.999 && tick <= high * 1.001 && i % every === 0);
  }

  function range(values, log, zero) {
    const low = zero ? 0 : Math.min(...values), high = Math.max(...values);
    if (log) return [low / 1.2, high * 1.2];
    const pad = 0.06 * (high - low) || 1;
    return [zero ? 0 : low - pad, high + pad];
  }

  // Lines with bands, and points with bars, as one data set each: none needs the places of another.
  function paint(spec) {
    return (chart) => {
      const { ctx, bbox } = chart;
      const px = (v) => chart.valToPos(v, "x", true), py = (v) => chart.valToPos(v, "y", true);
      const path = (xs, ys) => xs.forEach((x, k) => ctx[k ? "lineTo" : "moveTo"](px(x), py(ys[k])));
      const dot = devicePixelRatio;
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      ctx.fillStyle = css("--band");
      for (const [a, b] of spec.shaded) ctx.fillRect(px(a), bbox.top, px(b) - px(a), bbox.height);
      for (const { name, x, y, low, high, line } of spec.curves) {
        ctx.fillStyle = ctx.strokeStyle = css("--" + name);
        if (line && low) {
          ctx.globalAlpha = 0.16;
          ctx.beginPath();
          path([...x, ...x.toReversed()], [...low, ...high.toReversed()]);
          ctx.fill();
          ctx.globalAlpha = 1;
        }
        ctx.setLineDash(name === "floor" || name === "map" ? [6 * dot, 5 * dot] : []);
        ctx.lineWidth = (name === "zero" ? 1 : 2) * dot;
        ctx.beginPath();
        if (line && x.length > 1) path(x, y);
        else x.forEach((_, k) => { if (low) path([x[k], x[k]], [low[k], high[k]]); });
        ctx.stroke();
        if (!line || x.length === 1) for (const k of x.keys()) {
          ctx.beginPath();
          ctx.arc(px(x[k]), py(y[k]), 3 * dot, 0, 7);
          ctx.fill();
        }
      }
      ctx.restore();
    };
  }

  // A chart whose data stand beside it in the page.
  function curves(element) {
    const spec = JSON.parse(element.querySelector("script").textContent);
    const [logX, logY] = ["x", "y"].map((axis) => spec.log.includes(axis));
    const xs = spec.curves.flatMap((curve) => curve.x), places = [...xs, ...spec.shaded.flat()];
    const ys = spec.curves.flatMap((curve) => [...curve.y, ...(curve.low || []), ...(curve.high || [])]);
    const first = Math.min(...xs), last = Math.max(...xs);
    const margin = logX || spec.curves.every((curve) => curve.line) ? 0 : 0.03 * (last - first) || 1;
    const whole = [Math.min(...places) - margin, Math.max(...places) + margin];
    const height = spec.range || range(ys, logY, spec.zero);
    const wide = (low, high) => low == null || (low <= first && high >= last);
    const log = (chart, axis, low, high) => logTicks(low, high);
    const utc = (chart, ticks) => ticks.map((tick) => new Date(1e3 * tick).toISOString().slice(5, 16).replace("T", " "));
    const [x, y] = axes(spec.x, plainTicks, { x: spec.time ? { values: utc, space: 120 } : {} });
    const facets = [{ scale: "x", auto: true }, { scale: "y", auto: true }];
    return plot(element, {
      mode: 2,
      height: 260,
      legend: { show: false },
      cursor: { y: false, points: { show: false }, dataIdx: () => null, drag: { x: true, y: false } },
      scales: {
        x: { time: false, distr: logX ? 3 : 1, range: (c, low, high) => (wide(low, high) ? whole : [low, high]) },
        y: { distr: logY ? 3 : 1, range: () => height },
      },
      axes: [
        logX ? { ...x, splits: log, filter: null, values: plainTicks } : x,
        { ...y, label: spec.y, labelFont: FONT, labelSize: 20, ...(logY ? { splits: log, filter: null } : {}) },
      ],
      series: [null, ...spec.curves.map(() => ({ facets, paths: () => null, points: { show: false } }))],
      hooks: { draw: [paint(spec)] },
    }, [null, ...spec.curves.map((curve) => [curve.x, curve.y])]);
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

  // Draw everything: now, in another theme, at another width, and what is unfolded.
  function start(drawOwn) {
    const placed = new Map();
    const drawAll = () => {
      for (const element of document.querySelectorAll(".curves")) {
        if (placed.has(element)) placed.get(element).destroy();
        if (element.clientWidth) placed.set(element, curves(element));
        else placed.delete(element);
      }
      drawOwn();
    };
    document.addEventListener("toggle", () => drawAll(), true);
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

// Draws the charts of the report from the data embedded in the page. No network, no state.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const root = document.documentElement;
  const find = (id) => document.getElementById(id);
  const css = (name) => getComputedStyle(root).getPropertyValue(name).trim();
  const axisColour = (axis) => css("--axis-" + (data.axes.indexOf(axis) % 4));
  const windowName = (key) => "±" + +(Number(key) * 1e9).toPrecision(6) + " nm";
  const FONT = "15px system-ui, 'Liberation Sans', sans-serif";
  const charts = new Map(); // element id -> the charts in it
  let shown = data.first;
  let zoom = data.moves.length ? firstZoom(data.moves[shown]) : "settle";
  let settlingKind = null;
  let settlingWindow = data.windows[0];

  const number = (digits) => (chart, value) => (value == null ? "–" : value.toFixed(digits));

  const micrometres = (metres) => {
    const value = metres * 1e6;
    const decimals = value > 0 ? Math.min(Math.max(0, 2 - Math.floor(Math.log10(value))), 9) : 0;
    return value.toFixed(decimals) + " µm";
  };

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

  // ---- one move ------------------------------------------------------------------------------

  function moveName(move) {
    const place = move.site == null ? "move " + move.number : "site " + move.site;
    return place + " · " + move.kind + (move.site == null ? "" : " (" + move.number + ")");
  }

  function settleLines(move) {
    return (chart) => {
      const { ctx, bbox } = chart;
      ctx.save();
      for (const [axis, time] of Object.entries(move.arrived)) {
        const x = Math.round(chart.valToPos(time, "x", true)) + (axis === data.axes[0] ? 0 : 2);
        if (x < bbox.left || x > bbox.left + bbox.width) continue;
        ctx.strokeStyle = axisColour(axis);
        ctx.lineWidth = 1.5 * devicePixelRatio;
        ctx.setLineDash([2, 4]);
        ctx.beginPath();
        ctx.moveTo(x, bbox.top);
        ctx.lineTo(x, bbox.top + bbox.height);
        ctx.stroke();
      }
      ctx.restore();
    };
  }

  function windowBands(chart) {
    const { ctx, bbox } = chart;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.fillStyle = css("--band");
    for (const key of data.windows) {
      const top = chart.valToPos(Number(key) * 1e9, "y", true);
      const bottom = chart.valToPos(-Number(key) * 1e9, "y", true);
      ctx.fillRect(bbox.left, top, bbox.width, bottom - top);
    }
    ctx.restore();
  }

  function errorRange(chart, low, high) {
    const least = Math.max(...data.windows.map(Number), 5e-8) * 1e9 * 1.5;
    if (zoom === "settle") return [-least, least];
    if (low == null) return [-least, least];
    const span = Math.max(high - low, least / 5);
    return [low - 0.08 * span, high + 0.08 * span];
  }

  function times(move) {
    const count = move.error[data.axes[0]].length;
    return Array.from({ length: count }, (_, k) => +(move.start + k * move.step).toFixed(6));
  }

  function moveCharts() {
    const move = data.moves[shown];
    const x = times(move);
    const sync = { key: "move", scales: ["x", null] };
    const facts = Object.entries(move.entries).map(([axis, entry]) => {
      const settling = data.windows.map((key) => windowName(key) + " in " + entry.times[key] + " ms").join(", ");
      const peak = entry.peak == null ? "unknown" : micrometres(entry.peak);
      return axis + ": " + micrometres(entry.distance) + ", peak error " + peak + ", " + settling +
        (entry.settled ? "" : ", not settled");
    });
    find("move-facts").textContent = facts.join(" — ");
    draw("error", (element) => [plot(element, {
      height: 380,
      scales: { x: { time: false }, y: { range: errorRange } },
      cursor: { sync },
      axes: axes("ms", plainTicks),
      series: [{ label: "ms", value: number(1) }, ...data.axes.map((axis) => ({
        label: axis + " error", stroke: () => axisColour(axis), width: 2, value: number(1), points: { show: false },
      }))],
      hooks: { drawClear: [windowBands], draw: [settleLines(move)] },
    }, [x, ...data.axes.map((axis) => move.error[axis])])]);
    draw("force", (element) => [plot(element, {
      height: 320,
      scales: { x: { time: false } },
      cursor: { sync },
      axes: axes("ms", plainTicks),
      series: [{ label: "ms", value: number(1) }, ...data.axes.flatMap((axis) => [
        { label: axis + " measured", stroke: () => axisColour(axis), width: 2, value: number(2), points: { show: false } },
        { label: axis + " offset", stroke: () => axisColour(axis), width: 1.5, dash: [6, 5], value: number(2), points: { show: false } },
      ])],
      hooks: { draw: [settleLines(move)] },
    }, [x, ...data.axes.flatMap((axis) => [move.force[axis], move.offset[axis]])])]);
  }

  // Close up where that still shows the motion; else the whole error, the close-up a click away.
  function firstZoom(move) {
    const peaks = Object.values(move.entries).map((entry) => entry.peak || 0);
    return Math.max(0, ...peaks) <= 2 * Math.max(...data.windows.map(Number)) ? "settle" : "whole";
  }

  function showMove(index) {
    shown = (index + data.moves.length) % data.moves.length;
    find("move").value = String(shown);
    moveCharts();
  }

  // ---- settling over sites -------------------------------------------------------------------

  const points = (axis, hollow) => ({
    show: true, size: hollow ? 11 : 9, width: 2, stroke: () => axisColour(axis),
    fill: () => (hollow ? "transparent" : axisColour(axis)),
  });

  // Crosses through the points of the series that are marked so.
  function crosses(marked) {
    return (chart) => {
      const { ctx, bbox } = chart;
      const half = 5 * devicePixelRatio;
      ctx.save();
      ctx.lineWidth = 2 * devicePixelRatio;
      for (const [series, axis] of marked) {
        if (!chart.series[series].show) continue;
        ctx.strokeStyle = axisColour(axis);
        chart.data[series].forEach((value, k) => {
          if (value == null) return;
          const x = chart.valToPos(chart.data[0][k], "x", true);
          // One that lies outside the range stands at its edge.
          const y = Math.min(Math.max(chart.valToPos(value, "y", true), bbox.top + half), bbox.top + bbox.height - half);
          ctx.beginPath();
          ctx.moveTo(x - half, y - half); ctx.lineTo(x + half, y + half);
          ctx.moveTo(x - half, y + half); ctx.lineTo(x + half, y - half);
          ctx.stroke();
        });
      }
      ctx.restore();
    };
  }

  // One row per entry: two series an axis, the second for those marked (not settled, refused).
  // Axes stand side by side at their place.
  function scatter(entries, place, value, marked) {
    const side = (axis) => (data.axes.indexOf(axis) - (data.axes.length - 1) / 2) * 0.24;
    const rows = entries.map((entry) => ({ x: place(entry) + side(entry.axis), entry }));
    rows.sort((a, b) => a.x - b.x);
    const columns = [rows.map((row) => row.x)];
    for (const axis of data.axes) {
      for (const hollow of [false, true]) {
        columns.push(rows.map(({ entry }) =>
          entry.axis === axis && marked(entry) === hollow ? value(entry) : null));
      }
    }
    return { rows, columns };
  }

  function scatterSeries(goodName, badName, digits) {
    const none = () => null;
    return [{ label: data.placeName, value: (chart, v) => (v == null ? "–" : String(Math.round(v))) },
      ...data.axes.flatMap((axis) => [
        { label: axis + goodName, stroke: () => axisColour(axis), width: 2, paths: none, points: points(axis, false), value: number(digits) },
        { label: axis + badName, stroke: () => axisColour(axis), width: 2, paths: none, points: { show: false }, value: number(digits) },
      ])];
  }

  const hollowSeries = () => data.axes.map((axis, i) => [2 * i + 2, axis]);
  const wholeTicks = { x: { incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000], values: (chart, ticks) => ticks.map((t) => (Number.isInteger(t) ? t : "")) } };

  function settlingChart() {
    const entries = data.settling.filter((entry) => entry.kind === settlingKind);
    const { columns } = scatter(entries, (e) => e.place, (e) => e.times[settlingWindow], (e) => e.outside.includes(settlingWindow));
    draw("settling", (element) => [plot(element, {
      height: 380,
      scales: {
        x: { time: false, range: (c, low, high) => [low - 0.6, high + 0.6] },
        y: { range: (c, low, high) => [-0.03 * Math.max(high || 0, 5), Math.max(high || 0, 5) * 1.08] },
      },
      axes: axes(data.placeName, plainTicks, wholeTicks),
      series: scatterSeries(" settled", " not settled", 1),
      hooks: { draw: [crosses(hollowSeries())] },
    }, columns)]);
  }

  // ---- friction over sites -------------------------------------------------------------------

  function sigmaBars(rows, name) {
    return (chart) => {
      const { ctx, bbox } = chart;
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      ctx.lineWidth = 2 * devicePixelRatio;
      for (const { x, entry } of rows) {
        const figure = entry.parameters[name];
        if (figure.value == null || figure.sigma == null) continue;
        const at = chart.valToPos(x, "x", true);
        ctx.strokeStyle = axisColour(entry.axis);
        ctx.beginPath();
        ctx.moveTo(at, chart.valToPos(figure.value - figure.sigma, "y", true));
        ctx.lineTo(at, chart.valToPos(figure.value + figure.sigma, "y", true));
        ctx.stroke();
      }
      ctx.restore();
    };
  }

  // Accepted figures set the range: a refused one may be anywhere.
  function frictionRange(entries, name) {
    const accepted = entries.filter((entry) => entry.accepted);
    const ends = (accepted.length ? accepted : entries).flatMap((entry) => {
      const { value, sigma } = entry.parameters[name];
      return value == null ? [] : [value - (sigma || 0), value + (sigma || 0)];
    });
    if (!ends.length) return [0, 1];
    const low = Math.min(...ends), high = Math.max(...ends);
    const pad = Math.max(0.1 * (high - low), 0.02 * Math.abs(high), 1e-9);
    return [low - pad, high + pad];
  }

  function frictionCharts() {
    const names = [...new Set(data.friction.flatMap((entry) => Object.keys(entry.parameters)))];
    draw("friction", (container) => {
      // All figures first: a chart takes the width its place has once every column is there.
      const figures = names.map((name) => {
        const figure = document.createElement("div");
        const title = document.createElement("h3");
        const unit = data.friction.find((entry) => entry.parameters[name]).parameters[name].unit;
        title.textContent = name.replaceAll("_", " ") + ", " + unit;
        figure.append(title);
        return figure;
      });
      container.replaceChildren(...figures);
      return names.map((name, i) => {
        const entries = data.friction.filter((entry) => entry.parameters[name]);
        const { rows, columns } = scatter(
          entries, (e) => e.place, (e) => e.parameters[name].value, (e) => !e.accepted);
        const figure = figures[i];
        const range = frictionRange(entries, name);
        return plot(figure, {
          height: 300,
          scales: { x: { time: false, range: (c, low, high) => [low - 0.6, high + 0.6] }, y: { range: () => range } },
          axes: axes(data.estimateName, plainTicks, wholeTicks),
          series: scatterSeries("", " refused", 3).map((s, i) => (i ? s : { ...s, label: data.estimateName })),
          hooks: { draw: [sigmaBars(rows, name), crosses(hollowSeries())] },
        }, columns);
      });
    });
  }

  // ---- page ----------------------------------------------------------------------------------

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

  function drawAll() {
    for (const key of document.querySelectorAll(".key")) key.style.background = axisColour(key.dataset.axis);
    if (data.moves.length) { moveCharts(); settlingChart(); }
    if (find("friction")) frictionCharts();
  }

  function theme(name) {
    root.dataset.theme = name;
    find("theme").textContent = name === "dark" ? "Light" : "Dark";
  }

  theme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
  find("theme").hidden = false;
  find("theme").addEventListener("click", () => {
    theme(root.dataset.theme === "dark" ? "light" : "dark");
    drawAll();
  });

  if (data.moves.length) {
    const select = find("move");
    data.moves.forEach((move, i) => select.add(new Option(moveName(move), String(i))));
    select.value = String(shown);
    select.addEventListener("change", () => showMove(Number(select.value)));
    find("previous").addEventListener("click", () => showMove(shown - 1));
    find("next").addEventListener("click", () => showMove(shown + 1));
    segments(document.querySelector("[aria-label='range of the error']"), ["whole", "settle"],
      (name) => (name === "whole" ? "Whole error" : "Settling"), () => zoom,
      (name) => { zoom = name; moveCharts(); });
    if (data.left_out) {
      find("left-out").textContent = data.left_out + " quicker moves of this long run are not drawn.";
    }
    const kinds = [...new Set(data.settling.map((entry) => entry.kind))];
    settlingKind = kinds.includes("micro") ? "micro" : kinds[0];
    segments(find("settling-kind"), kinds, (name) => name + "-moves", () => settlingKind,
      (name) => { settlingKind = name; settlingChart(); });
    segments(find("settling-window"), data.windows, windowName, () => settlingWindow,
      (name) => { settlingWindow = name; settlingChart(); });
  }
  drawAll();

  let pending = 0;
  addEventListener("resize", () => {
    cancelAnimationFrame(pending);
    pending = requestAnimationFrame(drawAll);
  });
})();

// Draws the charts of a run's report from the data embedded in the page, by the parts of charts.js.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const { find, css, number, axes, plainTicks, draw, plot, segments } = page;
  const axisColour = (axis) => css("--axis-" + (data.axes.indexOf(axis) % 4));
  const windowName = (key) => "±" + +(Number(key) * 1e9).toPrecision(6) + " nm";
  let shown = data.first;
  let zoom = data.moves.length ? firstZoom(data.moves[shown]) : "settle";
  let settlingKind = null;
  let settlingWindow = data.windows[0];

  const micrometres = (metres) => {
    const value = metres * 1e6;
    const decimals = value > 0 ? Math.min(Math.max(0, 2 - Math.floor(Math.log10(value))), 9) : 0;
    return value.toFixed(decimals) + " µm";
  };

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

  // One row per entry: two series per axis, the second for those marked (not settled, refused).
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
    return columns;
  }

  // The place, then two series an axis: `good` as points, `bad` for the crosses.
  function scatterSeries(place, shownAxes, good, bad, value) {
    const none = () => null;
    return [{ label: place, value: (chart, v) => (v == null ? "–" : String(Math.round(v))) },
      ...shownAxes.flatMap((axis) => [
        { label: axis + good, stroke: () => axisColour(axis), width: 2, paths: none, points: points(axis, false), value },
        { label: axis + bad, stroke: () => axisColour(axis), width: 2, paths: none, points: { show: false }, value },
      ])];
  }

  const hollowSeries = () => data.axes.map((axis, i) => [2 * i + 2, axis]);
  const wholeTicks = { x: { incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000], values: (chart, ticks) => ticks.map((t) => (Number.isInteger(t) ? t : "")) } };

  function settlingChart() {
    const entries = data.settling.filter((entry) => entry.kind === settlingKind);
    const columns = scatter(entries, (e) => e.place, (e) => e.times[settlingWindow], (e) => e.outside.includes(settlingWindow));
    draw("settling", (element) => [plot(element, {
      height: 380,
      scales: {
        x: { time: false, range: (c, low, high) => [low - 0.6, high + 0.6] },
        y: { range: (c, low, high) => [-0.03 * Math.max(high || 0, 5), Math.max(high || 0, 5) * 1.08] },
      },
      axes: axes(data.placeName, plainTicks, wholeTicks),
      series: scatterSeries(data.placeName, data.axes, " settled", " not settled", number(1)),
      hooks: { draw: [crosses(hollowSeries())] },
    }, columns)]);
  }

  // ---- friction over sites -------------------------------------------------------------------

  // What is known of one figure of one axis: a bar of ±1 sigma an estimate, a cross where it was
  // refused. What leaves the scale is clipped and ends in an arrow.
  function estimates(panel) {
    return (chart) => {
      const { ctx, bbox } = chart;
      const top = bbox.top, bottom = bbox.top + bbox.height, tip = 6 * devicePixelRatio;
      const at = (value) => chart.valToPos(value, "y", true);
      const arrow = (x, edge, inward) => {
        ctx.beginPath();
        ctx.moveTo(x, edge);
        ctx.lineTo(x - tip, edge + 1.6 * inward * tip);
        ctx.lineTo(x + tip, edge + 1.6 * inward * tip);
        ctx.fill();
      };
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = axisColour(panel.axis);
      ctx.lineWidth = 2 * devicePixelRatio;
      for (const { place, value, sigma, accepted } of panel.points) {
        if (value == null) continue;
        const x = chart.valToPos(place, "x", true);
        if (x < bbox.left || x > bbox.left + bbox.width) continue;
        const high = at(value + (sigma || 0)), low = at(value - (sigma || 0));
        if (low > top && high < bottom) {
          ctx.beginPath();
          ctx.moveTo(x, Math.max(high, top));
          ctx.lineTo(x, Math.min(low, bottom));
          ctx.stroke();
        }
        // A refused estimate outside the scale is drawn as a cross at the edge, without an arrow.
        if (high < top && (accepted || low > top)) arrow(x, top, 1);
        if (low > bottom && (accepted || high < bottom)) arrow(x, bottom, -1);
      }
      ctx.restore();
    };
  }

  // As many digits as one sigma has a say in, and one more.
  function known(point) {
    if (point == null || point.value == null) return "–";
    const finest = point.sigma || 1e-3 * Math.abs(point.value) || 1;
    const decimals = Math.min(Math.max(0, 1 - Math.floor(Math.log10(finest))), 9);
    const sigma = point.sigma == null ? "" : " ± " + point.sigma.toFixed(decimals);
    return point.value.toFixed(decimals) + sigma;
  }

  function frictionChart(panel, element) {
    const column = (accepted) => panel.points.map((p) => (p.accepted === accepted ? p.value : null));
    const shownValue = (chart, value, series, k) => known(value == null ? null : panel.points[k]);
    return plot(element, {
      height: 240,
      scales: { x: { time: false, range: (c, low, high) => [low - 0.6, high + 0.6] }, y: { range: () => [panel.low, panel.high] } },
      axes: axes(data.estimateName, plainTicks, wholeTicks),
      series: scatterSeries(data.estimateName, [panel.axis], "", " refused", shownValue),
      hooks: { draw: [estimates(panel), crosses([[2, panel.axis]])] },
    }, [panel.points.map((p) => p.place), column(true), column(false)]);
  }

  // The axes of a figure in a row, each on its own scale; with one axis the figures follow on.
  function frictionCharts() {
    const names = [...new Set(data.friction.map((panel) => panel.name))];
    draw("friction", (container) => {
      // All places first: a chart takes the width its place has once every column is there.
      const places = new Map();
      const rows = (data.axes.length > 1 ? names : [null]).map((name) => {
        const row = document.createElement("div");
        row.className = "multiples";
        for (const panel of data.friction.filter((p) => name == null || p.name === name)) {
          const place = document.createElement("div");
          const title = document.createElement("h3");
          title.textContent = panel.axis + " " + panel.name.replaceAll("_", " ") + ", " + panel.unit;
          place.append(title);
          row.append(place);
          places.set(panel, place);
        }
        return row;
      });
      container.replaceChildren(...rows);
      return data.friction.map((panel) => frictionChart(panel, places.get(panel)));
    });
  }

  // ---- page ----------------------------------------------------------------------------------

  function drawAll() {
    for (const cell of document.querySelectorAll("td[data-axis]")) cell.style.boxShadow = "inset 5px 0 " + axisColour(cell.dataset.axis);
    if (data.moves.length) { moveCharts(); settlingChart(); }
    if (find("friction")) frictionCharts();
  }

  if (data.moves.length) {
    page.chooser(data.moves.map(moveName), shown, (index) => { shown = index; moveCharts(); });
    segments(document.querySelector("[aria-label='range of the error']"), ["whole", "settle"],
      (name) => (name === "whole" ? "Whole error" : "Settling"), () => zoom,
      (name) => { zoom = name; moveCharts(); });
    if (data.left_out) {
      find("left-out").textContent = data.left_out + " faster moves of this long run are not drawn.";
    }
    const kinds = [...new Set(data.settling.map((entry) => entry.kind))];
    settlingKind = kinds.includes("micro") ? "micro" : kinds[0];
    segments(find("settling-kind"), kinds, (name) => name + "-moves", () => settlingKind,
      (name) => { settlingKind = name; settlingChart(); });
    segments(find("settling-window"), data.windows, windowName, () => settlingWindow,
      (name) => { settlingWindow = name; settlingChart(); });
  }
  page.start(drawAll);
})();

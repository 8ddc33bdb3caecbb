// Draws the charts of single moves on the page of a gap diagnosis, by the parts of charts.js.
"use strict";
(() => {
  const data = JSON.parse(page.find("data").textContent);
  const { find, css, number, axes, plainTicks, draw, plot, segments } = page;
  let shown = data.first;
  let axis = data.axis;

  function moveName(move) {
    const place = move.site == null ? "move " + move.number : "site " + move.site + " (move " + move.number + ")";
    return (move.source ? move.source + ": " : "") + place + " · " + move.kind;
  }

  // A series is stored as differences, in whole steps.
  function values(series, kind) {
    let sum = 0;
    const unpacked = series[kind].map((difference) => (sum += difference) * series.step);
    if (kind === "measured") for (const k of series.missed || []) unpacked[k] = null;
    return unpacked;
  }

  const line = (kind, label) => ({
    label, stroke: () => css("--" + kind), width: kind === "measured" ? 2.4 : 1.8, points: { show: false },
  });

  // Measured and simulated in one chart, what is left in the other, all with one zoom.
  function pair(id, series, unit, digits) {
    for (const place of find(id).querySelectorAll(".unit")) place.textContent = unit;
    const move = data.moves[shown];
    const kinds = data.kinds.filter((kind) => kind in series);
    const measured = values(series, "measured");
    const models = kinds.map((kind) => values(series, kind));
    const x = measured.map((_, k) => +(move.start + k * move.step).toFixed(6));
    const left = models.map((model) => model.map((value, k) => (measured[k] == null ? null : measured[k] - value)));
    const options = {
      height: 300,
      scales: { x: { time: false } },
      cursor: { sync: { key: "move", scales: ["x", null] } },
      axes: axes("ms", plainTicks),
    };
    const shownAs = (kind, label) => ({ ...line(kind, label), value: number(digits) });
    const ms = { label: "ms", value: number(1) };
    draw(id, (element) => {
      const [whole, rest] = element.querySelectorAll("div.chart");
      return [
        plot(whole, { ...options, series: [ms, shownAs("measured", "measured"), ...kinds.map((kind) => shownAs(kind, kind))] },
          [x, measured, ...models]),
        plot(rest, { ...options, series: [ms, ...kinds.map((kind) => shownAs(kind, "measured − " + kind))] }, [x, ...left]),
      ];
    });
  }

  function moveCharts() {
    const move = data.moves[shown];
    find("move-facts").textContent = "Travel: " + Object.entries(move.stroke)
      .map(([name, distance]) => name + " " + +distance.toPrecision(4) + " " + data.units[name].stroke).join(", ");
    const units = data.units[axis];
    pair("move-force", move.axes[axis].force, units.force, 2);
    // Without a demand there is no following error.
    find("move-error").hidden = !("error" in move.axes[axis]);
    if ("error" in move.axes[axis]) pair("move-error", move.axes[axis].error, units.error, 3);
  }

  function drawAll() {
    if (data.moves.length) moveCharts();
  }

  if (data.moves.length) {
    page.chooser(data.moves.map(moveName), shown, (index) => { shown = index; moveCharts(); });
    segments(find("move-axis"), data.axes, (name) => "Axis " + name, () => axis, (name) => { axis = name; moveCharts(); });
  }
  page.start(drawAll);
})();

// Draws the charts one after the other when the page has been laid out, so that it can be read before all of them are there.

const charts = JSON.parse(document.getElementById("charts").textContent);
const { times, curves } = JSON.parse(document.getElementById("curves-data").textContent);

function save(name, type, text) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}

function csvOf(traces) {
  const quoted = (value) => (typeof value === "string" ? `"${value.replaceAll('"', '""')}"` : value ?? "");
  const rows = [["series", "x", "y", "value"]];
  for (const trace of traces) {
    if (trace.type === "heatmap") trace.y.forEach((row, i) => trace.x.forEach((x, j) => rows.push([row, x, "", trace.z[i][j]])));
    else if (trace.base) trace.y.forEach((row, i) => rows.push([row, trace.base[i], trace.customdata[i], trace.name]));
    else trace.x.forEach((x, i) => rows.push([trace.name, x, trace.y[i], ""]));
  }
  return rows.map((row) => row.map(quoted).join(",")).join("\n") + "\n";
}

function options(key, traces) {
  const csv = { name: "csv", title: "Save the data as CSV", icon: Plotly.Icons.disk,
    click: () => save(`${key}.csv`, "text/csv", csvOf(traces)) };
  return { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
    modeBarButtonsToAdd: [csv], toImageButtonOptions: { filename: key, format: "svg" } };
}

function drawChart(element) {
  const { data, layout } = charts[element.dataset.chart];
  return Plotly.newPlot(element, data, layout, options(element.dataset.chart, data));
}

function drawCurve(curve) {
  const n = curve.panels.length;
  const axis = { gridcolor: "#e8ecef", zeroline: false, linecolor: "#b8c1c8", ticks: "outside" };
  const layout = { height: n === 1 ? 340 : 160 + 150 * n, margin: { l: 60, r: 12, t: 30, b: 44 }, hovermode: "x unified",
    font: { family: "system-ui, Segoe UI, Roboto, DejaVu Sans, sans-serif", size: 12, color: "#1d2730" },
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 }, showlegend: true,
    xaxis: { ...axis, title: { text: "time since image 0 [s]" }, anchor: n === 1 ? "y" : `y${n}` } };
  const data = [];
  curve.panels.forEach((panel, i) => {
    const suffix = i === 0 ? "" : String(i + 1);
    const gap = 0.05;
    const share = (1 - gap * (n - 1)) / n;
    const low = 1 - (i + 1) * share - i * gap;
    layout[`yaxis${suffix}`] = { ...axis, domain: [Math.max(low, 0), low + share],
      title: { text: `${panel.title || curve.name} [${curve.unit}]` } };
    for (const line of panel.lines) {
      data.push({ ...line, x: times[line.x], yaxis: `y${suffix}`, legendgroup: line.legendgroup || line.name, showlegend: i === 0 && line.fill === undefined });
    }
  });
  if (curve.filter.length) {
    layout.margin.b += 16 + 12 * curve.filter.length;
    layout.annotations = [{ xref: "paper", yref: "paper", x: 0, y: 0, xshift: -54, yshift: -56, text: curve.filter.join("<br>"),
      showarrow: false, align: "left", xanchor: "left", yanchor: "top", font: { size: 10, color: "#777777" } }];
  }
  const name = `${curve.group} ${curve.name}`.replaceAll(" ", "_");
  return Plotly.react("curve", data, layout, options(name, data));
}

// Two lists: the groups of curves, and what is in the chosen one
function fillCurves() {
  const group = document.getElementById("curve-group");
  const select = document.getElementById("curve-choice");
  for (const name of new Set(curves.map((curve) => curve.group))) group.append(new Option(name));
  const show = () => drawCurve(curves[Number(select.value)]);
  const fill = () => {
    select.replaceChildren();
    curves.forEach((curve, i) => { if (curve.group === group.value) select.append(new Option(curve.name, String(i))); });
  };
  group.addEventListener("change", () => { fill(); show(); });
  select.addEventListener("change", show);
  const step = (by) => {
    const next = (Number(select.value) + by + curves.length) % curves.length;
    if (curves[next].group !== group.value) { group.value = curves[next].group; fill(); }
    select.value = String(next);
    show();
  };
  document.getElementById("curve-before").addEventListener("click", () => step(-1));
  document.getElementById("curve-after").addEventListener("click", () => step(1));
  fill();
  return show();
}

// On paper charts are as wide as the page, not as the window
const PAPER_PX = 700;
const drawn = () => document.querySelectorAll(".js-plotly-plot");
addEventListener("beforeprint", () => drawn().forEach((chart) => Plotly.relayout(chart, { autosize: false, width: PAPER_PX })));
addEventListener("afterprint", () => drawn().forEach((chart) => Plotly.relayout(chart, { autosize: true, width: null })));

const pause = () => new Promise((resolve) => setTimeout(resolve, 0));

async function drawAll() {
  drawScenes();
  for (const element of document.querySelectorAll("[data-chart]")) {
    await drawChart(element);
    await pause();
  }
  if (curves.length) await fillCurves();
  document.documentElement.dataset.drawn = String(Math.round(performance.now()));
}

drawAll();

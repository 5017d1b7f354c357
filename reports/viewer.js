// The page's behaviour: synchronised close-ups, the error maps, the charts in the colours of the theme, and the table.
// Plain functions over the DOM; without this script the pictures and tables can still be read.
"use strict";

const CLOSEUP = { width: 256, height: 128 };

function startViewer(viewer) {
  const frames = [...viewer.querySelectorAll(".frame")];
  if (!frames.length) return;
  const state = { mode: "picture", zoom: 8, x: Number(viewer.dataset.left) + 16, y: Number(viewer.dataset.top) + 8 };

  const shownImage = (frame) => {
    const heat = frame.querySelector(".heat");
    return state.mode === "heat" && heat ? heat : frame.querySelector(".picture");
  };

  function drawFrame(frame) {
    const image = shownImage(frame);
    for (const other of frame.querySelectorAll("img")) other.hidden = other !== image;
    const [w, h] = [image.naturalWidth, image.naturalHeight];
    if (!w) return;
    const width = Math.min(CLOSEUP.width / state.zoom, w);
    const height = Math.min(CLOSEUP.height / state.zoom, h);
    const left = Math.round(Math.min(Math.max(state.x - width / 2, 0), w - width));
    const top = Math.round(Math.min(Math.max(state.y - height / 2, 0), h - height));
    const marker = frame.querySelector(".marker");
    marker.hidden = false;
    Object.assign(marker.style, {
      left: `${(100 * left) / w}%`, top: `${(100 * top) / h}%`,
      width: `${(100 * width) / w}%`, height: `${(100 * height) / h}%`,
    });
    const canvas = frame.parentElement.querySelector(".closeup");
    const context = canvas.getContext("2d");
    context.imageSmoothingEnabled = false;
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(image, left, top, width, height, 0, 0, width * state.zoom, height * state.zoom);
  }

  const draw = () => frames.forEach(drawFrame);

  function moveTo(frame, event) {
    const box = frame.getBoundingClientRect();
    const image = shownImage(frame);
    state.x = ((event.clientX - box.left) / box.width) * image.naturalWidth;
    state.y = ((event.clientY - box.top) / box.height) * image.naturalHeight;
    draw();
  }

  for (const frame of frames) {
    for (const image of frame.querySelectorAll("img")) image.addEventListener("load", () => drawFrame(frame));
    frame.addEventListener("click", (event) => moveTo(frame, event));
    frame.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "mouse") frame.setPointerCapture(event.pointerId);
    });
    frame.addEventListener("pointermove", (event) => {
      if (frame.hasPointerCapture(event.pointerId)) moveTo(frame, event);
    });
    frame.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (!step) return;
      event.preventDefault();
      const image = shownImage(frame);
      state.x = Math.min(Math.max(state.x + step[0] * 2, 0), image.naturalWidth);
      state.y = Math.min(Math.max(state.y + step[1] * 2, 0), image.naturalHeight);
      draw();
    });
  }

  function connect(name, read) {
    const buttons = [...viewer.querySelectorAll(`[data-${name}]`)];
    for (const button of buttons) {
      button.addEventListener("click", () => {
        state[name] = read(button.dataset[name]);
        for (const b of buttons) b.setAttribute("aria-pressed", String(b === button));
        viewer.querySelector("[data-scale]")?.classList.toggle("shown", state.mode === "heat");
        draw();
      });
    }
  }
  connect("mode", String);
  connect("zoom", Number);
  draw();
}

function themed(figure, narrow) {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  const { data, layout } = structuredClone(figure);
  for (const trace of data) {
    const own = colour(trace.meta);
    trace.line = { ...trace.line, color: own };
    if (!trace.marker) continue;
    trace.marker.color = own;
    trace.marker.line.color = own;
    trace.error_x.color = own;
    trace.textfont.color = colour("text");
    if (narrow) trace.mode = "markers";
  }
  for (const axis of [layout.xaxis, layout.yaxis]) {
    Object.assign(axis, { gridcolor: colour("line"), linecolor: colour("line"), fixedrange: narrow, ticks: "" });
  }
  for (const shape of layout.shapes || []) shape.line.color = colour("soft");
  Object.assign(layout, {
    autosize: true, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: colour("text"), family: getComputedStyle(document.body).fontFamily, size: 13 },
    hoverlabel: { bgcolor: colour("panel"), bordercolor: colour("line"), font: { color: colour("text"), size: 13 }, align: "left" },
    dragmode: narrow ? false : "zoom",
  });
  if (narrow) Object.assign(layout, { height: 360, margin: { ...layout.margin, l: 62, r: 8 } });
  return { data, layout };
}

function drawCharts(figures) {
  if (!window.Plotly) return;
  const config = {
    displaylogo: false, responsive: true, scrollZoom: false, showTips: false,
    modeBarButtons: [["resetScale2d", "toImage"]],
  };
  for (const figure of figures) {
    const target = document.getElementById(`chart-${figure.id}`);
    const narrow = target.clientWidth < 560;
    const { data, layout } = themed(figure, narrow);
    Plotly.react(target, data, layout, { ...config, displayModeBar: narrow ? false : "hover" });
  }
}

function startCharts() {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  drawCharts(figures);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => drawCharts(figures));
  matchMedia("(max-width: 620px)").addEventListener("change", () => drawCharts(figures));
}

function compareCells(a, b) {
  const [x, y] = [a?.dataset.sort ?? a?.textContent.trim(), b?.dataset.sort ?? b?.textContent.trim()];
  const [absentX, absentY] = [x === "–", y === "–"];
  if (absentX || absentY) return absentX - absentY || 0;
  const [p, q] = [Number(x), Number(y)];
  return Number.isNaN(p) || Number.isNaN(q) ? x.localeCompare(y, undefined, { numeric: true }) : p - q;
}

function startTable(table) {
  const body = table.tBodies[0];
  const headings = [...table.tHead.rows[0].cells];
  headings.forEach((heading, column) => {
    heading.querySelector("button").addEventListener("click", () => {
      const descending = heading.getAttribute("aria-sort") === "ascending";
      for (const other of headings) other.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", descending ? "descending" : "ascending");
      const absent = (row) => row.cells[column].textContent.trim() === "–";
      const rows = [...body.rows].sort((a, b) => {
        if (absent(a) !== absent(b)) return absent(a) ? 1 : -1;
        const order = compareCells(a.cells[column], b.cells[column]);
        return descending ? -order : order;
      });
      body.append(...rows);
    });
  });
  const filter = document.querySelector("[data-filter]");
  const count = document.querySelector("[data-count]");
  const apply = () => {
    const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of body.rows) {
      const text = row.textContent.toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
      shown += !row.hidden;
    }
    count.textContent = words.length ? `${shown} of ${body.rows.length}` : `${body.rows.length} records`;
  };
  filter.addEventListener("input", apply);
  apply();
}

document.querySelectorAll("[data-viewer]").forEach(startViewer);
document.querySelectorAll("table[data-sortable]").forEach(startTable);
startCharts();

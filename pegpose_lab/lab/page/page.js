"use strict";
const SVG = "http://www.w3.org/2000/svg";

function element(name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (text !== undefined) made.textContent = text;
  return made;
}

/* Bars: {bars: [[name, share 0..1, text, colour], ...]}, name and text above each, so that a phone shows them, too */
function drawBars(svg, state) {
  const pitch = 44;
  svg.setAttribute("viewBox", `0 0 480 ${pitch * state.bars.length + 4}`);
  svg.style.maxWidth = "34rem";
  state.bars.forEach(([name, share, text, color], row) => {
    const y = pitch * row + 18;
    svg.append(element("text", {x: 0, y: y - 3, "font-size": 15, fill: "#222"}, name));
    svg.append(element("text", {x: 480, y: y - 3, "font-size": 15, fill: "#222", "text-anchor": "end"}, text));
    svg.append(element("rect", {x: 0, y: y + 2, width: 480, height: 16, fill: "#eee"}));
    svg.append(element("rect", {x: 0, y: y + 2, width: Math.max(1, 480 * share), height: 16, fill: color}));
  });
}

/* Circles in an image: {width, height, circles: [[x, y, r, text, colour], ...], lines: [[x1, y1, x2, y2, colour], ...]} */
function drawCircles(svg, state) {
  svg.setAttribute("viewBox", `0 0 ${state.width} ${state.height}`);
  svg.append(element("rect", {x: 0, y: 0, width: state.width, height: state.height, fill: "#f4f4f4"}));
  for (const [x1, y1, x2, y2, color] of state.lines || [])
    svg.append(element("line", {x1, y1, x2, y2, stroke: color, "stroke-width": 4}));
  for (const [x, y, r, text, color] of state.circles) {
    svg.append(element("circle", {cx: x, cy: y, r: r, fill: "white", stroke: color, "stroke-width": 4}));
    svg.append(element("text", {x: x, y: y + 12, "font-size": 36, "text-anchor": "middle", fill: color}, text));
  }
}

const DRAW = {bars: drawBars, circles: drawCircles};

function start(box, sliders) {
  const spec = sliders[box.dataset.slider];
  const input = box.querySelector("input"), output = box.querySelector("output"), svg = box.querySelector("svg");
  function show() {
    const state = spec.states[Number(input.value)];
    svg.replaceChildren();
    DRAW[spec.kind](svg, state);
    output.textContent = state.text;
    input.setAttribute("aria-valuetext", state.text);
  }
  input.addEventListener("input", show);
  show();
}

const SLIDERS = JSON.parse(document.getElementById("states").textContent);
document.querySelectorAll(".slider").forEach((box) => start(box, SLIDERS));

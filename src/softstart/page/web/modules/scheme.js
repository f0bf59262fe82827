// The drive in one line: motor, shaft, gap, load; moved as it is at the instant that the plots read.
import { element } from "./numbers.js";
import { angleAt, stageAt, valueAt } from "./trace.js";

const SVG = "http://www.w3.org/2000/svg";
const FLANKS = [138, 202]; // where the pin of the motor's side stands when it touches one of them
const PIN = 4, BODIES = { motor: [34, 46, 31, 42], load: [236, 50, 31, 50] }; // left, width, middle, height
const WOUND = 9; // how far the picture of the shaft gives way at the largest torque
const MARKS = 6; // lines around a body, which tell that it turns
const FLASH = 0.02; // of the window, how long an impact lights up

export class Scheme {
  constructor(place) {
    this.place = element("div", { class: "scheme" });
    this.place.innerHTML = `
<svg viewBox="0 0 328 62" role="img" aria-label="Motor inertia J1, shaft of stiffness c and damping d, gap, load inertia J2">
  <g fill="none" stroke="currentColor" stroke-width="1.4">
    <rect class="motor" x="34" y="10" width="46" height="42" rx="2"/>
    <rect class="load" x="236" y="6" width="50" height="50" rx="2"/>
    <g class="turning" stroke-width="0.8"></g>
    <path class="shaft"/>
    <path class="pin" stroke-width="3.4"/>
    <path d="M236 31h-30v-17h-72"/>
    <path class="flank rear" stroke-width="2.4" d="M134 14v10M134 38v10"/>
    <path class="flank front" stroke-width="2.4" d="M206 14v34"/>
    <path d="M134 48h72" stroke-dasharray="1 5"/>
    <path class="motor-line" d="M22 45a17 17 0 0 1 0 -28m-6 3l6 -3 2 7"/>
    <path class="load-line" d="M298 17a17 17 0 0 1 0 28m6 -3l-6 3 -2 -7"/>
  </g>
  <g fill="currentColor" font-size="11" text-anchor="middle">
    <text x="57" y="35" font-style="italic">J\u2081</text><text x="261" y="35" font-style="italic">J\u2082</text>
    <text x="107" y="55" font-style="italic">c, d</text><text x="182" y="58" font-style="italic">\u03b4</text>
    <text x="8" y="35" font-style="italic">u</text><text x="317" y="35" font-style="italic">Mc</text>
  </g>
</svg>`;
    place.append(this.place);
    const find = (name) => this.place.querySelector(name);
    this.parts = { shaft: find(".shaft"), pin: find(".pin"), rear: find(".rear"), front: find(".front"), torque: find(".motor-line") };
    this.turning = Object.keys(BODIES).map((body) => {
      const line = document.createElementNS(SVG, "path");
      line.dataset.body = body;
      find(".turning").append(line);
      return line;
    });
    this.show(null, null, 0);
  }

  // `t` of the start `trace`; null: at rest in mid-gap, as a sign
  show(trace, t, window) {
    const known = trace?.u && t !== null && t <= trace.t.at(-1);
    const half = known ? trace.gap / 2 : 1;
    const twist = known ? valueAt(trace, "theta", t) : 0;
    const torque = known ? valueAt(trace, "T", t) : 0;
    const share = half > 0 ? Math.min(Math.max(twist / half, -1), 1) : Math.sign(torque);
    const pin = (FLANKS[0] + FLANKS[1]) / 2 + (share * (FLANKS[1] - FLANKS[0])) / 2;
    const largest = known ? Math.abs(trace.peak[1]) || 1 : 1;
    const wound = (WOUND * torque) / largest;
    this.parts.pin.setAttribute("d", `M${pin.toFixed(2)} 19v24`);
    this.parts.shaft.setAttribute("d", spring(80, 130 - wound, pin - PIN / 2));
    const [start, , side] = known ? stageAt(trace, t) : [0, 0, 0];
    const struck = side !== 0 && start > 0 && t - start < FLASH * window;
    for (const [name, own] of [["front", 1], ["rear", -1]]) {
      this.parts[name].classList.toggle("touched", side === own);
      this.parts[name].classList.toggle("struck", struck && side === own);
    }
    const given = known ? Math.abs(valueAt(trace, "u", t)) / (trace.largest_u ??= Math.max(...trace.u.map(Math.abs)) || 1) : 0.5;
    this.parts.torque.style.strokeWidth = 0.6 + 1.8 * given;
    for (const line of this.turning) {
      const [x, w, middle, h] = BODIES[line.dataset.body];
      const angle = known ? angleAt(trace, line.dataset.body === "motor" ? "w1" : "w2", t) : 0;
      line.setAttribute("d", known ? turned(x, w, middle, h / 2, angle) : "");
    }
    Object.assign(this.place.dataset, { pin: share.toFixed(4), side, struck });
  }
}

// lines around a cylinder that is seen from the side: those in front
function turned(x, w, middle, radius, angle) {
  let path = "";
  for (let i = 0; i < MARKS; i++) {
    const at = angle + (2 * Math.PI * i) / MARKS;
    if (Math.cos(at) > 0.05) path += `M${x} ${(middle - radius * Math.sin(at)).toFixed(2)}h${w}`;
  }
  return path;
}

// a shaft as a spring between two places, and the rod from it to the pin
function spring(from, to, rod) {
  const step = (to - from - 28) / 4;
  const zig = [-8, 16, -16, 16, -8].map((dy, i) => `l${(i % 4 ? step : step / 2).toFixed(2)} ${dy}`).join(" ");
  return `M${from} 31h14 ${zig} L${rod.toFixed(2)} 31`;
}

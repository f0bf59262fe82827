// The machine in one line: bodies, shafts and gaps; moved as it is at the instant that the plots read.
import { below, element } from "./numbers.js";
import { angleAt, stageAt, valueAt } from "./trace.js";

const BEFORE = 34, BEHIND = 42; // room at both ends, for the torques
const MOST = 6; // bodies that are drawn one by one in any case
const NARROW = 328, SHAFT = 66; // the picture grows where shafts would be shorter than this
const MIDDLE = 31, HIGH = 42;
const SPRING = 0.27, FLANKS = [0.29, 0.67]; // of a shaft: where its spring ends and where the flanks stand
const PIN = 4;
const WOUND = 0.05; // of a shaft, how far its picture gives way at the largest torque
const MARKS = 6; // lines around a body, which tell that it turns
const FLASH = 0.02; // of the window, how long an impact lights up
const TWO = { bodies: ["motor", "load"], shafts: [{ gap: 1 }], motor: 0 };
const REST = { share: 0, wound: 0, side: 0, struck: false };

export class Scheme {
  constructor(place) {
    this.place = place.appendChild(element("div", { class: "scheme" }));
    this.machine = TWO;
    this.show(null, null, 0);
  }

  // bodies and shafts of another machine; bodies of a long chain without a gap between them are one block
  build({ bodies, shafts, motor }) {
    const joined = bodies.length > MOST && shafts.some(({ gap }) => gap > 0);
    this.links = shafts.map((_, i) => i).filter((i) => !joined || shafts[i].gap > 0);
    this.ends = [...this.links, bodies.length - 1]; // the last body of each block
    const firsts = this.ends.map((_, i) => (i ? this.ends[i - 1] + 1 : 0));
    const count = this.ends.length;
    const wide = Math.max(16, Math.min(48, 150 / (count + 1)));
    const width = Math.max(NARROW, BEFORE + BEHIND + count * wide + this.links.length * SHAFT);
    const long = (width - BEFORE - BEHIND - count * wide) / Math.max(this.links.length, 1);
    const lefts = this.ends.map((_, i) => BEFORE + i * (wide + long));
    const several = bodies.length > 2;
    const text = (x, y, said) => `<text x="${x.toFixed(1)}" y="${y}" font-style="italic">${said}</text>`;
    const letter = (end, i) => `J${end === firsts[i] ? "" : `${below(firsts[i] + 1)}\u208b`}${below(end + 1)}`;
    this.forks = this.links.map((shaft, i) => {
      const left = lefts[i] + wide;
      const [rear, front] = FLANKS.map((share) => left + share * long);
      return { left, long, gap: shafts[shaft].gap, rear, front, right: lefts[i + 1], number: several ? below(shaft + 1) : "" };
    });
    this.bodies = lefts.map((left, i) => ({ left, wide, high: i === count - 1 ? HIGH + 8 : HIGH }));
    const driven = this.ends.findIndex((end) => end >= motor);
    const kind = (i) => (i === driven ? " motor" : i === count - 1 ? " load" : "");
    const box = ({ left, high }, i) => `<rect class="body${kind(i)}" x="${left.toFixed(1)}" y="${MIDDLE - high / 2}" width="${wide.toFixed(1)}" height="${high}" rx="2"><title></title></rect>`;
    const fork = ({ gap, rear, front, right }) => `<g class="link">${gap > 0
      ? `<path d="M${right} ${MIDDLE}H${front}V14H${rear}"/><path class="rear" stroke-width="2.4" d="M${rear} 14v10M${rear} 38v10"/><path class="front" stroke-width="2.4" d="M${front} 14v34"/><path d="M${rear} 48H${front}" stroke-dasharray="1 5"/><path class="pin" stroke-width="3.4"/>`
      : ""}<path class="shaft"/></g>`;
    const said = several
      ? `Chain of ${bodies.length} bodies: ${bodies.join(", ")}; a gap in ${shafts.filter(({ gap }) => gap > 0).length} of its shafts`
      : "Motor inertia J1, shaft of stiffness c and damping d, gap, load inertia J2";
    const turn = lefts[driven];
    this.place.innerHTML = `
<svg viewBox="0 0 ${width.toFixed(0)} 62" role="img">
  <g fill="none" stroke="currentColor" stroke-width="1.4">
    ${this.bodies.map(box).join("")}<g class="turning" stroke-width="0.8">${"<path/>".repeat(count)}</g>${this.forks.map(fork).join("")}
    <path class="motor-line" d="M${turn - 12} 45a17 17 0 0 1 0 -28m-6 3l6 -3 2 7"/>
    <path class="load-line" d="M${width - 30} 17a17 17 0 0 1 0 28m6 -3l-6 3 -2 -7"/>
  </g>
  <g fill="currentColor" font-size="${count > 4 ? 9 : 11}" text-anchor="middle">
    ${this.ends.map((end, i) => text(lefts[i] + wide / 2, 35, letter(end, i))).join("")}
    ${this.forks.map(({ left, long, gap, rear, front, number }) => text(left + 0.14 * long, 55, several ? `c${number}` : "c, d") + (gap > 0 ? text((rear + front) / 2, 59, `\u03b4${number}`) : "")).join("")}
    ${turn === BEFORE ? text(8, 35, "u") : ""}${several ? "" : text(width - 11, 35, "Mc")}
  </g>
</svg>`;
    this.place.firstElementChild.setAttribute("aria-label", said);
    this.place.querySelectorAll(".body title").forEach((title, i) => (title.textContent = bodies.slice(firsts[i], this.ends[i] + 1).join(", ")));
    this.parts = [...this.place.querySelectorAll(".link")].map((link) => Object.fromEntries([...link.children].map((one) => [one.classList[0], one])));
    this.turning = [...this.place.querySelector(".turning").children];
    this.torque = this.place.querySelector(".motor-line");
  }

  // `t` of the start `trace`; null: at rest in mid-gap, as a sign
  show(trace, t, window) {
    const { bodies, shafts, motor } = trace?.bodies ? trace : this.machine;
    const key = JSON.stringify([bodies, shafts.map(({ gap }) => gap > 0), motor]);
    if (key !== this.key) this.build({ bodies, shafts, motor });
    Object.assign(this, { key, machine: { bodies, shafts, motor } });
    const known = trace?.u && t !== null && t <= trace.t.at(-1);
    this.states = this.links.map((shaft, i) => this.moved(i, known ? this.shaft(trace, shaft, t, window) : REST));
    const given = known ? Math.abs(valueAt(trace, "u", t)) / (trace.largest_u ??= Math.max(...trace.u.map(Math.abs)) || 1) : 0.5;
    this.torque.style.strokeWidth = 0.6 + 1.8 * given;
    this.turning.forEach((line, i) => line.setAttribute("d", known ? turned(this.bodies[i], trace.units.turn * angleAt(trace, `w[${this.ends[i]}]`, t)) : ""));
  }

  // where the pin of a shaft stands between its flanks, how far the shaft is wound up, and which flank it touches
  shaft(trace, k, t, window) {
    const { gap, stages } = trace.shafts[k];
    const torque = valueAt(trace, `T[${k}]`, t);
    const [start, , side] = stageAt(stages, t);
    const share = gap > 0 ? Math.min(Math.max((2 * valueAt(trace, `theta[${k}]`, t)) / gap, -1), 1) : Math.sign(torque);
    return { share, wound: torque / (Math.abs(trace.peak[1]) || 1), side, struck: side !== 0 && start > 0 && t - start < FLASH * window };
  }

  moved(i, state) {
    const { left, long, gap, rear, front, right } = this.forks[i];
    const { shaft, pin, rear: back, front: fore } = this.parts[i];
    const ends = [rear + PIN, front - PIN];
    const at = gap > 0 ? (ends[0] + ends[1]) / 2 + (state.share * (ends[1] - ends[0])) / 2 : right;
    const end = left + (gap > 0 ? SPRING : 0.8) * long - WOUND * state.wound * long;
    shaft.setAttribute("d", spring(left, end, gap > 0 ? at - PIN / 2 : right));
    pin?.setAttribute("d", `M${at.toFixed(2)} 19v24`);
    for (const [flank, own] of pin ? [[fore, 1], [back, -1]] : []) {
      flank.classList.toggle("touched", state.side === own);
      flank.classList.toggle("struck", state.struck && state.side === own);
    }
    return state;
  }
}

// lines around a cylinder that is seen from the side: those in front
function turned({ left, wide, high }, angle) {
  let path = "";
  for (let i = 0; i < MARKS; i++) {
    const at = angle + (2 * Math.PI * i) / MARKS;
    if (Math.cos(at) > 0.05) path += `M${left.toFixed(1)} ${(MIDDLE - (high / 2) * Math.sin(at)).toFixed(2)}h${wide.toFixed(1)}`;
  }
  return path;
}

// a shaft as a spring between two places, and the rod from it to the pin
function spring(from, to, rod) {
  const lead = 0.2 * (to - from);
  const step = (to - from - 2 * lead) / 4;
  const zig = [-8, 16, -16, 16, -8].map((dy, i) => `l${(i % 4 ? step : step / 2).toFixed(2)} ${dy}`).join(" ");
  return `M${from.toFixed(1)} ${MIDDLE}h${lead.toFixed(2)} ${zig} L${rod.toFixed(2)} ${MIDDLE}`;
}

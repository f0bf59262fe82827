// Torques, speeds and the twist within the gap over time, on one canvas with one time axis.
import { label, Range, sharp, significant, ticks } from "./numbers.js";

const CHANNELS = ["t", "T", "u", "w1", "w2", "theta"];
const LEFT = 52, RIGHT = 12, TOP = 20, BOTTOM = 26, BETWEEN = 24;
const SHARES = [0.5, 0.25, 0.25];

// rows of single-precision numbers in base 64, as the server packs them
export function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (letter) => letter.charCodeAt(0));
  const all = new Float32Array(bytes.buffer);
  const size = all.length / packed.rows;
  const found = { ...packed, data: undefined };
  for (let row = 0; row < packed.rows; row++) found[CHANNELS[row]] = all.subarray(row * size, (row + 1) * size);
  return found;
}

function extent(series, low = Infinity, high = -Infinity) {
  for (const value of series) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}

export class Plots {
  constructor(place, theme) {
    this.canvas = place.querySelector("canvas");
    this.theme = theme;
    this.ranges = [new Range(), new Range(), new Range(), new Range()];
    this.canvas.addEventListener("pointermove", (event) => this.point(event.offsetX));
    this.canvas.addEventListener("pointerleave", () => this.point(null));
  }

  point(x) {
    this.cursor = x;
    if (!this.asked) {
      this.asked = requestAnimationFrame(() => {
        this.asked = 0;
        if (this.state) this.draw(this.state);
      });
    }
  }

  draw(state) {
    this.state = state;
    const sheet = sharp(this.canvas);
    if (!sheet) return;
    const { pen, width, height } = sheet;
    const main = state.traces.get(state.selected);
    pen.font = `11px ${this.theme.font}`;
    pen.lineJoin = "round";
    const usable = height - TOP - BOTTOM - 2 * BETWEEN;
    let y = TOP;
    const panels = SHARES.map((share) => {
      const panel = { x: LEFT, y, w: width - LEFT - RIGHT, h: Math.floor(usable * share), pen };
      y += panel.h + BETWEEN;
      return panel;
    });
    if (!main?.u) {
      pen.fillStyle = this.theme.colours.quiet;
      pen.fillText("No start to draw: see the sentence beside K.", LEFT, TOP + 30);
      return;
    }
    const others = state.order.filter((name) => name !== state.selected && state.shown.includes(name) && state.traces.has(name));
    const end = Math.max(main.t[main.t.length - 1], ...others.map((name) => state.traces.get(name).t.at(-1)));
    const time = this.ranges[3].fit(0, end, 0.01, 20);
    for (const panel of panels) Object.assign(panel, { t0: 0, t1: time.high });
    this.times = ticks(0, time.high, Math.round(panels[0].w / 90));
    this.torques(panels[0], state, main, others);
    this.speeds(panels[1], state, main);
    this.twist(panels[2], state, main);
    this.timeAxis(panels[2]);
    if (this.cursor !== null && this.cursor !== undefined) this.readout(panels, main);
  }

  frame(panel, range, title, unit) {
    const { pen, x, y, w, h } = panel;
    const { grid, quiet, line, ink } = this.theme.colours;
    Object.assign(panel, { low: range.low, high: range.high });
    const marks = ticks(range.low, range.high, Math.max(2, Math.round(h / 34)));
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    pen.lineWidth = 1;
    for (const mark of marks) {
      const at = Math.round(this.y(panel, mark)) + 0.5;
      pen.strokeStyle = Math.abs(mark) < 1e-12 ? line : grid;
      pen.beginPath();
      pen.moveTo(x, at);
      pen.lineTo(x + w, at);
      pen.stroke();
      pen.fillStyle = quiet;
      pen.fillText(label(mark, marks.digits), x - 7, at);
    }
    pen.strokeStyle = grid;
    for (const mark of this.times) {
      const at = Math.round(this.x(panel, mark)) + 0.5;
      pen.beginPath();
      pen.moveTo(at, y);
      pen.lineTo(at, y + h);
      pen.stroke();
    }
    pen.strokeStyle = line;
    pen.strokeRect(x + 0.5, y + 0.5, w - 1, h - 1);
    pen.textAlign = "left";
    pen.textBaseline = "alphabetic";
    pen.fillStyle = ink;
    pen.fillText(title, x, y - 7);
    const used = pen.measureText(title).width;
    pen.fillStyle = quiet;
    pen.fillText(unit, x + used + 6, y - 7);
    panel.legendAt = x + w;
  }

  legend(panel, entries) {
    const { pen, y } = panel;
    let at = panel.legendAt;
    pen.textAlign = "right";
    for (const [text, colour, dash, thick] of [...entries].reverse()) {
      pen.fillStyle = this.theme.colours.quiet;
      pen.fillText(text, at, y - 7);
      at -= pen.measureText(text).width + 6;
      pen.strokeStyle = colour;
      pen.lineWidth = thick;
      pen.setLineDash(dash);
      pen.beginPath();
      pen.moveTo(at - 16, y - 11);
      pen.lineTo(at, y - 11);
      pen.stroke();
      pen.setLineDash([]);
      at -= 30;
    }
  }

  own(state) {
    return this.theme.strategy(state.order.indexOf(state.selected));
  }

  x(panel, t) {
    return panel.x + ((t - panel.t0) / (panel.t1 - panel.t0)) * panel.w;
  }

  y(panel, value) {
    return panel.y + panel.h - ((value - panel.low) / (panel.high - panel.low)) * panel.h;
  }

  inside(panel, draw) {
    const { pen, x, y, w, h } = panel;
    pen.save();
    pen.beginPath();
    pen.rect(x, y - 1, w, h + 2);
    pen.clip();
    draw();
    pen.restore();
  }

  curve(panel, times, values, colour, thick, dash = []) {
    const { pen } = panel;
    const scale = panel.w / (panel.t1 - panel.t0);
    const rise = panel.h / (panel.high - panel.low);
    const bottom = panel.y + panel.h + panel.low * rise;
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.setLineDash(dash);
    pen.beginPath();
    for (let i = 0; i < times.length; i++) {
      const px = panel.x + times[i] * scale;
      const py = bottom - values[i] * rise;
      if (i) pen.lineTo(px, py);
      else pen.moveTo(px, py);
    }
    pen.stroke();
    pen.setLineDash([]);
  }

  level(panel, value, colour, dash = [4, 3]) {
    const { pen, x, w } = panel;
    const at = Math.round(this.y(panel, value)) + 0.5;
    pen.strokeStyle = colour;
    pen.lineWidth = 1;
    pen.setLineDash(dash);
    pen.beginPath();
    pen.moveTo(x, at);
    pen.lineTo(x + w, at);
    pen.stroke();
    pen.setLineDash([]);
  }

  shade(panel, stages) {
    const { pen, y, h } = panel;
    pen.fillStyle = this.theme.colours.shade;
    for (const [start, end, side] of stages) {
      if (side !== 0) continue;
      const from = this.x(panel, start);
      pen.fillRect(from, y, Math.max(this.x(panel, end) - from, 0.5), h);
    }
  }

  startLine(panel, state) {
    const start = state.rows.get(state.selected)?.start_time;
    if (typeof start !== "number") return;
    const { pen, y, h } = panel;
    const at = Math.round(this.x(panel, start)) + 0.5;
    pen.strokeStyle = this.theme.colours.quiet;
    pen.lineWidth = 1;
    pen.setLineDash([2, 3]);
    pen.beginPath();
    pen.moveTo(at, y);
    pen.lineTo(at, y + h);
    pen.stroke();
    pen.setLineDash([]);
  }

  torques(panel, state, main, others) {
    let [low, high] = extent(main.T, 0, 0);
    [low, high] = extent(main.u, low, high);
    for (const name of others) [low, high] = extent(state.traces.get(name).T, low, high);
    const { quiet, ink, paper } = this.theme.colours;
    const own = this.own(state);
    const range = this.ranges[0].fit(low, high);
    Object.assign(panel, { low: range.low, high: range.high });
    this.shade(panel, main.stages);
    this.frame(panel, range, "Torque", "N m");
    let named = others.length > 2 ? [] : others.map((name) => [`T, ${name}`, this.theme.strategy(state.order.indexOf(name)), [], 1]);
    const wide = named.reduce((sum, [text]) => sum + panel.pen.measureText(text).width + 36, 0);
    if (wide > panel.w - 260) named = []; // names that do not fit beside the others stand in the table alone
    this.legend(panel, [...named, ["motor u", ink, [5, 3], 1.2], ["shaft T", own, [], 2.4]]);
    this.inside(panel, () => {
      const base = state.rows.get(state.selected);
      if (base?.k_dyn) this.level(panel, base.peak_torque / base.k_dyn, quiet, [1, 3]);
      for (const name of others) {
        const trace = state.traces.get(name);
        this.curve(panel, trace.t, trace.T, this.theme.strategy(state.order.indexOf(name)), 1);
      }
      this.startLine(panel, state);
      this.curve(panel, main.t, main.u, ink, 1.2, [5, 3]);
      this.curve(panel, main.t, main.T, own, 2.2);
      const [when, peak] = main.peak;
      const { pen } = panel;
      const [px, py] = [this.x(panel, when), this.y(panel, peak)];
      pen.fillStyle = paper;
      pen.strokeStyle = own;
      pen.lineWidth = 2;
      pen.beginPath();
      pen.arc(px, py, 3.5, 0, 7);
      pen.fill();
      pen.stroke();
      const text = significant(Math.abs(peak), 4);
      const right = px + pen.measureText(text).width + 14 < panel.x + panel.w;
      pen.textAlign = right ? "left" : "right";
      pen.textBaseline = "middle";
      pen.fillStyle = ink;
      pen.fillText(text, px + (right ? 8 : -8), Math.max(py, panel.y + 8));
      pen.textBaseline = "alphabetic";
    });
  }

  speeds(panel, state, main) {
    let [low, high] = extent(main.w1, 0, main.target);
    [low, high] = extent(main.w2, low, high);
    const { ink, quiet } = this.theme.colours;
    const own = this.own(state);
    const range = this.ranges[1].fit(low, high);
    Object.assign(panel, { low: range.low, high: range.high });
    this.shade(panel, main.stages);
    this.frame(panel, range, "Speed", "rad/s");
    this.legend(panel, [["motor \u03c9\u2081", ink, [5, 3], 1.2], ["load \u03c9\u2082", own, [], 2.2]]);
    this.inside(panel, () => {
      this.level(panel, main.target, quiet, [1, 3]);
      this.startLine(panel, state);
      this.curve(panel, main.t, main.w1, ink, 1.2, [5, 3]);
      this.curve(panel, main.t, main.w2, own, 2);
    });
  }

  twist(panel, state, main) {
    const half = main.gap / 2;
    const [low, high] = extent(main.theta, -half, half);
    const { quiet, shade } = this.theme.colours;
    const range = this.ranges[2].fit(low, high);
    Object.assign(panel, { low: range.low, high: range.high });
    this.shade(panel, main.stages);
    this.frame(panel, range, "Twist \u03c6\u2081 \u2212 \u03c6\u2082, flanks dashed", "rad");
    this.legend(panel, [["gap open", shade, [], 10]]);
    this.inside(panel, () => {
      this.level(panel, half, quiet);
      this.level(panel, -half, quiet);
      this.curve(panel, main.t, main.theta, this.own(state), 2);
    });
  }

  timeAxis(panel) {
    const { pen, x, y, w, h } = panel;
    pen.fillStyle = this.theme.colours.quiet;
    for (const mark of this.times) {
      const at = this.x(panel, mark);
      if (at > x + w - 22) continue; // there stands the unit
      pen.textAlign = "center";
      pen.fillText(label(mark, this.times.digits), at, y + h + 15);
    }
    pen.textAlign = "right";
    pen.fillText("s", x + w, y + h + 15);
  }

  readout(panels, main) {
    const [first] = panels;
    const share = (this.cursor - first.x) / first.w;
    if (share < 0 || share > 1) return;
    const t = share * first.t1;
    let i = main.t.findIndex((time) => time >= t);
    if (i < 0) i = main.t.length - 1;
    const { pen } = first;
    const { quiet, ink, paper, line } = this.theme.colours;
    const between = (series) => {
      if (i === 0) return series[0];
      const step = main.t[i] - main.t[i - 1];
      const part = step > 0 ? (t - main.t[i - 1]) / step : 1;
      return t > main.t[i] ? NaN : series[i - 1] + part * (series[i] - series[i - 1]);
    };
    const texts = [
      [["t", t, "s"], ["T", between(main.T), "N m"], ["u", between(main.u), "N m"]],
      [["\u03c9\u2081", between(main.w1), ""], ["\u03c9\u2082", between(main.w2), "rad/s"]],
      [["\u03b8", between(main.theta), "rad"]],
    ];
    panels.forEach((panel, index) => {
      const at = Math.round(this.cursor) + 0.5;
      pen.strokeStyle = quiet;
      pen.lineWidth = 1;
      pen.beginPath();
      pen.moveTo(at, panel.y);
      pen.lineTo(at, panel.y + panel.h);
      pen.stroke();
      const text = texts[index].map(([name, value, unit]) => `${name} ${significant(value, 4)} ${unit}`.trim()).join("   ");
      const wide = pen.measureText(text).width + 12;
      const left = at + 8 + wide > panel.x + panel.w ? at - 8 - wide : at + 8;
      pen.fillStyle = paper;
      pen.strokeStyle = line;
      pen.beginPath();
      pen.rect(left, panel.y + panel.h - 24, wide, 18);
      pen.fill();
      pen.stroke();
      pen.fillStyle = ink;
      pen.textAlign = "left";
      pen.fillText(text, left + 6, panel.y + panel.h - 11);
    });
  }
}

// Torques, speeds and the twist within the gap over time, on one canvas with one time axis. The window on it is
// moved by wheel, drag and keys; an instant is pointed at by the mouse, or held by a press, the keys and the player.
import { below, fixed, label, Range, sharp, significant, ticks } from "./numbers.js";
import { SvgPen } from "./svg.js";
import { extent, indexAt, unpackAll, valueAt } from "./trace.js";

const LEFT = 52, RIGHT = 12, TOP = 20, BOTTOM = 26, BETWEEN = 24, LINE = 15;
const SHARES = [0.5, 0.25, 0.25];
const BAND = 0.36; // of the height of a gap's band, from its middle to a flank
const WIDE = 4.5; // of the reference: motor torque and speed are dashed
const FINEST = 1e-7; // of the whole start: a shorter window has no digits left in single precision

// whether a start is that of a chain, with several shafts
const many = (trace) => (trace?.shafts?.length ?? 1) > 1;
const quoted = (text) => `"${text.replaceAll('"', '""')}"`;

export class Plots {
  // `windowed(window)` is told the window that is seen, or null; `timed(t)` the instant, or null
  constructor(place, theme, windowed, timed) {
    this.canvas = place.querySelector("canvas");
    Object.assign(this, { theme, windowed, timed, window: null, hovered: null, held: null });
    this.ranges = [new Range(), new Range(), new Range(), new Range()];
    const on = (kind, act) => this.canvas.addEventListener(kind, act);
    on("pointermove", (event) => this.move(event));
    on("pointerleave", () => this.hover(null));
    on("pointerdown", (event) => this.press(event));
    on("pointerup", (event) => this.release(event));
    on("pointercancel", () => (this.pressed = null));
    on("wheel", (event) => this.wheel(event));
    on("dblclick", () => this.show(null));
    on("keydown", (event) => this.key(event));
  }

  // ---- the window and the instant

  get end() {
    return this.box?.end ?? 0;
  }

  get seen() {
    return this.window ?? [0, this.box?.whole ?? 0];
  }

  // the instant that is read: where the mouse is, else the one that is held
  get time() {
    return this.hovered ?? this.held;
  }

  show(window) {
    if (!this.box) return;
    const whole = this.box.whole;
    if (window) {
      const span = Math.min(Math.max(window[1] - window[0], FINEST * whole), whole);
      const from = Math.min(Math.max(window[0], 0), whole - span);
      window = span >= 0.999 * whole ? null : [from, from + span];
    }
    this.window = window;
    this.later();
    clearTimeout(this.telling);
    this.telling = setTimeout(() => this.windowed(this.window), 120);
  }

  zoom(factor, about = null) {
    const [from, to] = this.seen;
    const at = about ?? (this.held !== null && this.held >= from && this.held <= to ? this.held : (from + to) / 2);
    this.show([at + (from - at) * factor, at + (to - at) * factor]);
  }

  pan(share) {
    const [from, to] = this.seen;
    if (this.window) this.show([from + share * (to - from), to + share * (to - from)]);
  }

  hover(t) {
    this.hovered = t;
    this.later();
  }

  hold(t) {
    this.held = t;
    this.later();
  }

  timeOf(x) {
    const [from, to] = this.seen;
    const share = this.box ? (x - LEFT) / this.box.w : -1;
    return share < 0 || share > 1 ? null : from + share * (to - from);
  }

  move(event) {
    const { pressed } = this;
    if (pressed) {
      pressed.moved ||= Math.abs(event.offsetX - pressed.x) > 4;
      if (pressed.moved && pressed.window) {
        const shift = ((pressed.x - event.offsetX) / this.box.w) * (pressed.window[1] - pressed.window[0]);
        this.show([pressed.window[0] + shift, pressed.window[1] + shift]);
      }
      pressed.to = event.offsetX;
    }
    this.hover(this.timeOf(event.offsetX));
  }

  // a drag marks the window to see, with Shift it moves the one that is seen; a press holds an instant
  press(event) {
    if (event.button !== 0 || this.timeOf(event.offsetX) === null) return;
    this.pressed = { x: event.offsetX, to: event.offsetX, moved: false, window: event.shiftKey ? this.seen : null };
    this.canvas.setPointerCapture(event.pointerId);
  }

  release(event) {
    const { pressed } = this;
    this.pressed = null;
    if (!pressed) return;
    if (!pressed.moved) this.hold(this.timeOf(pressed.x));
    else if (!pressed.window) {
      const clamp = (x) => Math.min(Math.max(x, LEFT), LEFT + this.box.w);
      const ends = [pressed.x, event.offsetX].map((x) => this.timeOf(clamp(x))).sort((a, b) => a - b);
      if (ends[1] > ends[0]) this.show(ends);
    }
  }

  wheel(event) {
    if (!this.box) return;
    event.preventDefault();
    if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) this.pan((event.deltaX || event.deltaY) / 800);
    else this.zoom(1.0015 ** event.deltaY, this.timeOf(event.offsetX));
  }

  key(event) {
    const [from, to] = this.seen;
    const step = (to - from) / 200;
    const at = this.held ?? from;
    const acts = {
      ArrowLeft: () => this.hold(Math.max(at - step, 0)),
      ArrowRight: () => this.hold(Math.min(at + step, this.end)),
      PageUp: () => this.pan(-0.5),
      PageDown: () => this.pan(0.5),
      "+": () => this.zoom(0.5),
      "=": () => this.zoom(0.5),
      "-": () => this.zoom(2),
      0: () => this.show(null),
      Escape: () => this.hold(null),
    };
    if (event.ctrlKey || event.metaKey || event.altKey || !acts[event.key]) return;
    event.preventDefault();
    acts[event.key]();
  }

  later() {
    this.asked ||= requestAnimationFrame(() => {
      this.asked = 0;
      if (this.state) this.draw(this.state);
    });
  }

  // ---- drawing

  draw(state, sheet = sharp(this.canvas)) {
    this.state = state;
    if (!sheet) return;
    unpackAll(state);
    const { pen, width, height } = sheet;
    const main = state.traces.get(state.selected);
    pen.font = `11px ${this.theme.font}`;
    pen.lineJoin = "round";
    if (!main?.u) {
      this.box = null;
      pen.fillStyle = this.theme.colours.quiet;
      pen.fillText("No start to draw: see the sentence beside K.", LEFT, TOP + 30);
      this.timed(null);
      return;
    }
    const others = state.order.filter((name) => name !== state.selected && state.shown.includes(name) && state.traces.has(name));
    const w = width - LEFT - RIGHT;
    const named = this.named(pen, w, state, others);
    const usable = height - TOP - BOTTOM - 2 * BETWEEN - LINE * (named.length - 1);
    let y = TOP + LINE * (named.length - 1);
    const panels = SHARES.map((share) => {
      const panel = { x: LEFT, y, w, h: Math.floor(usable * share), pen };
      y += panel.h + BETWEEN;
      return panel;
    });
    const end = Math.max(main.t.at(-1), ...others.map((name) => state.traces.get(name).t.at(-1)), this.reference?.t.at(-1) ?? 0);
    const whole = this.ranges[3].fit(0, end, 0.01, 20).high;
    this.box = { w, end: main.t.at(-1), whole };
    if (this.window && this.window[0] >= end) this.window = null;
    const [t0, t1] = this.seen;
    for (const panel of panels) Object.assign(panel, { t0, t1 });
    this.times = ticks(t0, t1, Math.round(w / 90));
    this.torques(panels[0], state, main, others, named);
    this.speeds(panels[1], state, main);
    this.twist(panels[2], state, main);
    this.timeAxis(panels[2]);
    if (this.pressed?.moved && !this.pressed.window) this.mark(panels);
    const t = this.time;
    if (t !== null && t >= t0 && t <= t1) this.readout(panels, main, state, others, t);
    this.timed(t);
  }

  // lines of legend entries: those of the selected start last, names before them, as many lines as they need
  named(pen, w, state, others) {
    const flagged = (name) => (state.rows.get(name)?.flag ? ` (${state.rows.get(name).flag})` : "");
    const { reference } = state;
    const kept = this.reference ? [[`reference: ${reference.name}, ${fixed(reference.k_dyn, 3)}`, this.theme.colours.kept, [], WIDE]] : [];
    const entries = others.map((name) => [`T, ${name}${flagged(name)}`, this.theme.strategy(state.order.indexOf(name)), [], 1]);
    if (state.traces.get(state.selected).allowed) entries.push(["permissible", this.theme.colours.warn, [], 1]);
    const main = state.traces.get(state.selected);
    if (many(main)) entries.push(["T, its other shafts", this.own(state), [], 0.8]);
    const worst = many(main) ? `T, ${main.worst}` : "shaft T";
    entries.push(...kept, ["motor u", this.theme.colours.ink, [5, 3], 1.2], [`${worst}${flagged(state.selected)}`, this.own(state), [], 2.4]);
    const lines = [[]];
    let free = w - 90; // the heading stands in the lowest line
    for (const entry of entries.reverse()) {
      const wide = pen.measureText(entry[0]).width + 36;
      if (wide > free && lines[0].length) {
        lines.unshift([]);
        free = w;
      }
      lines[0].unshift(entry);
      free -= wide;
    }
    return lines;
  }

  // the window that a drag marks
  mark(panels) {
    const { pen } = panels[0];
    const [left, right] = [this.pressed.x, this.pressed.to].sort((a, b) => a - b);
    pen.globalAlpha = 0.14;
    pen.fillStyle = this.theme.colours.accent;
    for (const { y, h } of panels) pen.fillRect(left, y, right - left, h);
    pen.globalAlpha = 1;
  }

  frame(panel, range, title, unit, marks = ticks(range.low, range.high, Math.max(2, Math.round(panel.h / 34)))) {
    const { pen, x, y, w, h } = panel;
    const { grid, quiet, line, ink } = this.theme.colours;
    Object.assign(panel, { low: range.low, high: range.high });
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

  legend(panel, entries, above = 0) {
    const { pen } = panel;
    const y = panel.y - above * LINE;
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

  // the start that the others are compared with, if one was kept and can be drawn
  get reference() {
    return this.state.reference?.trace?.T ? this.state.reference.trace : null;
  }

  compared(panel, channel) {
    if (this.reference) this.curve(panel, this.reference.t, this.reference[channel], this.theme.colours.kept, WIDE);
  }

  // least and largest of what is seen of a channel of the selected start and of the reference
  reach(main, channel, low, high) {
    for (const trace of [main, this.reference]) if (trace) [low, high] = extent(trace, channel, this.seen, low, high);
    return [low, high];
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
    const left = panel.x - panel.t0 * scale;
    const from = Math.max(indexAt(times, panel.t0) - 1, 0);
    const to = Math.min(indexAt(times, panel.t1) + 1, times.length);
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.setLineDash(dash);
    pen.beginPath();
    for (let i = from; i < to; i++) {
      const px = left + times[i] * scale;
      const py = bottom - values[i] * rise;
      if (i > from) pen.lineTo(px, py);
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
      const from = Math.max(this.x(panel, start), panel.x);
      const to = Math.min(this.x(panel, end), panel.x + panel.w);
      if (to > panel.x && from < panel.x + panel.w) pen.fillRect(from, y, Math.max(to - from, 0.5), h);
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

  torques(panel, state, main, others, named) {
    let [low, high] = this.reach(main, "T", 0, 0);
    [low, high] = extent(main, "u", this.seen, low, high);
    for (const name of others) [low, high] = extent(state.traces.get(name), "T", this.seen, low, high);
    const beside = many(main) ? main.shafts.filter(({ name }) => name !== main.worst) : [];
    for (const { T } of beside) [low, high] = extent(main, T, this.seen, low, high);
    const { quiet, ink, paper } = this.theme.colours;
    const own = this.own(state);
    const { allowed } = main;
    if (allowed && high > 0.5 * allowed) high = Math.max(high, 1.02 * allowed); // a limit far above says nothing
    const range = this.ranges[0].fit(low, high);
    Object.assign(panel, { low: range.low, high: range.high });
    this.shade(panel, main.stages);
    this.frame(panel, range, "Torque", "N m");
    [...named].reverse().forEach((line, above) => this.legend(panel, line, above));
    this.inside(panel, () => {
      const base = state.rows.get(state.selected);
      if (base?.k_dyn) this.level(panel, base.peak_torque / base.k_dyn, quiet, [1, 3]);
      if (allowed) this.level(panel, allowed, this.theme.colours.warn, []);
      this.compared(panel, "T");
      for (const name of others) {
        const trace = state.traces.get(name);
        this.curve(panel, trace.t, trace.T, this.theme.strategy(state.order.indexOf(name)), 1);
      }
      this.startLine(panel, state);
      for (const { T } of beside) this.curve(panel, main.t, main[T], own, 0.8);
      this.curve(panel, main.t, main.u, ink, 1.2, [5, 3]);
      this.curve(panel, main.t, main.T, own, 2.2);
      this.peaks(panel, state, main, others);
    });
  }

  // the peak of each start; labels that would lie on one another are left to the table, the selected one's never
  peaks(panel, state, main, others) {
    const { pen } = panel;
    const { ink, paper, quiet } = this.theme.colours;
    const taken = [];
    pen.textBaseline = "middle";
    for (const name of [state.selected, ...others]) {
      const own = name === state.selected;
      const [when, peak] = state.traces.get(name).peak;
      const [px, py] = [this.x(panel, when), this.y(panel, peak)];
      if (px < panel.x || px > panel.x + panel.w) continue;
      pen.fillStyle = paper;
      pen.strokeStyle = this.theme.strategy(state.order.indexOf(name));
      pen.lineWidth = own ? 2 : 1;
      pen.beginPath();
      pen.arc(px, py, own ? 3.5 : 2.5, 0, 7);
      pen.fill();
      pen.stroke();
      const text = significant(Math.abs(peak), 4);
      const wide = pen.measureText(text).width;
      const right = px + wide + 14 < panel.x + panel.w;
      const left = right ? px + 8 : px - 8 - wide;
      const at = Math.max(py, panel.y + 8);
      if (taken.some(([x0, x1, y]) => left < x1 && left + wide > x0 && Math.abs(at - y) < 13)) continue;
      taken.push([left - 4, left + wide + 4, at]);
      pen.globalAlpha = 0.7;
      pen.fillStyle = paper;
      pen.fillRect(left - 2, at - 7, wide + 4, 13);
      pen.globalAlpha = 1;
      pen.textAlign = "left";
      pen.fillStyle = own ? ink : quiet;
      pen.fillText(text, left, at);
    }
    pen.textBaseline = "alphabetic";
  }

  speeds(panel, state, main) {
    let [low, high] = this.window ? [Infinity, -Infinity] : [0, main.target];
    [low, high] = extent(main, "w1", this.seen, low, high);
    [low, high] = this.reach(main, "w2", low, high);
    const { ink, quiet } = this.theme.colours;
    const own = this.own(state);
    const range = this.ranges[1].fit(low, high);
    Object.assign(panel, { low: range.low, high: range.high });
    this.shade(panel, main.stages);
    this.frame(panel, range, "Speed", main.units.speed);
    const between = many(main) && main.bodies.length > 2 ? [["between", quiet, [], 0.7]] : [];
    this.legend(panel, [...between, ["motor \u03c9\u2081", ink, [5, 3], 1.2], ["load \u03c9\u2082", own, [], 2.2]]);
    this.inside(panel, () => {
      this.level(panel, main.target, quiet, [1, 3]);
      this.startLine(panel, state);
      this.compared(panel, "w2");
      if (many(main)) for (const { w } of main.bodies) this.curve(panel, main.t, main[w], quiet, 0.7);
      this.curve(panel, main.t, main.w1, ink, 1.2, [5, 3]);
      this.curve(panel, main.t, main.w2, own, 2);
    });
  }

  twist(panel, state, main) {
    if (many(main) && main.gap > 0) {
      this.places(panel, state, main);
      return;
    }
    const half = main.gap / 2;
    const [low, high] = this.reach(main, "theta", -half, half);
    const { quiet, shade } = this.theme.colours;
    const range = this.ranges[2].fit(low, high);
    Object.assign(panel, { low: range.low, high: range.high });
    this.shade(panel, main.stages);
    this.frame(panel, range, "Twist \u03c6\u2081 \u2212 \u03c6\u2082, flanks dashed", main.units.angle);
    this.legend(panel, [["gap open", shade, [], 10]]);
    this.inside(panel, () => {
      this.level(panel, half, quiet);
      this.level(panel, -half, quiet);
      this.compared(panel, "theta");
      this.curve(panel, main.t, main.theta, this.own(state), 2);
    });
  }

  // a band for each gap of a chain: the line lies on a dashed one while that flank is touched
  places(panel, state, main) {
    const { pen, x } = panel;
    const { quiet, shade } = this.theme.colours;
    const gaps = main.shafts.filter(({ gap }) => gap > 0);
    this.shade(panel, main.stages);
    this.frame(panel, { low: 0, high: gaps.length }, "Place in each gap, flanks dashed", "", []);
    this.legend(panel, [["a gap open", shade, [], 10]]);
    this.inside(panel, () => gaps.forEach(({ name, gap, theta }, row) => {
      const middle = gaps.length - row - 0.5;
      for (const side of [-1, 1]) this.level(panel, middle + side * BAND, quiet);
      const places = ((main.places ??= {})[theta] ??= main[theta].map((angle) => Math.min(Math.max((2 * angle) / gap, -1), 1)));
      this.curve(panel, main.t, places.map((share) => middle + share * BAND), this.own(state), 1.6);
    }));
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    pen.fillStyle = quiet;
    gaps.forEach(({ T }, row) => pen.fillText(`\u03b4${below(Number(T.slice(2, -1)) + 1)}`, x - 7, this.y(panel, gaps.length - row - 0.5)));
    pen.textBaseline = "alphabetic";
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

  readout(panels, main, state, others, t) {
    const { pen } = panels[0];
    const { quiet, ink, paper, line } = this.theme.colours;
    const at = this.x(panels[0], t);
    const own = (channel) => valueAt(main, channel, t);
    const among = others.map((name) => [this.theme.strategy(state.order.indexOf(name)), name, valueAt(state.traces.get(name), "T", t), ""]);
    if (this.reference) among.push([quiet, "reference", valueAt(this.reference, "T", t), ""]);
    if (many(main)) among.unshift(...main.shafts.map(({ name, T }) => [this.own(state), name, own(T), ""]));
    const twists = many(main)
      ? main.shafts.filter(({ gap }) => gap > 0).map(({ gap, T, theta }) => ["", `\u03b8${below(Number(T.slice(2, -1)) + 1)}`, own(theta), ""])
      : [["", "\u03b8", own("theta"), main.units.angle]];
    const texts = [
      [["", "t", t, "s"], ["", "T", own("T"), "N m"], ["", "u", own("u"), "N m"]],
      [["", "\u03c9\u2081", own("w1"), ""], ["", "\u03c9\u2082", own("w2"), main.units.speed]],
      twists,
    ];
    panels.forEach((panel, index) => {
      pen.strokeStyle = quiet;
      pen.lineWidth = 1;
      pen.beginPath();
      pen.moveTo(at, panel.y);
      pen.lineTo(at, panel.y + panel.h);
      pen.stroke();
      const written = ([, name, value, unit]) => `${name} ${significant(value, 4)} ${unit}`.trim();
      const lines = [[quiet, texts[index].map(written).join("   ")]];
      if (index === 0) lines.push(...among.slice(0, Math.floor((panel.h - 30) / LINE)).map((one) => [one[0], written(one)]));
      const wide = Math.max(...lines.map(([, text]) => pen.measureText(text).width)) + 12;
      const high = 3 + LINE * lines.length;
      const left = at + 8 + wide > panel.x + panel.w ? at - 8 - wide : at + 8;
      const top = panel.y + panel.h - 6 - high;
      pen.fillStyle = paper;
      pen.strokeStyle = line;
      pen.beginPath();
      pen.rect(left, top, wide, high);
      pen.fill();
      pen.stroke();
      pen.textAlign = "left";
      lines.forEach(([colour, text], row) => {
        pen.fillStyle = row ? colour : ink;
        pen.fillText(text, left + 6, top + 13 + LINE * row);
      });
    });
  }

  // ---- what is seen, as files

  // the plots as they stand, without the instant that is read
  svg() {
    const { pen, width, height } = sharp(this.canvas);
    const [hovered, held] = [this.hovered, this.held];
    Object.assign(this, { hovered: null, held: null });
    const written = new SvgPen(width, height, pen, this.theme.colours.paper);
    this.draw(this.state, { pen: written, width, height });
    Object.assign(this, { hovered, held });
    this.draw(this.state);
    return written.text(`Start of ${document.title}`);
  }

  // points of the traces that are drawn, between the ends of the window; a start after the other
  csv() {
    const { state } = this;
    unpackAll(state);
    const [from, to] = this.seen;
    const main = state.traces.get(state.selected);
    const { angle, speed } = main.units;
    const parts = many(main)
      ? [...main.shafts.flatMap(({ name, T, theta }) => [[T, `T ${name} [N m]`], [theta, `twist ${name} [${angle}]`]]), ...main.bodies.map(({ name, w }) => [w, `w ${name} [${speed}]`])]
      : [];
    const channels = ["t", "T", "u", "w1", "w2", "theta", ...parts.map(([channel]) => channel)];
    const [w, a] = [speed, angle].map((unit) => unit.replace("/", "_"));
    const heads = [`strategy,time_s,shaft_torque_Nm,motor_torque_Nm,motor_speed_${w},load_speed_${w},twist_${a}`, ...parts.map(([, head]) => quoted(head))];
    const lines = [heads.join(",")];
    const drawn = state.order.filter((one) => one === state.selected || state.shown.includes(one));
    const traces = drawn.map((name) => [name, state.traces.get(name)]);
    if (this.reference) traces.push([`reference: ${state.reference.name}`, this.reference]);
    for (const [name, trace] of traces) {
      trace?.t?.forEach((t, i) => {
        if (t < from || t > to) return;
        lines.push([quoted(name), ...channels.map((one) => (trace[one] ? Number(trace[one][i].toPrecision(7)) : ""))].join(","));
      });
    }
    return `${lines.join("\n")}\n`;
  }
}

// Torques, speeds and the twist within the gap over time, on one canvas with one time axis. The window on it is
// moved by wheel, drag and keys; an instant is pointed at by the mouse, or held by a press, the keys and the player.
import { below, label, sharp, significant, stroke, ticks, write } from "./numbers.js";
import { extent, indexAt, unpack, valueAt } from "./trace.js";

const LEFT = 52, RIGHT = 12, TOP = 20, BOTTOM = 26, BETWEEN = 24, LINE = 15;
const SHARES = [0.5, 0.25, 0.25];
const BAND = 0.36; // of the height of a gap's band, from its middle to a flank
const WIDE = 4.5; // of the reference: motor torque and speed are dashed
const DASHED = [5, 3];
const FINEST = 1e-7; // of the whole start: a shorter window has no digits left in single precision

const quoted = (text) => `"${text.replaceAll('"', '""')}"`;
const inside = (value, low, high) => Math.min(Math.max(value, low), high);

export class Plots {
  // `windowed(window)` is told the window that is seen, or null; `timed(t)` the instant, or null
  constructor(place, theme, windowed, timed) {
    this.canvas = place.querySelector("canvas");
    Object.assign(this, { theme, windowed, timed, window: null, hovered: null, held: null });
    const on = (kind, act) => this.canvas.addEventListener(kind, act);
    on("pointermove", (event) => this.move(event));
    on("pointerleave", () => this.read({ hovered: null }));
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

  show(window) {
    if (!this.box) return;
    const { whole } = this.box;
    if (window) {
      const span = inside(window[1] - window[0], FINEST * whole, whole);
      const from = inside(window[0], 0, whole - span);
      window = span >= 0.999 * whole ? null : [from, from + span];
    }
    this.read({ window });
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

  hold(t) {
    this.read({ held: t });
  }

  // another instant or window is read: drawn with the next picture
  read(change) {
    Object.assign(this, change);
    this.asked ||= requestAnimationFrame(() => {
      this.asked = 0;
      if (this.state) this.draw(this.state);
    });
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
    this.read({ hovered: this.timeOf(event.offsetX) });
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
      const ends = [pressed.x, event.offsetX].map((x) => this.timeOf(inside(x, LEFT, LEFT + this.box.w))).sort((a, b) => a - b);
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

  // ---- drawing

  draw(state) {
    this.state = state;
    const sheet = sharp(this.canvas, this.theme.colours.paper);
    if (!sheet) return;
    const { pen, width, height } = sheet;
    const { main, others, reference } = Object.assign(this, this.starts(), { pen });
    Object.assign(pen, { font: `11px ${this.theme.font}`, lineJoin: "round" });
    if (!main?.u) {
      this.box = null;
      write(pen, "No start to draw: see the sentence beside K.", LEFT, TOP + 30, this.theme.colours.quiet);
      this.timed(null);
      return;
    }
    const w = width - LEFT - RIGHT;
    const ends = [main, ...others.map(({ trace }) => trace), ...(reference ? [reference] : [])].map(({ t }) => t.at(-1));
    this.box = { w, end: main.t.at(-1), whole: ticks(0, 1.01 * Math.max(...ends), 20, true).at(-1) };
    if (this.window && this.window[0] >= Math.max(...ends)) this.window = null;
    this.times = ticks(...this.seen, Math.round(w / 90));
    let y = TOP;
    const panels = SHARES.map((share) => {
      const panel = { y, h: Math.floor((height - TOP - BOTTOM - 2 * BETWEEN) * share) };
      y += panel.h + BETWEEN;
      return panel;
    });
    this.torques(panels[0]);
    this.speeds(panels[1]);
    if (this.many && main.shafts.some(({ gap }) => gap > 0)) this.places(panels[2]);
    else this.twist(panels[2]);
    const foot = panels[2].y + panels[2].h + 15;
    for (const t of this.times) if (this.x(t) < LEFT + w - 22) write(pen, label(t, this.times.digits), this.x(t), foot, this.theme.colours.quiet, "center");
    write(pen, "s", LEFT + w, foot, this.theme.colours.quiet, "right");
    if (this.pressed?.moved && !this.pressed.window) {
      pen.globalAlpha = 0.14;
      pen.fillStyle = this.theme.colours.accent;
      for (const { y: top, h } of panels) pen.fillRect(this.pressed.x, top, this.pressed.to - this.pressed.x, h);
      pen.globalAlpha = 1;
    }
    const t = this.hovered ?? this.held;
    if (t !== null && t >= this.seen[0] && t <= this.seen[1]) this.readout(panels, t);
    this.timed(t);
  }

  // what is drawn: the selected start, the other ones that are shown, and the one that all are compared with
  starts() {
    const { state, theme } = this;
    const one = (name) => state.traces.set(name, unpack(state.traces.get(name))).get(name);
    if (state.reference) state.reference.trace = unpack(state.reference.trace);
    const names = state.order.filter((name) => name !== state.selected && state.shown.includes(name) && state.traces.get(name));
    const main = one(state.selected);
    return {
      main,
      many: main?.shafts?.length > 1,
      others: names.map((name) => ({ name, trace: one(name), colour: theme.strategy(state.colours[name]) })),
      reference: state.reference?.trace?.T ? state.reference.trace : null,
      own: theme.strategy(state.colours[state.selected]),
    };
  }

  x(t) {
    const [from, to] = this.seen;
    return LEFT + ((t - from) / (to - from)) * this.box.w;
  }

  y({ y, h, low, high }, value) {
    return y + h - ((value - low) / (high - low)) * h;
  }

  across(panel, value, colour, dash = [4, 3]) {
    const at = Math.round(this.y(panel, value)) + 0.5;
    stroke(this.pen, [LEFT, at], [LEFT + this.box.w, at], colour, dash);
  }

  upright({ y, h }, t, colour, dash = []) {
    const at = Math.round(this.x(t)) + 0.5;
    stroke(this.pen, [at, y], [at, y + h], colour, dash);
  }

  // a panel with its grid, the gaps that are open shaded, and on its line, from the right, what its curves are;
  // those that come first are left out where there is no room
  frame(panel, [low, high], title, unit, legend, marked = true) {
    const { pen, main, box } = this;
    const { grid, quiet, line, ink, shade } = this.theme.colours;
    const span = high - low || 1;
    const ends = marked ? ticks(low && low - 0.03 * span, high + 0.04 * span, 6, true) : [low, high]; // round, not to tremble
    Object.assign(panel, { low: ends[0], high: ends.at(-1) });
    const marks = marked ? ticks(panel.low, panel.high, Math.max(2, Math.round(panel.h / 34))) : [];
    pen.fillStyle = shade;
    for (const [start, end, side] of main.shafts.filter(({ gap }) => gap > 0 || !this.many).flatMap(({ stages }) => stages)) {
      const [from, to] = [Math.max(this.x(start), LEFT), Math.min(this.x(end), LEFT + box.w)];
      if (side === 0 && to > from) pen.fillRect(from, panel.y, Math.max(to - from, 0.5), panel.h);
    }
    for (const mark of marks) {
      this.across(panel, mark, Math.abs(mark) < 1e-12 ? line : grid, []);
      write(pen, label(mark, marks.digits), LEFT - 7, Math.round(this.y(panel, mark)) + 0.5, quiet, "right", "middle");
    }
    for (const t of this.times) this.upright(panel, t, grid);
    Object.assign(pen, { strokeStyle: line, lineWidth: 1 });
    pen.strokeRect(LEFT + 0.5, panel.y + 0.5, box.w - 1, panel.h - 1);
    const head = panel.y - 7;
    write(pen, title, LEFT, head, ink);
    const used = pen.measureText(title).width + 6;
    write(pen, unit, LEFT + used, head, quiet);
    const free = LEFT + used + pen.measureText(unit).width + 30;
    let at = LEFT + box.w;
    for (const [text, colour, dash, thick] of [...legend].reverse()) {
      const begin = at - pen.measureText(text).width - 6;
      if (begin < free) break;
      write(pen, text, at, head, quiet, "right");
      stroke(pen, [begin - 16, head - 4], [begin, head - 4], colour, dash, thick);
      at = begin - 30;
    }
  }

  within(panel, draw) {
    const { pen } = this;
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, panel.y - 1, this.box.w, panel.h + 2);
    pen.clip();
    draw();
    pen.restore();
  }

  curve(panel, { t: times }, values, colour, thick, dash = []) {
    const { pen } = this;
    const [t0, t1] = this.seen;
    const scale = this.box.w / (t1 - t0);
    const rise = panel.h / (panel.high - panel.low);
    const [left, bottom] = [LEFT - t0 * scale, panel.y + panel.h + panel.low * rise];
    const from = Math.max(indexAt(times, t0) - 1, 0);
    const to = Math.min(indexAt(times, t1) + 1, times.length);
    Object.assign(pen, { strokeStyle: colour, lineWidth: thick });
    pen.setLineDash(dash);
    pen.beginPath();
    for (let i = from; i < to; i++) pen.lineTo(left + times[i] * scale, bottom - values[i] * rise);
    pen.stroke();
    pen.setLineDash([]);
  }

  // least and largest of what is seen of these channels of the selected start, and of the first of the reference
  reach(channels, low, high) {
    const { main, reference, seen } = this;
    for (const channel of channels) [low, high] = extent(main, channel, seen, low, high);
    return reference ? extent(reference, channels[0], seen, low, high) : [low, high];
  }

  compared(panel, channel) {
    if (this.reference) this.curve(panel, this.reference, this.reference[channel], this.theme.colours.kept, WIDE);
  }

  startLine(panel) {
    const { state } = this;
    const start = state.figure?.start_time; // of the start that is drawn; the rows may be set to an equal time
    if (typeof start === "number") this.upright(panel, start, this.theme.colours.quiet, [2, 3]);
  }

  torques(panel) {
    const { main, others, own, many, state } = this;
    const { quiet, ink, kept, warn } = this.theme.colours;
    const beside = main.shafts.map((_, k) => `T[${k}]`).filter((_, k) => k !== main.worst);
    let [low, high] = this.reach(["T", "u", ...beside], 0, 0);
    for (const { trace } of others) [low, high] = extent(trace, "T", this.seen, low, high);
    const { allowed } = main;
    if (allowed && high > 0.5 * allowed) high = Math.max(high, 1.02 * allowed); // a limit far above says nothing
    this.frame(panel, [low, high], `Torque${main.units.at}`, main.units.torque, [
      ...(many ? [["other shafts", own, [], 0.8]] : []),
      ...(this.reference ? [["reference", kept, [], WIDE]] : []),
      ...(allowed ? [["permissible", warn, [], 1]] : []),
      ["motor u", ink, DASHED, 1.2],
      [many ? `T, ${main.shafts[main.worst].name}` : "shaft T", own, [], 2.4],
    ]);
    this.within(panel, () => {
      const base = state.rows.get(state.selected);
      if (base?.k_dyn) this.across(panel, base.peak_torque / base.k_dyn, quiet, [1, 3]);
      if (allowed) this.across(panel, allowed, warn, []);
      this.compared(panel, "T");
      for (const { trace, colour } of others) this.curve(panel, trace, trace.T, colour, 1);
      this.startLine(panel);
      for (const channel of beside) this.curve(panel, main, main[channel], own, 0.8);
      this.curve(panel, main, main.u, ink, 1.2, DASHED);
      this.curve(panel, main, main.T, own, 2.2);
      this.peaks(panel);
    });
  }

  // the peak of each start, with its name; where they would lie on one another the selected one's stays
  peaks(panel) {
    const { pen, main, others, own, state, box } = this;
    const { ink, paper, quiet } = this.theme.colours;
    const taken = [];
    for (const { name, trace, colour } of [{ name: state.selected, trace: main, colour: own }, ...others]) {
      const [px, py] = [this.x(trace.peak[0]), this.y(panel, trace.peak[1])];
      if (px < LEFT || px > LEFT + box.w) continue;
      Object.assign(pen, { fillStyle: paper, strokeStyle: colour, lineWidth: trace === main ? 2 : 1 });
      pen.beginPath();
      pen.arc(px, py, trace === main ? 3.5 : 2.5, 0, 7);
      pen.fill();
      pen.stroke();
      const text = `${name} ${significant(Math.abs(trace.peak[1]), 4)}`;
      const wide = pen.measureText(text).width;
      const left = px + wide + 14 < LEFT + box.w ? px + 8 : px - 8 - wide;
      const at = Math.max(py, panel.y + 8);
      if (taken.some(([x0, x1, y]) => left < x1 && left + wide > x0 && Math.abs(at - y) < 13)) continue;
      taken.push([left - 4, left + wide + 4, at]);
      pen.globalAlpha = 0.7;
      pen.fillStyle = paper;
      pen.fillRect(left - 2, at - 7, wide + 4, 13);
      pen.globalAlpha = 1;
      write(pen, text, left, at, trace === main ? ink : quiet, "left", "middle");
    }
  }

  speeds(panel) {
    const { main, own, many } = this;
    const { ink, quiet } = this.theme.colours;
    const between = many ? main.bodies.map((_, k) => `w[${k}]`) : [];
    const range = this.reach(["w2", "w1"], ...(this.window ? [Infinity, -Infinity] : [0, main.target]));
    this.frame(panel, range, "Speed", main.units.speed, [
      ...(between.length > 2 ? [["between", quiet, [], 0.7]] : []),
      ["motor \u03c9\u2081", ink, DASHED, 1.2],
      ["load \u03c9\u2082", own, [], 2.2],
    ]);
    this.within(panel, () => {
      this.across(panel, main.target, quiet, [1, 3]);
      this.startLine(panel);
      this.compared(panel, "w2");
      for (const channel of between) this.curve(panel, main, main[channel], quiet, 0.7);
      this.curve(panel, main, main.w1, ink, 1.2, DASHED);
      this.curve(panel, main, main.w2, own, 2);
    });
  }

  twist(panel) {
    const { main, own } = this;
    const { quiet, shade } = this.theme.colours;
    const half = main.shafts[main.worst].gap / 2;
    this.frame(panel, this.reach(["theta"], -half, half), "Twist \u03c6\u2081 \u2212 \u03c6\u2082, flanks dashed", main.units.angle, [["gap open", shade, [], 10]]);
    this.within(panel, () => {
      for (const flank of [half, -half]) this.across(panel, flank, quiet);
      this.compared(panel, "theta");
      this.curve(panel, main, main.theta, own, 2);
    });
  }

  // a band for each gap of a chain: the line lies on a dashed one while that flank is touched
  places(panel) {
    const { pen, main, own } = this;
    const { quiet, shade } = this.theme.colours;
    const gaps = main.shafts.map(({ gap }, k) => ({ gap, k })).filter(({ gap }) => gap > 0);
    this.frame(panel, [0, gaps.length], "Place in each gap, flanks dashed", "", [["a gap open", shade, [], 10]], false);
    gaps.forEach(({ gap, k }, row) => {
      const middle = gaps.length - row - 0.5;
      write(pen, `\u03b4${below(k + 1)}`, LEFT - 7, this.y(panel, middle), quiet, "right", "middle");
      this.within(panel, () => {
        for (const side of [-1, 1]) this.across(panel, middle + side * BAND, quiet);
        this.curve(panel, main, main[`theta[${k}]`].map((angle) => middle + BAND * inside((2 * angle) / gap, -1, 1)), own, 1.6);
      });
    });
  }

  // what is read at an instant: in each panel a line of its values, in the first one the other torques below
  readout(panels, t) {
    const { pen, main, others, own, many, box } = this;
    const { quiet, ink, paper, line } = this.theme.colours;
    const said = (name, trace, channel, unit = "") => `${name} ${significant(valueAt(trace, channel, t), 4)} ${unit}`.trim();
    const twists = main.shafts.flatMap(({ gap }, k) => (gap > 0 ? [said(`\u03b8${below(k + 1)}`, main, `theta[${k}]`)] : []));
    const heads = [
      [`t ${significant(t, 4)} s`, said("T", main, "T", main.units.torque), said("u", main, "u", main.units.torque)],
      [said("\u03c9\u2081", main, "w1"), said("\u03c9\u2082", main, "w2", main.units.speed)],
      many ? twists : [said("\u03b8", main, "theta", main.units.angle)],
    ];
    const among = [
      ...(many ? main.shafts.map(({ name }, k) => [own, said(name, main, `T[${k}]`)]) : []),
      ...others.map(({ name, trace, colour }) => [colour, said(name, trace, "T")]),
      ...(this.reference ? [[quiet, said("reference", this.reference, "T")]] : []),
    ];
    panels.forEach((panel, index) => {
      const below = index ? [] : among.slice(0, Math.floor((panel.h - 30) / LINE));
      const lines = [[ink, heads[index].join("   ")], ...below];
      const wide = Math.max(...lines.map(([, text]) => pen.measureText(text).width)) + 12;
      const high = 3 + LINE * lines.length;
      const at = this.x(t);
      const left = at + 8 + wide > LEFT + box.w ? at - 8 - wide : at + 8;
      const top = panel.y + panel.h - 6 - high;
      stroke(pen, [at, panel.y], [at, panel.y + panel.h], quiet);
      Object.assign(pen, { fillStyle: paper, strokeStyle: line });
      pen.fillRect(left, top, wide, high);
      pen.strokeRect(left, top, wide, high);
      lines.forEach(([colour, text], row) => write(pen, text, left + 6, top + 13 + LINE * row, colour));
    });
  }

  // ---- what is seen, as a file

  // points of the starts that are drawn, between the ends of the window; a start after the other
  csv() {
    const { main, others, reference, many, state } = Object.assign(this, this.starts());
    const [from, to] = this.seen;
    const { angle, speed, torque, at } = main.units;
    const [w, a, m] = [speed, angle, torque].map((unit) => unit.replace("/", "_").replaceAll(/\W/g, "") + (at && "_at_output"));
    const columns = [["t", "time_s"], ["T", `shaft_torque_${m}`], ["u", `motor_torque_${m}`], ["w1", `motor_speed_${w}`], ["w2", `load_speed_${w}`], ["theta", `twist_${a}`]];
    if (many) {
      main.shafts.forEach(({ name }, k) => columns.push([`T[${k}]`, quoted(`T ${name} [${torque}]`)], [`theta[${k}]`, quoted(`twist ${name} [${angle}]`)]));
      main.bodies.forEach((name, k) => columns.push([`w[${k}]`, quoted(`w ${name} [${speed}]`)]));
    }
    const lines = [["strategy", ...columns.map(([, head]) => head)].join(",")];
    const traces = [[state.selected, main], ...others.map(({ name, trace }) => [name, trace])];
    if (reference) traces.push([`reference: ${state.reference.name}`, reference]);
    for (const [name, trace] of traces) {
      trace.t.forEach((t, i) => {
        if (t < from || t > to) return;
        lines.push([quoted(name), ...columns.map(([channel]) => (trace[channel] ? Number(trace[channel][i].toPrecision(7)) : ""))].join(","));
      });
    }
    return `${lines.join("\n")}\n`;
  }
}

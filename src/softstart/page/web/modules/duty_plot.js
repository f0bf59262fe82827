// Torques and speeds of the steps of a duty, one behind the other, below their strip.
import { label, sharp, significant, stroke, ticks, write } from "./numbers.js";
import { indexAt } from "./trace.js";

export const LEFT = 52, RIGHT = 12;
const TOP = 20, BOTTOM = 8, AXIS = 22, BETWEEN = 24; // below: with an axis of time where a step is shown alone
const SHARES = [0.64, 0.36];
const DASHED = [5, 3];

// units of angle, torque and speed in the headings of a file
export function headings({ units, at }) {
  return [units.angle, units.torque, units.speed].map((unit) => unit.replace("/", "_").replaceAll(/\W/g, "") + (at && "_at_output"));
}

// channels of all steps, and of each step where they begin and end
function unpack(trace) {
  if (!trace.data) return;
  const all = new Float32Array(Uint8Array.from(atob(trace.data), (letter) => letter.charCodeAt(0)).buffer);
  const size = all.length / trace.channels.length;
  trace.channels.forEach((name, row) => (trace[name] = all.subarray(row * size, (row + 1) * size)));
  trace.spans = trace.ends.map((end, index) => [index ? trace.ends[index - 1] : 0, end]);
  trace.data = null;
}

export class DutyPlot {
  constructor(canvas, theme, select) {
    Object.assign(this, { canvas, theme, hovered: null });
    const read = (x) => {
      this.hovered = x;
      this.asked ||= requestAnimationFrame(() => {
        this.asked = 0;
        if (this.drawn) this.draw(...this.drawn);
      });
    };
    canvas.addEventListener("pointermove", (event) => read(event.offsetX));
    canvas.addEventListener("pointerleave", () => read(null));
    canvas.addEventListener("pointerdown", (event) => this.drawn?.[0].trace && !this.alone && select(this.stepAt(event.offsetX)));
  }

  draw(view, widths, selected, alone) {
    this.drawn = [view, widths, selected, alone];
    const sheet = sharp(this.canvas, this.theme.colours.paper);
    const { trace } = view;
    if (!sheet || !trace || widths.length !== trace.ends.length) return;
    unpack(trace);
    const { pen, width, height } = sheet;
    Object.assign(this, { pen, trace, view, alone, selected, w: width - LEFT - RIGHT });
    Object.assign(pen, { font: `11px ${this.theme.font}`, lineJoin: "round" });
    let x = LEFT;
    this.places = view.steps.map(({ length }, index) => {
      const place = { index, x, w: widths[index], length };
      x += widths[index];
      return place;
    });
    if (alone) this.places = [{ ...this.places[selected], x: LEFT, w: this.w }];
    let y = TOP;
    const panels = SHARES.map((share) => {
      const panel = { y, h: Math.floor((height - TOP - (alone ? AXIS : BOTTOM) - BETWEEN) * share) };
      y += panel.h + BETWEEN;
      return panel;
    });
    this.torques(panels[0]);
    this.speeds(panels[1]);
    const { quiet } = this.theme.colours;
    const foot = panels[1].y + panels[1].h + 15;
    if (alone) {
      const [place] = this.places;
      const marks = ticks(0, place.length, Math.round(this.w / 90));
      for (const t of marks) write(pen, label(t, marks.digits), this.x(place, t), foot, quiet, "center");
      write(pen, "s", LEFT + this.w, foot, quiet, "right");
    }
    if (this.hovered !== null) this.readout(panels);
  }

  x(place, t) {
    return place.x + (t / place.length) * place.w;
  }

  stepAt(x) {
    return this.places.findLast((place) => x >= place.x)?.index ?? 0;
  }

  extent(channels, low, high) {
    for (const { index } of this.places) {
      const [from, to] = this.trace.spans[index];
      for (const channel of channels) {
        const values = this.trace[channel];
        for (let i = from; i < to; i++) {
          if (values[i] < low) low = values[i];
          if (values[i] > high) high = values[i];
        }
      }
    }
    return [low, high];
  }

  frame(panel, [low, high], title, unit, legend) {
    const { pen, w } = this;
    const { grid, quiet, line, ink, shade } = this.theme.colours;
    const span = high - low || 1;
    const ends = ticks(low && low - 0.03 * span, high && high + 0.04 * span, 6, true);
    Object.assign(panel, { low: ends[0], high: ends.at(-1) });
    const chosen = this.places.find(({ index }) => index === this.selected);
    if (chosen && !this.alone) {
      pen.fillStyle = shade;
      pen.fillRect(chosen.x, panel.y, Math.min(chosen.w, LEFT + w - chosen.x), panel.h);
    }
    const marks = ticks(panel.low, panel.high, Math.max(3, Math.round(panel.h / 30)));
    for (const mark of marks) {
      this.across(panel, mark, Math.abs(mark) < 1e-12 ? line : grid, []);
      write(pen, label(mark, marks.digits), LEFT - 7, Math.round(this.y(panel, mark)) + 0.5, quiet, "right", "middle");
    }
    for (const place of this.places.slice(1)) {
      const at = Math.round(place.x) + 0.5;
      if (at < LEFT + w) stroke(pen, [at, panel.y], [at, panel.y + panel.h], line);
    }
    Object.assign(pen, { strokeStyle: line, lineWidth: 1 });
    pen.strokeRect(LEFT + 0.5, panel.y + 0.5, w - 1, panel.h - 1);
    const head = panel.y - 7;
    write(pen, title, LEFT, head, ink);
    const used = pen.measureText(title).width + 6;
    write(pen, unit, LEFT + used, head, quiet);
    const free = LEFT + used + pen.measureText(unit).width + 30;
    let at = LEFT + w;
    for (const [text, colour, dash, thick] of [...legend].reverse()) {
      const begin = at - pen.measureText(text).width - 6;
      if (begin < free) break;
      write(pen, text, at, head, quiet, "right");
      stroke(pen, [begin - 16, head - 4], [begin, head - 4], colour, dash, thick);
      at = begin - 30;
    }
  }

  y({ y, h, low, high }, value) {
    return y + h - ((value - low) / (high - low)) * h;
  }

  across(panel, value, colour, dash = [4, 3]) {
    const at = Math.round(this.y(panel, value)) + 0.5;
    stroke(this.pen, [LEFT, at], [LEFT + this.w, at], colour, dash);
  }

  within(panel, draw) {
    const { pen } = this;
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, panel.y - 1, this.w, panel.h + 2);
    pen.clip();
    draw();
    pen.restore();
  }

  curve(panel, channel, colour, thick, dash = []) {
    const { pen, trace } = this;
    Object.assign(pen, { strokeStyle: colour, lineWidth: thick });
    pen.setLineDash(dash);
    for (const place of this.places) {
      const [from, to] = trace.spans[place.index];
      pen.beginPath();
      for (let i = from; i < to; i++) pen.lineTo(this.x(place, trace.t[i]), this.y(panel, trace[channel][i]));
      pen.stroke();
    }
    pen.setLineDash([]);
  }

  get own() {
    return this.theme.strategy(this.view.colours);
  }

  torques(panel) {
    const { trace, view } = this;
    const { ink, warn, quiet } = this.theme.colours;
    const worst = `T[${trace.worst}]`;
    const beside = trace.shafts.map((_, k) => `T[${k}]`).filter((name) => name !== worst);
    let [low, high] = this.extent([worst, "u", ...beside], 0, 0);
    const { allowed } = trace;
    if (allowed && high > 0.5 * allowed) high = Math.max(high, 1.02 * allowed); // a limit far above says nothing
    if (allowed && low < -0.5 * allowed) low = Math.min(low, -1.02 * allowed);
    this.frame(panel, [low, high], `Torque${view.at}`, view.units.torque, [
      ...(beside.length ? [["other shafts", this.own, [], 0.8]] : []),
      ...(allowed ? [["permissible", warn, [], 1]] : []),
      ["motor u", ink, DASHED, 1.2],
      [beside.length ? `T, ${trace.shafts[trace.worst]}` : "shaft T", this.own, [], 2.4],
    ]);
    this.within(panel, () => {
      for (const base of [view.base, -view.base]) this.across(panel, base, quiet, [1, 3]);
      if (allowed) for (const limit of [allowed, -allowed]) this.across(panel, limit, warn, []);
      for (const channel of beside) this.curve(panel, channel, this.own, 0.8);
      this.curve(panel, "u", ink, 1.2, DASHED);
      this.curve(panel, worst, this.own, 1.8);
    });
    this.peak(panel, worst);
  }

  // the largest torque of all
  peak(panel, channel) {
    const { pen, trace } = this;
    const [index, torque] = trace.peak;
    const place = this.places.find((one) => one.index === index);
    if (!place) return;
    const [from, to] = trace.spans[index];
    let at = from;
    for (let i = from; i < to; i++) if (Math.abs(trace[channel][i]) > Math.abs(trace[channel][at])) at = i;
    const [px, py] = [this.x(place, trace.t[at]), this.y(panel, trace[channel][at])];
    Object.assign(pen, { fillStyle: this.theme.colours.paper, strokeStyle: this.own, lineWidth: 2 });
    pen.beginPath();
    pen.arc(px, py, 3.5, 0, 7);
    pen.fill();
    pen.stroke();
    const text = `${index + 1} ${this.view.steps[index].do} ${significant(torque, 4)} ${this.view.units.torque}`;
    const wide = pen.measureText(text).width;
    const left = px + wide + 14 < LEFT + this.w ? px + 8 : px - 8 - wide;
    pen.globalAlpha = 0.7;
    pen.fillStyle = this.theme.colours.paper;
    const top = Math.max(py, panel.y + 8);
    pen.fillRect(left - 2, top - 7, wide + 4, 13);
    pen.globalAlpha = 1;
    write(pen, text, left, top, this.theme.colours.ink, "left", "middle");
  }

  speeds(panel) {
    const { trace, view } = this;
    const { ink, quiet } = this.theme.colours;
    const [motor, load] = [`w[${trace.motor}]`, `w[${trace.load}]`];
    const between = trace.channels.filter((name) => name.startsWith("w[") && name !== motor && name !== load);
    this.frame(panel, this.extent([load, motor], 0, 0), "Speed", view.units.speed, [
      ...(between.length ? [["between", quiet, [], 0.7]] : []),
      ["motor \u03c9\u2081", ink, DASHED, 1.2],
      ["load \u03c9\u2082", this.own, [], 2.2],
    ]);
    this.within(panel, () => {
      for (const channel of between) this.curve(panel, channel, quiet, 0.7);
      this.curve(panel, motor, ink, 1.2, DASHED);
      this.curve(panel, load, this.own, 1.8);
    });
  }

  // what is read below the pointer
  readout(panels) {
    const { pen, trace, view, hovered } = this;
    if (hovered < LEFT || hovered > LEFT + this.w) return;
    const { quiet, ink, paper, line } = this.theme.colours;
    const place = this.places.findLast(({ x }) => hovered >= x) ?? this.places[0];
    const t = ((hovered - place.x) / place.w) * place.length;
    const [from, to] = trace.spans[place.index];
    const i = Math.min(from + indexAt(trace.t.subarray(from, to), t), to - 1);
    const said = (name, channel) => `${name} ${significant(trace[channel][i], 4)}`;
    const texts = [
      `${place.index + 1} ${view.steps[place.index].do}   t ${significant(trace.t[i], 4)} s   ${said("T", `T[${trace.worst}]`)} ${view.units.torque}   ${said("u", "u")} ${view.units.torque}`,
      `${said("\u03c9\u2081", `w[${trace.motor}]`)}   ${said("\u03c9\u2082", `w[${trace.load}]`)} ${view.units.speed}`,
    ];
    panels.forEach((panel, row) => {
      const wide = pen.measureText(texts[row]).width + 12;
      const left = hovered + 8 + wide > LEFT + this.w ? hovered - 8 - wide : hovered + 8;
      stroke(pen, [hovered, panel.y], [hovered, panel.y + panel.h], quiet);
      Object.assign(pen, { fillStyle: paper, strokeStyle: line });
      pen.fillRect(left, panel.y + panel.h - 24, wide, 18);
      pen.strokeRect(left, panel.y + panel.h - 24, wide, 18);
      write(pen, texts[row], left + 6, panel.y + panel.h - 11, ink);
    });
  }

  // the points of all steps
  csv(view) {
    const { trace, steps, units, at } = view;
    unpack(trace);
    const [, torque, speed] = headings(view);
    const quoted = (text) => `"${text.replaceAll('"', '""')}"`;
    const heads = trace.channels.slice(1).map((name) => {
      const k = Number(name.slice(2, -1));
      if (name === "u") return `motor_torque_${torque}`;
      return name.startsWith("T[") ? quoted(`T ${trace.shafts[k]} [${units.torque}${at}]`) : quoted(`w[${k + 1}] [${speed}]`);
    });
    const lines = [["step", "do", "time_in_step_s", ...heads].join(",")];
    trace.spans.forEach(([from, to], index) => {
      for (let i = from; i < to; i++) lines.push([index + 1, steps[index].do, ...trace.channels.map((name) => Number(trace[name][i].toPrecision(7)))].join(","));
    });
    return `${lines.join("\n")}\n`;
  }
}

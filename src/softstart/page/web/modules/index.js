// Takes frames of the server, keeps what they say, and draws it once a screen refresh.
import { Controls } from "./controls.js";
import { Duty } from "./duty.js";
import { Figure } from "./figure.js";
import { GapMap } from "./map.js";
import { element, put, stored } from "./numbers.js";
import { Player } from "./player.js";
import { Plots } from "./plots.js";
import { Scheme } from "./scheme.js";
import { Shaft } from "./shaft.js";
import { Steps } from "./steps.js";
import { Table } from "./table.js";
import { Theme } from "./theme.js";

const KEY = "softstart-inputs";

export class Instrument {
  constructor(root, send) {
    this.send = send;
    this.state = { rows: new Map(), traces: new Map(), order: [], shown: [], selected: "", colours: {}, stamp: 0 };
    this.waiting = 0;
    const part = (name) => root.querySelector(`.${name}`);
    const say = (message) => this.say(message);
    [this.driveName, this.advice] = [part("drive-name"), part("advice")];
    this.theme = new Theme(part("colours"), () => this.redraw());
    this.scheme = new Scheme(part("controls"));
    this.remarks = part("controls").appendChild(element("div", { class: "remarks", role: "status" }));
    this.controls = new Controls(part("controls"), part("strategy"), part("units"), part("duty-fields"), say);
    this.steps = new Steps(part("steps"), say);
    this.shaft = new Shaft(part("shaft"), say);
    this.figure = new Figure(part("figure"), say);
    this.table = new Table(part("strategies"), this.theme, say);
    const windowed = (window) => say({ what: "window", begin: window?.[0] ?? 0, end: window?.[1] ?? 0 });
    this.plots = new Plots(part("plots"), this.theme, windowed, (t) => this.timed(t));
    this.player = new Player(part("player"), this.plots);
    this.duty = new Duty(part("duty"), part("duty-figure"), part("duty-files"), this.theme, say);
    this.map = new GapMap(part("map"), this.theme, say);
    this.resized = new ResizeObserver(() => this.redraw());
    for (const canvas of root.querySelectorAll("canvas")) this.resized.observe(canvas.parentElement);
  }

  // a page is reloaded by its reader, or when the line was lost for long: it goes on with its drive
  hello() {
    const hello = (inputs) => this.say({ what: "hello", stored: inputs, link: location.hash.slice(1) });
    hello(JSON.parse(stored("sessionStorage", KEY)));
    window.addEventListener("hashchange", (this.followed = () => hello(null)));
  }

  // in this tab, and in its address: a copied address brings back the same drive, strategies and settings
  keep(inputs) {
    history.replaceState(history.state, "", `#${inputs.link}`);
    stored("sessionStorage", KEY, JSON.stringify(inputs));
  }

  // the stamp comes back with the first frame that knows of the message
  say(message) {
    const stamp = message.what === "hello" ? 0 : performance.now();
    this.send({ ...message, stamp });
    return stamp;
  }

  // numbers are shown at once; pictures wait for the next refresh of the screen, where only the newest counts
  take(number, frame) {
    const { state } = this;
    const { order, rows = [], traces = {}, figure, fields, mistakes, recommendation, plausibility_warnings, assumed, drive } = frame;
    for (const row of rows) state.rows.set(row.name, row);
    for (const [name, packed] of Object.entries(traces)) {
      if (packed) state.traces.set(name, packed);
      else state.traces.delete(name);
      this.plotted = false;
    }
    if (figure) {
      state.figure = figure;
      // a quick frame has shown it already, unless the start was too long for one
      if (this.version !== frame.version || !this.figure.figure.reached) this.figure.show(figure);
      Object.assign(this, { version: frame.version, stamp: frame.stamp });
    }
    if (order) {
      for (const known of [state.rows, state.traces]) for (const name of known.keys()) if (!order.includes(name)) known.delete(name);
      const { shown, added, changed, selected, stamp, here, angle, inertia, torque, at_time } = frame;
      const reference = frame.reference && { trace: state.reference?.trace, ...frame.reference };
      Object.assign(state, { order, shown, added, changed, selected, stamp, here, angle, inertia, torque, fields, reference, at_time, soft: frame.soft });
      if (frame.colours) state.colours = frame.colours;
      this.plotted = false;
      this.steps.show(frame.steps);
      this.shaft.show(frame);
      this.controls.build(frame);
      this.controls.show(fields, mistakes, stamp);
      this.figure.tell(mistakes[""] ?? "");
      this.duty.answered(stamp, mistakes[""] ?? "", frame.duty_step);
      put(this.driveName, drive);
      document.title = `softstart: ${(this.driveName.title = drive)}`;
      this.advice.classList.add("old"); // it is of the drive as it was when it was last at rest
    }
    if (recommendation !== undefined) {
      put(this.advice, recommendation);
      this.advice.classList.remove("old");
      state.recommended = frame.recommended;
      this.table.rest();
      const texts = [...plausibility_warnings, ...(assumed.length ? [`Assumed: ${assumed.join(", ")}.`] : [])];
      this.remarks.replaceChildren(...texts.map((text, i) => element("p", { class: i < plausibility_warnings.length ? "doubt" : "" }, text)));
    }
    if (frame.duty) this.duty.show(frame.duty);
    if (frame.keep) this.keep(frame.keep);
    this.map.take(frame);
    if (!number) return; // a quick frame: the figure alone
    this.number = number;
    this.waiting ||= requestAnimationFrame(() => this.draw());
  }

  // the cursor of the plots is at this instant: show the drive at it
  timed(t) {
    const [from, to] = this.plots.seen;
    this.scheme.show(this.state.traces.get(this.state.selected), t, to - from);
    this.player.show(t);
  }

  // size or colours have changed: draw everything again
  redraw() {
    this.plotted = false;
    this.map?.fade();
    this.duty?.lay();
    this.waiting ||= requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.waiting = 0;
    if (this.ended) return;
    this.table.show(this.state);
    if (!this.plotted) {
      this.plotted = true;
      this.plots.draw(this.state);
    }
    this.map.draw(this.state);
    if (this.number !== this.answered) {
      this.answered = this.number;
      this.send({ what: "drawn", number: this.number });
    }
  }

  end() {
    this.ended = true;
    this.resized.disconnect();
    for (const part of [this.theme, this.steps, this.player]) part.end();
    window.removeEventListener("hashchange", this.followed);
  }
}

// Takes frames of the server, keeps what they say, and draws it once a screen refresh.
import { Controls } from "./controls.js";
import { Figure } from "./figure.js";
import { GapMap } from "./map.js";
import { element } from "./numbers.js";
import { Player } from "./player.js";
import { Plots } from "./plots.js";
import { Scheme } from "./scheme.js";
import { Steps } from "./steps.js";
import { Table } from "./table.js";
import { Theme } from "./theme.js";

const KEPT = "softstart-bench";

export class Instrument {
  constructor(root, send) {
    this.send = send;
    this.state = { rows: new Map(), traces: new Map(), order: [], shown: [], selected: "", stamp: 0 };
    this.driveName = root.querySelector(".drive-name");
    this.waiting = 0;
    const say = (message) => this.say(message);
    this.theme = new Theme(root.querySelector(".theme"), () => this.redraw());
    this.scheme = new Scheme(root.querySelector(".controls"));
    this.remarks = root.querySelector(".controls").appendChild(element("div", { class: "remarks", role: "status" }));
    this.controls = new Controls(root.querySelector(".controls"), root.querySelector(".strategy"), root.querySelector(".units"), say);
    this.steps = new Steps(root.querySelector(".steps"), say);
    this.figure = new Figure(root.querySelector(".figure"), say);
    this.table = new Table(root.querySelector(".strategies"), this.theme, say);
    this.advice = root.querySelector(".advice");
    const windowed = (window) => say({ what: "window", begin: window?.[0] ?? 0, end: window?.[1] ?? 0 });
    this.plots = new Plots(root.querySelector(".plots"), this.theme, windowed, (t) => this.timed(t));
    this.player = new Player(root.querySelector(".player"), this.plots);
    this.map = new GapMap(root.querySelector(".map"), this.theme, say);
    this.resized = new ResizeObserver(() => this.redraw());
    for (const part of root.querySelectorAll("canvas")) this.resized.observe(part.parentElement);
  }

  // a page is loaded anew by its reader, or when the line was lost for long: it goes on with its drive
  hello() {
    let kept = null;
    try {
      kept = JSON.parse(sessionStorage.getItem(KEPT));
    } catch {
      // a browser that keeps nothing begins with the address, or with the drive of the server
    }
    this.say({ what: "hello", kept, link: location.hash.slice(1) });
    window.addEventListener("hashchange", (this.followed = () => this.say({ what: "hello", kept: null, link: location.hash.slice(1) })));
  }

  // in this tab, and in its address: a copied address brings back the same drive, strategies and settings
  keep(bench) {
    history.replaceState(history.state, "", `#${bench.link}`);
    try {
      sessionStorage.setItem(KEPT, JSON.stringify(bench));
    } catch {
      // see above
    }
  }

  // the stamp comes back with the first frame that knows of the message
  say(message) {
    const stamp = message.what === "hello" ? 0 : performance.now();
    this.send({ ...message, stamp });
    return stamp;
  }

  // numbers are shown at once; pictures wait for the next refresh of the screen, where only the newest counts
  take(number, frame) {
    const state = this.state;
    if (frame.order) {
      const known = new Set(frame.order);
      for (const name of state.rows.keys()) if (!known.has(name)) state.rows.delete(name);
      for (const name of state.traces.keys()) if (!known.has(name)) state.traces.delete(name);
      const { order, shown, added, changed, selected } = frame;
      Object.assign(state, { order, shown, added, changed, selected });
      state.stamp = frame.stamp;
      state.here = frame.here;
      this.map.show(frame.mapped);
      if (frame.other) this.forget();
      state.reference = frame.reference && { trace: state.reference?.trace, ...frame.reference };
      state.fields = frame.fields;
      this.steps.show(frame.steps);
      if (frame.groups) this.controls.machine(frame.groups);
      if (frame.strategy) this.controls.strategy(frame.strategy);
    }
    for (const row of frame.rows ?? []) state.rows.set(row.name, { ...state.rows.get(row.name), ...row });
    for (const [name, packed] of Object.entries(frame.traces ?? {})) {
      if (packed) state.traces.set(name, packed);
      else state.traces.delete(name);
      this.plotted = false;
    }
    if (frame.figure) {
      // a glance has shown it already, unless the start was too long for one
      if (this.version !== frame.version || frame.at_rest) this.figure.show(frame.figure);
      this.version = frame.version;
      this.stamp = frame.stamp;
    }
    if (frame.recommendation !== undefined || frame.order) this.advise(frame.recommendation);
    if (frame.recommendation !== undefined) this.table.rest();
    if (frame.remarks) this.remark(frame.remarks);
    if (frame.mistakes) this.figure.mistake(frame.mistakes[""] ?? "");
    if (frame.fields) this.controls.show(frame.fields, frame.mistakes, frame.stamp);
    if (frame.keep) this.keep(frame.keep);
    if (frame.drive !== undefined && this.driveName.textContent !== frame.drive) {
      this.driveName.textContent = this.driveName.title = frame.drive;
      document.title = `softstart: ${frame.drive}`;
    }
    this.map.take(frame);
    if (!number) return; // a glance: the figure alone
    this.number = number;
    if (frame.order) this.plotted = false;
    this.waiting ||= requestAnimationFrame(() => this.draw());
  }

  // another drive or chain was loaded: what is computed at rest is not known of it
  forget() {
    for (const [name, row] of this.state.rows) this.state.rows.set(name, { ...row, worn: null, settled: null, limits: "", flag: "" });
    this.map.forget();
  }

  // what is recommended, for the drive as it was when it was last at rest
  advise(text) {
    this.advice.classList.toggle("old", text === undefined);
    if (text !== undefined && this.advice.textContent !== text) this.advice.textContent = text;
  }

  // what can hardly be, and what is assumed of the machine
  remark({ doubts, assumed }) {
    const texts = [...doubts, ...(assumed.length ? [`Assumed: ${assumed.join(", ")}.`] : [])];
    this.remarks.replaceChildren(...texts.map((text, i) => element("p", { class: i < doubts.length ? "doubt" : "" }, text)));
  }

  // the plots read this instant: so stands the drive
  timed(t) {
    const [from, to] = this.plots.seen;
    this.scheme.show(this.state.traces.get(this.state.selected), t, to - from);
    this.player.show(t);
  }

  // size or colours have changed: everything anew
  redraw() {
    this.plotted = false;
    this.map?.fade();
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
    this.theme.end();
    this.steps.end();
    this.player.end();
    window.removeEventListener("hashchange", this.followed);
  }
}

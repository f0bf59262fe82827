// Below the plots: an instant that runs through the start, the window on it, and what is seen as files.
import { button, element, put, significant } from "./numbers.js";

const STEPS = 2000;
const SPEEDS = [1, 3, 10, 30, 100, 300, 1000];
const USUAL = 10;

export class Player {
  constructor(place, plots) {
    this.plots = plots;
    this.button = button("\u25b6\ufe0e", "Play", () => this.toggle());
    this.slider = element("input", { type: "range", min: 0, max: STEPS, step: 1, value: 0, "aria-label": "Instant of the start", oninput: () => {
      this.stop();
      const [from, to] = this.span();
      plots.hold(from + (this.slider.value / STEPS) * (to - from));
    } });
    this.speed = element("select", { "aria-label": "Play speed", title: "Play speed" }, ...SPEEDS.map((slower) => element("option", { value: slower, selected: slower === USUAL }, `1:${slower}`)));
    this.said = element("output", { class: "instant" });
    this.all = button("all", "The whole start, all of it (0)", () => plots.show(null));
    this.files = [
      button("PNG", "The plots as they are seen, as PNG", () => plots.canvas.toBlob((blob) => this.save("png", blob))),
      button("CSV", "The points that are seen, as CSV", () => this.save("csv", new Blob([plots.csv()], { type: "text/csv" })))];
    place.append(this.button, this.slider, this.said, this.speed,
      element("span", { role: "group", "aria-label": "Window in time" }, button("\u2212", "Zoom out (\u2212)", () => plots.zoom(2)), button("+", "Zoom in (+)", () => plots.zoom(0.5)), this.all),
      element("span", { role: "group", "aria-label": "What is seen, as a file" }, ...this.files));
    this.show(null);
  }

  // what is played: of the window that is seen, what lies within the start
  span() {
    const [from, to] = this.plots.seen;
    return [from, Math.min(to, this.plots.end)];
  }

  // the plots read another instant, or are seen through another window
  show(t) {
    const [from, to] = this.span();
    const { held, window, box } = this.plots;
    const share = held === null || to <= from ? 0 : Math.round(((held - from) / (to - from)) * STEPS);
    if (Number(this.slider.value) !== share) this.slider.value = share;
    put(this.said, t === null ? "" : `${significant(1000 * t, 4)} ms`);
    this.all.disabled = window === null;
    this.button.disabled = to <= from;
    for (const file of this.files) file.disabled = !box; // until a start is drawn
  }

  toggle() {
    if (this.playing) return this.stop();
    const [from, to] = this.span();
    const { held } = this.plots;
    this.plots.hold(held === null || held < from || held >= to ? from : held);
    this.name("\u23f8\ufe0e", "Pause");
    this.last = performance.now();
    this.playing = requestAnimationFrame((now) => this.step(now));
  }

  name(sign, title) {
    this.button.textContent = sign;
    this.button.title = this.button.ariaLabel = title;
  }

  step(now) {
    const to = this.span()[1];
    const passed = Math.max(now - this.last, 0) / 1000 / this.speed.value;
    this.last = now;
    const drawn = this.plots.box; // not for a moment, where another strategy was selected
    const t = Math.min(this.plots.held + passed, to);
    if (drawn) this.plots.hold(t);
    if (drawn && t >= to) this.stop();
    else this.playing = requestAnimationFrame((next) => this.step(next));
  }

  stop() {
    cancelAnimationFrame(this.playing);
    this.playing = 0;
    this.name("\u25b6\ufe0e", "Play");
  }

  save(ending, blob) {
    const name = document.title.replace(/^softstart: /, "").replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "") || "start";
    const link = element("a", { href: URL.createObjectURL(blob), download: `${name}.${ending}` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  end() {
    this.stop();
  }
}

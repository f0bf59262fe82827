// The live part of the page: builds its parts once, then only changes numbers and draws.
import { Instrument } from "softstart-page";

export default {
  template: `
<div class="instrument">
  <header class="topbar">
    <strong class="brand">softstart</strong>
    <span class="drive-name"></span>
    <span class="steps" role="group" aria-label="Undo and redo"></span>
    <div class="units fields"></div>
    <div class="theme shaft" role="radiogroup" aria-label="Values at the shaft of"></div>
    <div class="theme colours" role="radiogroup" aria-label="Colours"></div>
  </header>
  <nav class="controls fields" aria-label="Parameters of the drive"></nav>
  <main class="centre">
    <section class="plots"><canvas tabindex="0" role="application" aria-label="Torques, speeds and twist over time: arrow keys move the instant, plus and minus the window, 0 shows all"></canvas></section>
    <section class="player" role="group" aria-label="Instant and window"></section>
    <section class="duty" aria-label="Duty"></section>
    <section class="strategies"></section>
    <section class="advice" role="status"></section>
  </main>
  <aside class="side">
    <section class="figure"></section>
    <section class="duty-figure" aria-label="Figures of the duty"></section>
    <section class="duty-side" aria-label="Selected step and duty">
      <div class="fields duty-fields"></div>
      <div class="duty-files" role="group" aria-label="The duty as files"></div>
    </section>
    <section class="strategy fields" aria-label="Parameters of the selected strategy"></section>
    <section class="map"></section>
    <section class="panels"><slot></slot></section>
  </aside>
</div>`,
  mounted() {
    this.instrument = new Instrument(this.$el, (message) => this.$emit("act", message));
    this.instrument.hello();
  },
  unmounted() {
    this.instrument.end();
  },
  methods: {
    frame(number, frame) {
      this.instrument?.take(number, frame);
    },
  },
};

// Light and dark: follows the system unless told otherwise; the choice stays in this browser.
import { element, stored } from "./numbers.js";

const CHOICES = [["auto", "Auto"], ["light", "Light"], ["dark", "Dark"]];
const KEY = "softstart-colours";

// each has one hue in light and dark; the least difference of two, with full sight before all, with any colour blindness
// too, is as large as a search for twelve found (tests/softstart/page/test_palette.py)
const LIGHT = ["#2a9393", "#ba8a49", "#2526e3", "#922544", "#597203", "#c4505b", "#9b4bae", "#1f4e01", "#f64cc2", "#9682f7", "#610157", "#671ba9"];
const DARK = ["#6ac2c1", "#e3970d", "#3753fe", "#fe4179", "#b3d26f", "#955054", "#eea8ff", "#84fe41", "#c00093", "#967ffe", "#b37fa9", "#844fc3"];

export class Theme {
  constructor(place, changed) {
    this.changed = changed;
    this.buttons = CHOICES.map(([choice, text]) => {
      const input = element("input", { type: "radio", name: "theme", value: choice, onchange: () => this.choose(choice) });
      place.append(element("label", {}, input, element("span", {}, text)));
      return input;
    });
    const kept = stored("localStorage", KEY);
    this.observer = new MutationObserver(() => this.read());
    this.observer.observe(document.body, { attributes: true, attributeFilter: ["class"] });
    this.choose(CHOICES.some(([choice]) => choice === kept) ? kept : "auto");
  }

  choose(choice) {
    for (const button of this.buttons) button.checked = button.value === choice;
    stored("localStorage", KEY, choice);
    window.Quasar?.Dark.set(choice === "auto" ? "auto" : choice === "dark");
    this.read();
  }

  read() {
    this.dark = document.body.classList.contains("body--dark");
    const style = getComputedStyle(document.body);
    const names = ["font", "ink", "quiet", "line", "kept", "grid", "paper", "shade", "accent", "warn"];
    this.colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
    this.font = this.colours.font;
    this.changed();
  }

  // the colour of a strategy is that of its place in the table as it was made
  strategy(index) {
    const palette = this.dark ? DARK : LIGHT;
    return palette[index % palette.length];
  }

  end() {
    this.observer.disconnect();
  }
}

// Light and dark: follows the system unless told otherwise; the choice stays in this browser.
import { element } from "./numbers.js";

const CHOICES = [["auto", "Auto"], ["light", "Light"], ["dark", "Dark"]];
const KEY = "softstart-colours";

// the least difference of two, with full sight or any colour blindness, is as large as twelve allow; the first ones
// differ most (tests/softstart/page/test_palette.py)
const LIGHT = ["#3c0fe1", "#c33c00", "#7887d2", "#691e3c", "#c37887", "#961e00", "#a54bff", "#4b00a5", "#f05a3c", "#693c78", "#6969a5", "#a55a69"];
const DARK = ["#ff870f", "#c3f0e1", "#8778b4", "#b4a5c3", "#d21eff", "#f03c1e", "#ffc30f", "#e178ff", "#009669", "#00f096", "#4bc378", "#d2c3f0"];

export class Theme {
  constructor(place, changed) {
    this.changed = changed;
    this.buttons = CHOICES.map(([choice, text]) => {
      const input = element("input", { type: "radio", name: "theme", value: choice });
      input.addEventListener("change", () => this.choose(choice));
      place.append(element("label", {}, input, element("span", {}, text)));
      return input;
    });
    let kept = "auto";
    try {
      kept = localStorage.getItem(KEY) ?? "auto";
    } catch {
      // a browser that keeps nothing follows the system
    }
    this.observer = new MutationObserver(() => this.read());
    this.observer.observe(document.body, { attributes: true, attributeFilter: ["class"] });
    this.choose(CHOICES.some(([choice]) => choice === kept) ? kept : "auto");
  }

  choose(choice) {
    for (const button of this.buttons) button.checked = button.value === choice;
    try {
      localStorage.setItem(KEY, choice);
    } catch {
      // see above
    }
    window.Quasar?.Dark.set(choice === "auto" ? "auto" : choice === "dark");
    this.read();
  }

  read() {
    this.dark = document.body.classList.contains("body--dark");
    const style = getComputedStyle(document.body);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    const names = ["ink", "quiet", "line", "grid", "paper", "shade", "accent", "torque", "motor", "load", "warn"];
    this.colours = Object.fromEntries(names.map((name) => [name, colour(name)]));
    this.font = style.getPropertyValue("--font").trim();
    const palette = this.dark ? DARK : LIGHT;
    palette.forEach((tone, index) => document.body.style.setProperty(`--strategy-${index}`, tone));
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

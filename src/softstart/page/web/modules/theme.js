// Light and dark: follows the system unless told otherwise; the choice stays in this browser.
import { element } from "./numbers.js";

const CHOICES = [["auto", "Auto"], ["light", "Light"], ["dark", "Dark"]];
const KEY = "softstart-colours";

// Okabe-Ito and relatives, told apart by colour-blind readers; the dark ones are lighter
const LIGHT = ["#0072b2", "#d55e00", "#009e73", "#b5498e", "#b87700", "#2b9bd6", "#444b53", "#8c6d31", "#6a51a3", "#5b8c00", "#c2334d", "#007f86"];
const DARK = ["#5ab0ea", "#ff8c42", "#2fc79a", "#e693c4", "#f0b43c", "#8fd0f7", "#c3cad2", "#c9a961", "#b3a0e6", "#a5cc4f", "#ff7b8d", "#45c4c9"];

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

// K_dyn over gap and load inertia; a press goes there, arrow keys walk.
import { element, fixed, label, sharp, significant, ticks } from "./numbers.js";

// cividis, thinned: even in lightness, the same to colour-blind readers
const STOPS = [[0, 34, 78], [42, 63, 109], [87, 93, 109], [112, 113, 115], [138, 134, 120], [165, 156, 116], [195, 179, 105], [225, 204, 85], [254, 232, 56]];
const LEFT = 52, RIGHT = 46, TOP = 8, BOTTOM = 34;

function shadeOf(share) {
  const at = Math.min(Math.max(share, 0), 1) * (STOPS.length - 1);
  const i = Math.min(Math.floor(at), STOPS.length - 2);
  const mix = STOPS[i].map((value, k) => Math.round(value + (at - i) * (STOPS[i + 1][k] - value)));
  return `rgb(${mix})`;
}

export class GapMap {
  constructor(place, theme, say) {
    this.theme = theme;
    this.say = say;
    this.title = element("h2", {}, "K", element("sub", {}, "dyn"), " over gap and load inertia");
    this.said = element("span", { class: "said" });
    this.keep = element("input", { type: "checkbox", id: "map-keep" });
    this.keep.addEventListener("change", () => this.say({ what: "keep", kept: this.keep.checked }));
    const keep = element("label", { class: "keep", title: "Ticked: the controller stays as it is set up for the drive of the moment while gap and inertia change" }, this.keep, "controller kept");
    this.canvas = element("canvas", {
      tabindex: 0,
      role: "application",
      "aria-label": "Map of K dyn over gap and load inertia: arrow keys go to the neighbouring drive",
    });
    const holder = element("div", { class: "map-canvas" }, this.canvas);
    place.append(element("div", { class: "map-head" }, this.title, keep), holder, this.said);
    this.canvas.addEventListener("pointerdown", (event) => this.press(event));
    this.canvas.addEventListener("pointermove", (event) => this.point(event));
    for (const way of ["pointerup", "pointercancel"]) this.canvas.addEventListener(way, () => (this.pressed = false));
    this.canvas.addEventListener("pointerleave", () => (this.said.textContent = ""));
    this.canvas.addEventListener("keydown", (event) => this.walk(event));
  }

  // a map comes row by row, and those of an earlier one stay pale until they are replaced
  take(frame) {
    const { map_is_old: old } = frame;
    if (old !== undefined && this.rows && old !== this.old) {
      this.old = old;
      this.fresh = new Set(old ? [] : this.rows.keys());
      this.fade();
    }
    if (!frame.map_row) return;
    const axes = `${frame.map.gaps}|${frame.map.inertias}`;
    if (this.axes !== axes) {
      this.axes = axes;
      this.rows = frame.map.inertias.map(() => null);
      this.fresh = new Set();
    }
    this.head = frame.map;
    this.rows[frame.map_row.index] = frame.map_row.k;
    this.fresh.add(frame.map_row.index);
    this.old = undefined;
    this.fade();
  }

  place(gap, inertia) {
    const { gaps, inertias } = this.head;
    const { x, y, w, h } = this.box;
    const [low, high] = [Math.log(inertias[0]), Math.log(inertias.at(-1))];
    return [
      x + ((gap - gaps[0]) / (gaps.at(-1) - gaps[0])) * w,
      y + h - ((Math.log(inertia) - low) / (high - low)) * h,
    ];
  }

  // gap and inertia of the node nearest to a place on the canvas
  node(px, py) {
    if (!this.head || !this.box) return null;
    const { gaps, inertias } = this.head;
    const { x, y, w, h } = this.box;
    if (px < x - 6 || px > x + w + 6 || py < y - 6 || py > y + h + 6) return null;
    const column = Math.round(((px - x) / w) * (gaps.length - 1));
    const row = Math.round(((y + h - py) / h) * (inertias.length - 1));
    return [Math.min(Math.max(column, 0), gaps.length - 1), Math.min(Math.max(row, 0), inertias.length - 1)];
  }

  press(event) {
    const node = event.button === 0 && this.node(event.offsetX, event.offsetY);
    if (!node) return;
    this.pressed = true;
    this.canvas.setPointerCapture(event.pointerId);
    this.go(node);
  }

  go([column, row]) {
    const asked = this.say({ what: "jump", gap: this.head.gaps[column], inertia: this.head.inertias[row] });
    this.aim = { asked, node: [column, row] };
  }

  point(event) {
    const node = this.node(event.offsetX, event.offsetY);
    if (!node) {
      this.said.textContent = "";
      return;
    }
    if (this.pressed && String(node) !== String(this.aim.node)) this.go(node);
    const k = this.rows[node[1]]?.[node[0]];
    this.said.textContent = `\u03b4 ${significant(this.head.gaps[node[0]], 4)} rad   J\u2082 ${significant(this.head.inertias[node[1]], 4)} kg m\u00b2   K ${fixed(k, 3)}`;
  }

  walk(event) {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const step = steps[event.key];
    if (!step || !this.head || !this.here) return;
    event.preventDefault();
    const node = this.aim?.asked > this.stamp ? this.aim.node : this.nodeHere(); // keys are quicker than answers
    const { gaps, inertias } = this.head;
    const to = [node[0] + step[0], node[1] + step[1]];
    if (to[0] >= 0 && to[0] < gaps.length && to[1] >= 0 && to[1] < inertias.length) this.go(to);
  }

  nodeHere() {
    const [px, py] = this.place(...this.here);
    const { x, y, w, h } = this.box;
    return this.node(Math.min(Math.max(px, x), x + w), Math.min(Math.max(py, y), y + h));
  }

  // forget the picture: rows, size or colours have changed
  fade() {
    this.picture = null;
  }

  draw(state) {
    this.stamp = state.stamp;
    if (!this.head) return;
    const here = String(state.here);
    if (this.picture && here === this.drawn) return;
    this.drawn = here;
    this.here = state.here;
    const sheet = sharp(this.canvas);
    if (!sheet) return;
    if (!this.picture) this.paint(sheet);
    sheet.pen.drawImage(this.picture, 0, 0, sheet.width, sheet.height);
    if (this.here) this.mark(sheet.pen);
  }

  // the map without the mark, on a canvas of its own
  paint({ width, height }) {
    const ratio = window.devicePixelRatio || 1;
    this.picture = document.createElement("canvas");
    this.picture.width = Math.round(width * ratio);
    this.picture.height = Math.round(height * ratio);
    const pen = this.picture.getContext("2d");
    pen.scale(ratio, ratio);
    const { gaps, inertias } = this.head;
    const { line, paper } = this.theme.colours;
    pen.font = `11px ${this.theme.font}`;
    const box = { x: LEFT, y: TOP, w: width - LEFT - RIGHT, h: height - TOP - BOTTOM };
    this.box = box;
    const known = this.rows.filter(Boolean).flat().filter((k) => k !== null);
    const [low, high] = [Math.min(...known), Math.max(...known)];
    const [dx, dy] = [box.w / (gaps.length - 1), box.h / (inertias.length - 1)];
    pen.save();
    pen.beginPath();
    pen.rect(box.x, box.y, box.w, box.h);
    pen.clip();
    this.rows.forEach((row, j) => {
      pen.globalAlpha = this.fresh.has(j) ? 1 : 0.45;
      row?.forEach((k, i) => {
        const [cx, cy] = [box.x + i * dx, box.y + box.h - j * dy];
        pen.fillStyle = k === null ? paper : shadeOf((k - low) / (high - low || 1));
        pen.fillRect(cx - dx / 2 - 0.3, cy - dy / 2 - 0.3, dx + 0.6, dy + 0.6);
      });
    });
    pen.restore();
    pen.strokeStyle = line;
    pen.lineWidth = 1;
    pen.strokeRect(box.x + 0.5, box.y + 0.5, box.w - 1, box.h - 1);
    this.scales(pen, box, gaps, inertias, low, high);
  }

  // where the drive is, kept at the edge when it is beyond
  mark(pen) {
    const { x, y, w, h } = this.box;
    const [px, py] = this.place(...this.here);
    const [cx, cy] = [Math.min(Math.max(px, x), x + w), Math.min(Math.max(py, y), y + h)];
    for (const [colour, thick] of [["#ffffff", 4.5], ["#c2182b", 2]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = thick;
      pen.beginPath();
      pen.arc(cx, cy, 5, 0, 7);
      for (const [ux, uy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
        pen.moveTo(cx + 5 * ux, cy + 5 * uy);
        pen.lineTo(cx + 11 * ux, cy + 11 * uy);
      }
      pen.stroke();
    }
  }

  scales(pen, box, gaps, inertias, low, high) {
    const { quiet, line } = this.theme.colours;
    pen.fillStyle = quiet;
    pen.textBaseline = "alphabetic";
    const marks = ticks(gaps[0], gaps.at(-1), Math.round(box.w / 60));
    pen.textAlign = "center";
    for (const mark of marks) {
      pen.fillText(label(mark, marks.digits), this.place(mark, inertias[0])[0], box.y + box.h + 14);
    }
    pen.fillText("gap \u03b4, rad", box.x + box.w / 2, box.y + box.h + 29);
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (let row = 0; row < inertias.length; row += Math.max(1, Math.round(inertias.length / Math.max(2, box.h / 34)))) {
      pen.fillText(significant(inertias[row], 3), box.x - 6, box.y + box.h - (row / (inertias.length - 1)) * box.h);
    }
    pen.save();
    pen.translate(10, box.y + box.h / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText("J\u2082, kg m\u00b2", 0, 0);
    pen.restore();
    const x = box.x + box.w + 8;
    for (let i = 0; i < box.h; i++) {
      pen.fillStyle = shadeOf(1 - i / box.h);
      pen.fillRect(x, box.y + i, 8, 1.5);
    }
    pen.strokeStyle = line;
    pen.strokeRect(x + 0.5, box.y + 0.5, 7, box.h - 1);
    pen.fillStyle = quiet;
    pen.textAlign = "left";
    if (high >= low) {
      const marks = ticks(low, high, Math.max(2, Math.round(box.h / 40)));
      for (const mark of marks) {
        const share = (mark - low) / (high - low || 1);
        pen.fillText(label(mark, marks.digits ?? 3), x + 12, box.y + box.h * (1 - share));
      }
    }
  }
}

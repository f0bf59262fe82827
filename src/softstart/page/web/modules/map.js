// K_dyn over gap and load inertia, in colours that mean the same for every strategy and drive, with contours and
// the limit of the drive; or its difference to a map that was kept. A press goes there, arrow keys walk.
import { element, fixed, label, sharp, significant, ticks } from "./numbers.js";

// cividis, thinned: even in lightness, the same to colour-blind readers
const STOPS = [[0, 34, 78], [42, 63, 109], [87, 93, 109], [112, 113, 115], [138, 134, 120], [165, 156, 116], [195, 179, 105], [225, 204, 85], [254, 232, 56]];
// gentler is blue, harsher is red, equal is white
const WAYS = [[33, 102, 172], [103, 169, 207], [209, 229, 240], [247, 247, 247], [253, 219, 199], [239, 138, 98], [178, 24, 43]];
const LEFT = 60, RIGHT = 46, TOP = 8, BOTTOM = 34;
const K = {
  stops: STOPS,
  share: (k) => Math.log(k / 0.75) / Math.log(8),
  levels: [0.8, 0.9, 1, 1.1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 15, 20, 30, 50, 100],
  marks: [0.8, 1, 1.2, 1.5, 2, 3, 4, 6],
  pale: (k) => k < 2.2,
};
const MORE = {
  stops: WAYS,
  share: (more) => 0.5 + 0.5 * Math.tanh(more),
  levels: [-4, -2, -1, -0.5, -0.2, -0.1, 0, 0.1, 0.2, 0.5, 1, 2, 4],
  marks: [-1, -0.5, -0.2, 0, 0.2, 0.5, 1],
  pale: (more) => Math.abs(more) > 0.8,
};

function shadeOf({ stops, share }, value) {
  const at = Math.min(Math.max(share(value), 0), 1) * (stops.length - 1);
  const i = Math.min(Math.floor(at), stops.length - 2);
  const mix = stops[i].map((tone, k) => Math.round(tone + (at - i) * (stops[i + 1][k] - tone)));
  return `rgb(${mix})`;
}

// pieces of the line on which rows of numbers pass a level, in steps of the grid (marching squares)
export function contour(rows, level) {
  const pieces = [];
  for (let j = 0; j + 1 < rows.length; j++) {
    for (let i = 0; rows[j] && rows[j + 1] && i + 1 < rows[j].length; i++) {
      const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(([x, y]) => [x, y, rows[y][x]]);
      if (corners.some(([, , value]) => value === null)) continue;
      const passed = [];
      corners.forEach(([x, y, value], side) => {
        const [nx, ny, next] = corners[(side + 1) % 4];
        if (value < level === next < level) return;
        const share = (level - value) / (next - value);
        passed.push([x + share * (nx - x), y + share * (ny - y)]);
      });
      for (let k = 0; k + 1 < passed.length; k += 2) pieces.push([passed[k], passed[k + 1]]);
    }
  }
  return pieces;
}

export class GapMap {
  constructor(place, theme, say) {
    this.theme = theme;
    this.say = say;
    this.whole = place;
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
    this.other = element("input", { type: "checkbox", id: "map-other" });
    this.other.addEventListener("change", () => this.pin());
    this.otherName = element("span", {}, "difference");
    const other = element("label", { class: "keep", title: "Ticked: this map is kept, and that of the next strategy is shown as its difference to it" }, this.other, this.otherName);
    const holder = element("div", { class: "map-canvas" }, this.canvas);
    place.append(element("div", { class: "map-head" }, this.title, element("span", {}, keep, other)), holder, this.said);
    this.canvas.addEventListener("pointerdown", (event) => this.press(event));
    this.canvas.addEventListener("pointermove", (event) => this.point(event));
    for (const way of ["pointerup", "pointercancel"]) this.canvas.addEventListener(way, () => (this.pressed = false));
    this.canvas.addEventListener("pointerleave", () => (this.said.textContent = ""));
    this.canvas.addEventListener("keydown", (event) => this.walk(event));
  }

  // a chain without gaps has none
  show(mapped) {
    if (this.whole.hidden === mapped) this.whole.hidden = !mapped;
  }

  forget() {
    Object.assign(this, { head: null, axes: null, picture: null });
    const sheet = sharp(this.canvas);
    sheet?.pen.clearRect(0, 0, sheet.width, sheet.height);
  }

  // a map comes row by row, and those of an earlier one stay pale until they are replaced
  take(frame) {
    const { map_is_old: old } = frame;
    if (old !== undefined && this.rows && old !== this.old) {
      this.old = old;
      this.fresh = new Set(old ? [] : this.rows.keys());
      this.hold();
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
    this.hold();
    this.fade();
  }

  // the map of this strategy is kept, to show that of another one as a difference to it
  pin() {
    this.pinned = null;
    this.hold();
    this.fade();
    this.redraw();
  }

  // ticked before the first row or before all have come, the first map that is whole is kept
  hold() {
    if (this.rows && this.other.checked && !this.pinned && this.fresh.size === this.rows.length) this.pinned = { head: this.head, rows: [...this.rows] };
  }

  // numbers of the map, as they are drawn
  shown() {
    const { pinned, head } = this;
    if (pinned && (pinned.head.of !== head.of || String(pinned.head.gaps) !== String(head.gaps))) {
      this.pinned = null; // another drive
      this.other.checked = false;
    }
    const against = this.pinned && this.pinned.head.strategy !== head.strategy;
    this.otherName.textContent = this.pinned ? `less ${this.pinned.head.strategy}` : "difference";
    if (!against) return [this.rows, K];
    const rows = this.rows.map((row, j) => row?.map((k, i) => (k === null || this.pinned.rows[j][i] === null ? null : k - this.pinned.rows[j][i])));
    return [rows, MORE];
  }

  redraw() {
    if (this.state) requestAnimationFrame(() => this.draw(this.state));
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
    const other = this.pinned ? this.pinned.rows[node[1]]?.[node[0]] : undefined;
    const against = other === undefined || this.pinned.head.strategy === this.head.strategy ? "" : ` (${this.pinned.head.strategy}: ${fixed(other, 3)})`;
    this.said.textContent = `${this.head.symbols[0]} ${significant(this.head.gaps[node[0]], 4)} ${this.head.unit}   ${this.head.symbols[1]} ${significant(this.head.inertias[node[1]], 4)} kg m\u00b2   K ${fixed(k, 3)}${against}`;
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
    this.state = state;
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
    const [rows, scale] = this.shown();
    const [dx, dy] = [box.w / (gaps.length - 1), box.h / (inertias.length - 1)];
    pen.save();
    pen.beginPath();
    pen.rect(box.x, box.y, box.w, box.h);
    pen.clip();
    rows.forEach((row, j) => {
      pen.globalAlpha = this.fresh.has(j) ? 1 : 0.45;
      row?.forEach((k, i) => {
        const [cx, cy] = [box.x + i * dx, box.y + box.h - j * dy];
        pen.fillStyle = k === null ? paper : shadeOf(scale, k);
        pen.fillRect(cx - dx / 2 - 0.3, cy - dy / 2 - 0.3, dx + 0.6, dy + 0.6);
      });
    });
    pen.globalAlpha = 1;
    this.contours(pen, box, rows, scale, [dx, dy]);
    pen.restore();
    pen.strokeStyle = line;
    pen.lineWidth = 1;
    pen.strokeRect(box.x + 0.5, box.y + 0.5, box.w - 1, box.h - 1);
    this.scales(pen, box, gaps, inertias, scale);
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

  contours(pen, box, rows, scale, [dx, dy]) {
    const at = ([i, j]) => [box.x + i * dx, box.y + box.h - j * dy];
    const drawn = (pieces, colour, thick) => {
      pen.strokeStyle = colour;
      pen.lineWidth = thick;
      pen.beginPath();
      for (const [from, to] of pieces) {
        pen.moveTo(...at(from));
        pen.lineTo(...at(to));
      }
      pen.stroke();
    };
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const taken = [];
    for (const level of scale.levels) {
      const pieces = contour(rows, level);
      if (!pieces.length) continue;
      const colour = scale.pale(level) ? "rgba(255, 255, 255, 0.85)" : "rgba(0, 0, 0, 0.65)";
      drawn(pieces, colour, level === (scale === K ? 1 : 0) ? 1.8 : 0.8);
      const places = pieces.map(([from]) => at(from)).filter(([x, y]) => x > box.x + 18 && x < box.x + box.w - 18 && y > box.y + 9 && y < box.y + box.h - 9);
      const free = places.find(([x, y]) => taken.every(([ox, oy]) => Math.abs(x - ox) > 34 || Math.abs(y - oy) > 14));
      if (!free) continue;
      taken.push(free);
      pen.fillStyle = shadeOf(scale, level);
      pen.fillRect(free[0] - 11, free[1] - 6, 22, 12);
      pen.fillStyle = colour;
      pen.fillText(String(level).replace("-", "\u2212"), ...free);
    }
    const { limit } = this.head;
    if (!limit || scale !== K) return;
    const pieces = contour(rows.map((row, j) => row?.map((k) => (k === null ? null : k / limit[j]))), 1);
    drawn(pieces, "#ffffff", 4);
    drawn(pieces, this.theme.colours.warn, 2);
  }

  scales(pen, box, gaps, inertias, scale) {
    const { quiet, line } = this.theme.colours;
    pen.fillStyle = quiet;
    pen.textBaseline = "alphabetic";
    const marks = ticks(gaps[0], gaps.at(-1), Math.round(box.w / 60));
    pen.textAlign = "center";
    for (const mark of marks) {
      pen.fillText(label(mark, marks.digits), this.place(mark, inertias[0])[0], box.y + box.h + 14);
    }
    pen.fillText(`${this.head.labels[0]}, ${this.head.unit}`, box.x + box.w / 2, box.y + box.h + 29);
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (let row = 0; row < inertias.length; row += Math.max(1, Math.round(inertias.length / Math.max(2, box.h / 34)))) {
      pen.fillText(significant(inertias[row], 3), box.x - 6, box.y + box.h - (row / (inertias.length - 1)) * box.h);
    }
    pen.save();
    pen.translate(10, box.y + box.h / 2);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText(`${this.head.labels[1]}, kg m\u00b2`, 0, 0);
    pen.restore();
    const x = box.x + box.w + 8;
    const { stops } = scale;
    for (let i = 0; i < box.h; i++) {
      pen.fillStyle = shadeOf({ stops, share: (value) => value }, 1 - i / box.h);
      pen.fillRect(x, box.y + i, 8, 1.5);
    }
    pen.strokeStyle = line;
    pen.strokeRect(x + 0.5, box.y + 0.5, 7, box.h - 1);
    pen.fillStyle = quiet;
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    for (const mark of scale.marks) pen.fillText(String(mark).replace("-", "\u2212"), x + 12, box.y + box.h * (1 - scale.share(mark)));
  }
}

// K_dyn over gap and load inertia, in colours that mean the same for every strategy and drive, with the limit of
// the drive; or its difference to a map that was kept. A press goes there, arrow keys walk.
import { element, fixed, label, put, sharp, significant, ticks, write } from "./numbers.js";

const LEFT = 60, RIGHT = 46, TOP = 8, BOTTOM = 34;
// cividis, thinned: even in lightness, the same to colour-blind readers
const K = {
  stops: [[0, 34, 78], [42, 63, 109], [87, 93, 109], [112, 113, 115], [138, 134, 120], [165, 156, 116], [195, 179, 105], [225, 204, 85], [254, 232, 56]],
  share: (k) => Math.log(k / 0.75) / Math.log(8),
  marks: [0.8, 1, 1.2, 1.5, 2, 3, 4, 6],
  dark: (k) => k < 2.2,
};
// of a difference: a lower K is blue, a higher one red, an equal one white
const MORE = {
  stops: [[33, 102, 172], [103, 169, 207], [209, 229, 240], [247, 247, 247], [253, 219, 199], [239, 138, 98], [178, 24, 43]],
  share: (more) => 0.5 + 0.5 * Math.tanh(more),
  marks: [-1, -0.5, -0.2, 0, 0.2, 0.5, 1],
  dark: (more) => Math.abs(more) > 0.8,
};
const inside = (value, low, high) => Math.min(Math.max(value, low), high);

function colourOf({ stops }, share) {
  const at = inside(share, 0, 1) * (stops.length - 1);
  const i = Math.min(Math.floor(at), stops.length - 2);
  return `rgb(${stops[i].map((tone, k) => Math.round(tone + (at - i) * (stops[i + 1][k] - tone)))})`;
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
    Object.assign(this, { theme, say, whole: place, rows: [] });
    this.said = element("span", { class: "said" });
    this.canvas = element("canvas", {
      tabindex: 0,
      role: "application",
      "aria-label": "Map of K dyn over gap and load inertia: arrow keys go to the neighbouring drive",
      onpointerdown: (event) => this.press(event),
      onpointermove: (event) => this.point(event),
      onpointerup: (event) => this.release(event),
      onpointercancel: () => (this.pressed = false),
      onpointerleave: () => put(this.said, ""),
      onkeydown: (event) => this.walk(event),
    });
    const box = (id, title, onchange, text) => element("label", { class: "keep", title }, element("input", { type: "checkbox", id, onchange }), text);
    const keep = box("map-keep", "Ticked: the controller stays as it is set up for the drive of the moment while gap and inertia change",
      ({ target }) => say({ what: "fix", fixed: target.checked }), "controller kept");
    this.otherName = element("span", {}, "difference");
    const other = box("map-other", "Ticked: this map is kept, and that of the next strategy is shown as its difference to it", () => this.pin(), this.otherName);
    this.other = other.firstChild;
    const title = element("h2", {}, "K", element("sub", {}, "dyn"), " over gap and load inertia");
    place.append(element("div", { class: "map-head" }, title, element("span", {}, keep, other)), element("div", { class: "map-canvas" }, this.canvas), this.said);
  }

  // all rows have come
  get ready() {
    return this.rows.length > 0 && this.rows.every((row) => row?.fresh);
  }

  // a map comes row by row, and those of an earlier one stay pale until they are replaced
  take({ map_is_old: old, map, map_row: row, mapped }) {
    if (mapped !== undefined) this.whole.hidden = !mapped; // a chain without gaps has none
    if (old && this.ready) for (const one of this.rows) one.fresh = false;
    else if (row) {
      if (String(this.head?.gaps) !== String(map.gaps) || String(this.head?.inertias) !== String(map.inertias)) this.rows = map.inertias.map(() => null);
      this.head = map;
      this.rows[row.index] = Object.assign(row.k, { fresh: true });
    } else return;
    this.fade();
  }

  // the map of this strategy is kept, to show that of another one as a difference to it
  pin() {
    this.pinned = null;
    this.fade();
    if (this.state) requestAnimationFrame(() => this.draw(this.state));
  }

  // ticked before all rows have come, the first map that is whole is kept; one of another drive is let go
  fade() {
    this.picture = null;
    if (this.other.checked && !this.pinned && this.ready) this.pinned = { head: this.head, rows: [...this.rows] };
    if (this.pinned && (this.pinned.head.of !== this.head.of || String(this.pinned.head.gaps) !== String(this.head.gaps))) {
      this.pinned = null;
      this.other.checked = false;
    }
    put(this.otherName, this.pinned ? `less ${this.pinned.head.strategy}` : "difference");
  }

  // the rows of the map that is compared with, if there is one
  get against() {
    return this.pinned && this.pinned.head.strategy !== this.head.strategy ? this.pinned.rows : null;
  }

  // where a gap and inertia are on the canvas, at the edge if they are beyond
  place(gap, inertia) {
    const { gaps, inertias } = this.head;
    const { w, h } = this.box;
    const across = (gap - gaps[0]) / (gaps.at(-1) - gaps[0]);
    const up = Math.log(inertia / inertias[0]) / Math.log(inertias.at(-1) / inertias[0]);
    return [LEFT + inside(across, 0, 1) * w, TOP + h - inside(up, 0, 1) * h];
  }

  // column and row of the node nearest to a place on the canvas
  node(px, py) {
    if (!this.head || !this.box) return null;
    const { gaps, inertias } = this.head;
    const { w, h } = this.box;
    if (px < LEFT - 6 || px > LEFT + w + 6 || py < TOP - 6 || py > TOP + h + 6) return null;
    const near = (share, count) => inside(Math.round(share * (count - 1)), 0, count - 1);
    return [near((px - LEFT) / w, gaps.length), near((TOP + h - py) / h, inertias.length)];
  }

  press(event) {
    const node = event.button === 0 && this.node(event.offsetX, event.offsetY);
    if (!node) return;
    this.pressed = true;
    this.canvas.setPointerCapture(event.pointerId);
    // a finger may be about to scroll: it goes there when it is lifted, or moves across
    if (event.pointerType === "touch") this.aim = { asked: -1, node, x: event.offsetX, y: event.offsetY };
    else this.go(node);
  }

  release(event) {
    const node = this.pressed && this.aim.asked < 0 && this.node(event.offsetX, event.offsetY);
    this.pressed = false;
    if (node) this.go(node);
  }

  go([column, row]) {
    const asked = this.say({ what: "jump", gap: this.head.gaps[column], inertia: this.head.inertias[row] });
    this.aim = { asked, node: [column, row] };
  }

  point(event) {
    const node = this.node(event.offsetX, event.offsetY);
    if (!node) return put(this.said, "");
    const [column, row] = node;
    const { asked, x, y } = this.aim ?? {};
    const scrolls = asked < 0 && Math.abs(event.offsetY - y) >= Math.abs(event.offsetX - x);
    if (this.pressed && !scrolls && String(node) !== String(this.aim.node)) this.go(node);
    const { gaps, inertias, symbols } = this.head;
    const [unit, size] = this.state.angle;
    const other = this.against ? ` (${this.pinned.head.strategy}: ${fixed(this.against[row][column], 3)})` : "";
    put(this.said, `${symbols[0]} ${significant(gaps[column] / size, 4)} ${unit}   ${symbols[1]} ${significant(inertias[row] / this.state.inertia, 4)} kg m\u00b2   K ${fixed(this.rows[row]?.[column], 3)}${other}`);
  }

  walk(event) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!step || !this.head || !this.state?.here) return;
    event.preventDefault();
    const node = this.aim?.asked > this.state.stamp ? this.aim.node : this.node(...this.place(...this.state.here)); // keys are quicker than answers
    const to = [node[0] + step[0], node[1] + step[1]];
    if (this.rows[to[1]] !== undefined && this.head.gaps[to[0]] !== undefined) this.go(to);
  }

  draw(state) {
    this.state = state;
    if (String(state.angle) !== this.seen) this.picture = null; // nodes and messages are in rad, labels are not
    if (!this.head || !state.angle || (this.picture && String(state.here) === this.drawn)) return;
    [this.drawn, this.seen] = [String(state.here), String(state.angle)];
    const sheet = sharp(this.canvas, this.theme.colours.paper);
    if (!sheet) return;
    this.box = { w: sheet.width - LEFT - RIGHT, h: sheet.height - TOP - BOTTOM };
    if (!this.picture) {
      this.paint(sheet.pen);
      this.picture = document.createElement("canvas");
      Object.assign(this.picture, { width: this.canvas.width, height: this.canvas.height });
      this.picture.getContext("2d").drawImage(this.canvas, 0, 0);
    } else sheet.pen.drawImage(this.picture, 0, 0, sheet.width, sheet.height);
    if (state.here) this.mark(sheet.pen, ...this.place(...state.here));
  }

  // the map without the mark
  paint(pen) {
    const { gaps, inertias, limit } = this.head;
    const { line, paper, warn } = this.theme.colours;
    const { w, h } = this.box;
    const { against, rows } = this;
    const scale = against ? MORE : K;
    const [dx, dy] = [w / (gaps.length - 1), h / (inertias.length - 1)];
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, TOP, w, h);
    pen.clip();
    const shown = rows.map((row, j) => row?.map((k, i) => (k === null || against?.[j][i] === null ? null : k - (against?.[j][i] ?? 0))));
    shown.forEach((row, j) => {
      pen.globalAlpha = rows[j]?.fresh ? 1 : 0.45;
      row?.forEach((value, i) => {
        pen.fillStyle = value === null ? paper : colourOf(scale, scale.share(value));
        pen.fillRect(LEFT + (i - 0.5) * dx - 0.3, TOP + h - (j + 0.5) * dy - 0.3, dx + 0.6, dy + 0.6);
      });
    });
    pen.globalAlpha = 1;
    const lines = (values, level, ...strokes) => {
      pen.beginPath();
      for (const [from, to] of contour(values, level)) {
        pen.moveTo(LEFT + from[0] * dx, TOP + h - from[1] * dy);
        pen.lineTo(LEFT + to[0] * dx, TOP + h - to[1] * dy);
      }
      for (const [strokeStyle, lineWidth] of strokes) {
        Object.assign(pen, { strokeStyle, lineWidth });
        pen.stroke();
      }
    };
    for (const level of scale.marks) lines(shown, level, [scale.dark(level) ? "#ffffffd9" : "#000000a6", 0.8]);
    if (limit && !against) lines(rows.map((row, j) => row?.map((k) => (k === null ? null : k / limit[j]))), 1, ["#ffffff", 4], [warn, 2]);
    pen.restore();
    Object.assign(pen, { strokeStyle: line, lineWidth: 1, font: `11px ${this.theme.font}` });
    pen.strokeRect(LEFT + 0.5, TOP + 0.5, w - 1, h - 1);
    this.scales(pen, scale);
  }

  // a cross where the drive is
  mark(pen, x, y) {
    for (const [strokeStyle, lineWidth] of [["#ffffff", 4.5], ["#000000", 2]]) {
      Object.assign(pen, { strokeStyle, lineWidth });
      pen.beginPath();
      pen.arc(x, y, 5, 0, 7);
      for (const [ux, uy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
        pen.moveTo(x + 5 * ux, y + 5 * uy);
        pen.lineTo(x + 11 * ux, y + 11 * uy);
      }
      pen.stroke();
    }
  }

  scales(pen, scale) {
    const { gaps, inertias, labels } = this.head;
    const [unit, size] = this.state.angle;
    const { quiet, line } = this.theme.colours;
    const { w, h } = this.box;
    const marks = ticks(gaps[0] / size, gaps.at(-1) / size, Math.round(w / 60));
    for (const mark of marks) write(pen, label(mark, marks.digits), this.place(mark * size, inertias[0])[0], TOP + h + 14, quiet, "center");
    write(pen, `${labels[0]}, ${unit}`, LEFT + w / 2, TOP + h + 29, quiet, "center");
    const step = Math.max(1, Math.round(inertias.length / Math.max(2, h / 34)));
    for (let row = 0; row < inertias.length; row += step) write(pen, significant(inertias[row] / this.state.inertia, 3), LEFT - 6, this.place(gaps[0], inertias[row])[1], quiet, "right", "middle");
    pen.save();
    pen.translate(10, TOP + h / 2);
    pen.rotate(-Math.PI / 2);
    write(pen, `${labels[1]}, kg m\u00b2`, 0, 0, quiet, "center", "middle");
    pen.restore();
    const x = LEFT + w + 8;
    for (let i = 0; i < h; i++) {
      pen.fillStyle = colourOf(scale, 1 - i / h);
      pen.fillRect(x, TOP + i, 8, 1.5);
    }
    pen.strokeStyle = line;
    pen.strokeRect(x + 0.5, TOP + 0.5, 7, h - 1);
    for (const mark of scale.marks) write(pen, String(mark).replace("-", "\u2212"), x + 12, TOP + h * (1 - scale.share(mark)), quiet, "left", "middle");
  }
}

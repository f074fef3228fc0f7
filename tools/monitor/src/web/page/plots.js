// Plots on canvas. A value that is null is a gap; unknown values are not drawn.
'use strict';

const COLOURS = {};
function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ['goal', 'setpoint', 'estimate', 'camera', 'hull', 'error', 'band', 'body', 'faint', 'line', 'edge', 'text', 'target', 'bad', 'alarm', 'panel', 'on-fill']) {
    COLOURS[name] = style.getPropertyValue('--' + name).trim();
  }
}
readColours();
addEventListener('theme', readColours);
const TAIL_S = 12;
const FAMILY = 'px system-ui, "DejaVu Sans", sans-serif';

/** The size of small text on this screen. */
const em = () => Math.round(0.8 * parseFloat(getComputedStyle(document.documentElement).fontSize));

// Places in a row of samples and of frames.
const T = 0, GOAL = 1, SETPOINT = 3, ESTIMATE = 5, DEVIATION = 7, COUNTS = 11, FRAME = 1, PICTURE_COUNTS = 3;

/** A canvas with its margins and scales. Sharp on any screen. */
class Plot {
  constructor(id) {
    this.canvas = byId(id);
    this.pen = this.canvas.getContext('2d');
  }

  /** Clears the canvas and fits it to its place. False: not enough room. */
  begin(title) {
    const ratio = window.devicePixelRatio || 1;
    const { width, height } = this.canvas.getBoundingClientRect();
    if (width < 60 || height < 50) return false;
    const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.canvas.width !== wide || this.canvas.height !== high) [this.canvas.width, this.canvas.height] = [wide, high];
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.pen.clearRect(0, 0, width, height);
    const size = em();
    this.pen.font = size + FAMILY;
    Object.assign(this, { width, height, size, left: 3.6 * size, right: width - 8, top: 1.8 * size, bottom: height - 1.6 * size, title });
    return true;
  }

  scales(x, y) {
    this.x = (value) => this.left + (value - x[0]) / (x[1] - x[0]) * (this.right - this.left);
    this.y = (value) => this.bottom - (value - y[0]) / (y[1] - y[0]) * (this.bottom - this.top);
    [this.rangeX, this.rangeY] = [x, y];
  }

  /** Lines at round numbers, with their values. */
  grid(unitX) {
    const pen = this.pen;
    pen.lineWidth = 1;
    pen.strokeStyle = COLOURS.line;
    pen.fillStyle = COLOURS.faint;
    pen.textBaseline = 'middle';
    pen.textAlign = 'right';
    for (const value of ticks(this.rangeY, Math.max(2, (this.bottom - this.top) / (3 * this.size)))) {
      this.stroke([[this.left, this.y(value)], [this.right, this.y(value)]]);
      pen.fillText(number(value), this.left - 5, this.y(value));
    }
    pen.textBaseline = 'top';
    pen.textAlign = 'center';
    for (const value of ticks(this.rangeX, (this.right - this.left) / (6 * this.size))) {
      this.stroke([[this.x(value), this.top], [this.x(value), this.bottom]]);
      const at = this.x(value);
      const text = number(value) + unitX;
      const half = pen.measureText(text).width / 2;
      pen.fillText(text, Math.min(at, this.width - half - 2), this.bottom + 4);
    }
    pen.textAlign = 'left';
    pen.textBaseline = 'alphabetic';
    pen.fillStyle = COLOURS.text;
    pen.fillText(this.title, this.left, this.top - 0.6 * this.size);
    pen.save();
    pen.beginPath();
    pen.rect(this.left, this.top - 1, this.right - this.left, this.bottom - this.top + 2);
    pen.clip();
  }

  end() {
    this.pen.restore();
  }

  stroke(points) {
    this.pen.beginPath();
    points.forEach(([x, y], place) => (place ? this.pen.lineTo(x, y) : this.pen.moveTo(x, y)));
    this.pen.stroke();
  }

  /** A curve through points; null parts it, and so does a jump in time when points carry one. */
  curve(points, colour, width) {
    const pen = this.pen;
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.lineJoin = 'round';
    pen.beginPath();
    let down = false, last = null;
    for (const point of points) {
      if (!point) { down = false; continue; }
      if (down && point.length > 2 && point[2] - last > 0.6) down = false;
      if (down) pen.lineTo(this.x(point[0]), this.y(point[1])); else pen.moveTo(this.x(point[0]), this.y(point[1]));
      [down, last] = [true, point[2]];
    }
    pen.stroke();
  }

  /** The area between two curves, over every stretch without a gap. */
  band(points, colour) {
    const pen = this.pen;
    pen.fillStyle = colour;
    let piece = [];
    const close = () => {
      if (piece.length > 1) {
        pen.beginPath();
        piece.forEach(([x, low]) => pen.lineTo(this.x(x), this.y(low)));
        piece.reverse().forEach(([x, , high]) => pen.lineTo(this.x(x), this.y(high)));
        pen.fill();
      }
      piece = [];
    };
    for (const point of points) if (point) piece.push(point); else close();
    close();
  }

  dot([x, y], colour, radius, hollow) {
    const pen = this.pen;
    pen.beginPath();
    pen.arc(this.x(x), this.y(y), radius, 0, 2 * Math.PI);
    pen.fillStyle = pen.strokeStyle = colour;
    pen.lineWidth = 2;
    if (hollow) pen.stroke(); else pen.fill();
  }

  /** Shows in the plot what is missing. */
  say(text) {
    const pen = this.pen;
    pen.font = '600 ' + (this.size + 2) + FAMILY;
    pen.textAlign = 'center';
    pen.textBaseline = 'middle';
    const wide = pen.measureText(text).width + 20;
    const [x, y] = [(this.left + this.right) / 2, (this.top + this.bottom) / 2];
    pen.fillStyle = COLOURS.bad;
    pen.fillRect(x - wide / 2, y - this.size, wide, 2 * this.size);
    pen.fillStyle = COLOURS['on-fill'];
    pen.fillText(text, x, y + 1);
  }

  /** The same for a condition that is not a failure. */
  note(text) {
    const pen = this.pen;
    pen.font = this.size + FAMILY;
    pen.textAlign = 'center';
    pen.textBaseline = 'middle';
    pen.fillStyle = COLOURS.faint;
    pen.fillText(text, (this.left + this.right) / 2, (this.top + this.bottom) / 2);
  }
}

const number = (value) => String(Math.round(value * 100) / 100).replace('-', '−');

/** About this many round numbers in a range, and at least two: one is not a scale. */
function ticks([low, high], wanted) {
  const raw = (high - low) / Math.max(1, wanted);
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= raw * 0.999);
  const list = [];
  for (let value = Math.ceil(low / step) * step; value <= high + step * 1e-6; value += step) list.push(Math.abs(value) < step * 1e-6 ? 0 : value);
  return list.length < 2 && wanted < 100 ? ticks([low, high], 2 * wanted) : list;
}

/** A little more than lowest to highest, at least `least`. */
function padded(values, least) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (value === null || value === undefined || Number.isNaN(value)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  if (low > high) return [-least / 2, least / 2];
  const [middle, half] = [(low + high) / 2, Math.max((high - low) * 0.56, least / 2)];
  return [middle - half, middle + half];
}

/** The same length for a degree in both directions. */
function equal(x, y, plot) {
  const per = Math.max((x[1] - x[0]) / (plot.right - plot.left), (y[1] - y[0]) / (plot.bottom - plot.top));
  const wide = ([low, high], pixels) => [(low + high) / 2 - per * pixels / 2, (low + high) / 2 + per * pixels / 2];
  return [wide(x, plot.right - plot.left), wide(y, plot.bottom - plot.top)];
}

const point = (x, y, t) => (x === null || y === null || x === undefined || y === undefined ? null : [x, y, t]);

/** The virtual fixtures: filled if active, an outline if off. */
function drawFixtures(plot, fixtures) {
  const pen = plot.pen;
  for (const { name, active, outline } of fixtures) {
    if (!outline) continue;
    const points = outline.map(([pitch, yaw]) => [plot.x(yaw), plot.y(pitch)]);
    pen.beginPath();
    points.forEach(([x, y], place) => (place ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.closePath();
    pen.strokeStyle = pen.fillStyle = COLOURS.alarm;
    pen.lineWidth = 1.5;
    pen.setLineDash(active ? [] : [5, 4]);
    pen.stroke();
    pen.setLineDash([]);
    if (!active) continue;
    pen.globalAlpha = 0.2;
    pen.fill();
    pen.globalAlpha = 1;
    const inside = (value, low, high) => Math.min(Math.max(value, low), high);
    const middle = (place) => points.reduce((sum, at) => sum + at[place], 0) / points.length;
    pen.textAlign = 'center';
    pen.fillText(name, inside(middle(0), plot.left + 3 * plot.size, plot.right - 3 * plot.size),
      inside(middle(1), plot.top + plot.size, plot.bottom - plot.size));
  }
}

/** The target to reach: its tolerance as a circle, and around it a ring that closes while it is held. */
function drawTarget(plot, target) {
  const pen = plot.pen;
  const [x, y] = [plot.x(target.deg[1]), plot.y(target.deg[0])];
  const tolerance = Math.abs(plot.x(target.tolerance_deg) - plot.x(0));
  const radius = Math.max(tolerance + 4, 14);
  const circle = (size, share) => {
    pen.beginPath();
    pen.arc(x, y, size, -Math.PI / 2, -Math.PI / 2 + share * 2 * Math.PI);
    pen.stroke();
  };
  [pen.strokeStyle, pen.lineWidth] = [COLOURS.target, 1.5];
  circle(tolerance, 1);
  pen.globalAlpha = 0.4;
  pen.lineWidth = 4;
  circle(radius, 1);
  pen.globalAlpha = 1;
  circle(radius, Math.min(1, target.held_s / target.hold_s));
  [pen.fillStyle, pen.textAlign, pen.textBaseline] = [COLOURS.target, 'center', 'bottom'];
  if (!target.follow) pen.fillText(`${target.number} of ${target.total}`, x, y - radius - 4);
}

function drawPlane(plot, recent, { hull, fixtures, target }, now, staleText) {
  if (!plot.begin('pitch over yaw, deg')) return;
  const samples = recent.samples.filter((row) => row[T] >= now - TAIL_S);
  const of = (place) => samples.map((row) => point(row[place + 1], row[place], row[T]));
  const camera = recent.frames.filter((row) => row[T] >= now - TAIL_S).map((row) => point(row[FRAME + 1], row[FRAME], row[T]));
  const edge = hull.map(([pitch, yaw]) => [yaw, pitch]);
  const curves = [[edge, COLOURS.hull, 1.5], [camera, COLOURS.camera, 2], [of(GOAL), COLOURS.goal, 1.5], [of(ESTIMATE), COLOURS.estimate, 1.5]];
  // A target is small: the hull does not widen the view then.
  const all = curves.slice(target ? 1 : 0).flatMap(([points]) => points.filter(Boolean));
  if (target) all.push([target.deg[1], target.deg[0]]);
  plot.scales(...equal(padded(all.map((p) => p[0]), 2), padded(all.map((p) => p[1]), 2), plot));
  plot.grid('');
  drawFixtures(plot, fixtures);
  curves.forEach(([points, colour, width]) => plot.curve(points, colour, width));
  const last = (points) => points.length && points[points.length - 1];
  for (const [points, colour, hollow] of [[of(GOAL), COLOURS.goal, true], [of(ESTIMATE), COLOURS.estimate, false]]) {
    if (last(points)) plot.dot(last(points), colour, hollow ? 7 : 5, hollow);
  }
  if (target) drawTarget(plot, target);
  plot.end();
  if (staleText) plot.say(staleText); else if (!all.length) plot.say('no angles yet');
}

function drawLoop(plot, motor, recent, live, now, staleText) {
  if (!plot.begin(`motor ${motor}, ${live.along_names[motor]}, deg`)) return;
  const weights = live.along[motor];
  const bend = (pitch, yaw) => (pitch === null || yaw === null ? null : weights[0] * pitch + weights[1] * yaw);
  const estimate = recent.samples.filter((row) => row[T] >= now - TAIL_S)
    .map((row) => point(row[COUNTS + motor], bend(row[ESTIMATE], row[ESTIMATE + 1]), row[T]));
  const camera = recent.frames.filter((row) => row[T] >= now - TAIL_S)
    .map((row) => point(row[PICTURE_COUNTS + motor], bend(row[FRAME], row[FRAME + 1]), row[T]));
  const all = [...estimate, ...camera].filter(Boolean);
  plot.scales(padded(all.map((p) => p[0]), 100), padded(all.map((p) => p[1]), 2));
  plot.grid('');
  plot.curve(camera, COLOURS.camera, 2);
  plot.curve(estimate, COLOURS.estimate, 1.5);
  const last = estimate[estimate.length - 1];
  if (last) plot.dot(last, COLOURS.estimate, 5, false);
  plot.end();
  if (staleText) plot.say(staleText); else if (!all.length) plot.say('no angles yet');
}

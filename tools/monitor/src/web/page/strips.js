// Curves over time: the angles, and the error between goal and camera.
'use strict';

const STRIP_S = 20;
/** Camera and estimate disagree from this distance on, deg, or from three standard deviations of the estimate. */
const PART_DEG = 1;

/** The value of a column of samples at an instant, between two samples; null in a gap. */
function at(samples, place, instant) {
  let later = samples.findIndex((row) => row[T] >= instant);
  if (later < 0) later = samples.length - 1;
  const [before, after] = [samples[Math.max(0, later - 1)], samples[later]];
  if (!before || !after || Math.abs(after[T] - instant) > 0.3) return null;
  const [from, to] = [before[place], after[place]];
  if (from === null || to === null) return null;
  const span = after[T] - before[T];
  const share = span > 0 ? Math.min(1, Math.max(0, (instant - before[T]) / span)) : 1;
  return from + share * (to - from);
}

/** Distance of a frame from the estimate at its instant on one axis, if that is too far, deg; else 0. */
function parting(frame, samples, axis) {
  const estimate = at(samples, ESTIMATE + axis, frame[T]);
  const deviation = at(samples, DEVIATION + axis, frame[T]);
  if (estimate === null || frame[FRAME + axis] === null) return 0;
  const distance = Math.abs(frame[FRAME + axis] - estimate);
  return distance > Math.max(PART_DEG, 3 * (deviation || 0)) ? distance : 0;
}

/** The same for the last frame and the worse axis, while the camera is fresh. */
function partedNow(recent, live) {
  const frame = recent.frames[recent.frames.length - 1];
  const fresh = live.camera && !live.camera.stale && live.camera.deg && live.estimate && !live.estimate.stale;
  return frame && fresh ? Math.max(...[0, 1].map((axis) => parting(frame, recent.samples, axis))) : 0;
}

/** Goal minus camera at the instant of a frame: pitch and yaw, deg. */
const errorOf = (frame, samples) => [0, 1].map((axis) => {
  const goal = at(samples, GOAL + axis, frame[T]);
  return goal === null || frame[FRAME + axis] === null ? null : goal - frame[FRAME + axis];
});

/** The error of the last frame, while goal and camera are fresh; else null. */
function lastError(recent, live) {
  const frame = recent.frames[recent.frames.length - 1];
  const fresh = live.camera && !live.camera.stale && live.camera.deg && live.goal && !live.goal.stale;
  const error = frame && fresh ? errorOf(frame, recent.samples) : [null, null];
  return error.includes(null) ? null : error;
}

function drawStrip(plot, axis, recent, now, staleText) {
  if (!plot.begin((axis ? 'yaw' : 'pitch') + ', deg')) return;
  const samples = recent.samples.filter((row) => row[T] >= now - STRIP_S);
  const frames = recent.frames.filter((row) => row[T] >= now - STRIP_S);
  const of = (place) => samples.map((row) => point(row[T] - now, row[place + axis], row[T]));
  const camera = frames.map((row) => point(row[T] - now, row[FRAME + axis], row[T]));
  const apart = frames.map((row) => (parting(row, samples, axis) ? point(row[T] - now, row[FRAME + axis], row[T]) : null));
  const curves = [[camera, COLOURS.camera, 2.5], [of(GOAL), COLOURS.goal, 1.5], [of(SETPOINT), COLOURS.setpoint, 1.5],
    [of(ESTIMATE), COLOURS.estimate, 2], [apart, COLOURS.alarm, 5]];
  const all = curves.flatMap(([points]) => points.filter(Boolean).map((p) => p[1]));
  plot.scales([-STRIP_S, 0], padded(all, 2));
  plot.grid(' s');
  plot.band(samples.map((row) => {
    const [value, deviation] = [row[ESTIMATE + axis], row[DEVIATION + axis]];
    return value === null || deviation === null ? null : [row[T] - now, value - deviation, value + deviation];
  }), COLOURS.band);
  curves.forEach(([points, colour, width]) => plot.curve(points, colour, width));
  plot.end();
  if (staleText) plot.say(staleText); else if (!all.length) plot.say('no angles yet');
}

function drawError(plot, recent, now, staleText) {
  if (!plot.begin('error, deg: pitch solid, yaw dashed')) return;
  const samples = recent.samples;
  const frames = recent.frames.filter((row) => row[T] >= now - STRIP_S);
  const errors = frames.map((row) => [row[T], errorOf(row, samples)]);
  const of = (axis) => errors.map(([t, error]) => point(t - now, error[axis], t));
  const all = errors.flatMap(([, error]) => error).filter((value) => value !== null);
  const most = Math.max(0.25, ...all.map(Math.abs)) * 1.1;
  plot.scales([-STRIP_S, 0], [-most, most]);
  plot.grid(' s');
  plot.curve([[-STRIP_S, 0], [0, 0]], COLOURS.edge, 1);
  plot.curve(of(0), COLOURS.error, 2);
  plot.pen.setLineDash([5, 4]);
  plot.curve(of(1), COLOURS.error, 2);
  plot.pen.setLineDash([]);
  plot.end();
  if (staleText) plot.say(staleText); else if (!all.length) plot.note(frames.length ? 'no goal: no error' : 'no camera: no error');
}

// The snake as it is bent: a projection of base, twelve joints and tip, in mm. x: yaw, y: pitch, z: along the snake.
'use strict';

/** Half the diameter of the snake, mm. */
const RADIUS_MM = 0.45;

function drawSnake(side, front, snake, parted, staleText) {
  drawView(side, 'side: pitch up', snake, parted, staleText, ([, y, z]) => [z, y], [-0.35, 2.35], [-1.25, 1.25]);
  drawView(front, 'front: yaw right', snake, parted, staleText, ([x, y]) => [x, y], [-1.5, 1.5], [-1.5, 1.5]);
}

function drawView(plot, title, snake, parted, staleText, project, x, y) {
  if (!plot.begin(title)) return;
  plot.scales(...equal(x, y, plot));
  plot.grid('');
  const shape = (joints) => joints && joints.map(project);
  const [estimate, goal, camera] = [shape(snake.estimate), shape(snake.goal), shape(snake.camera)];
  const isSide = plot.canvas.id === 'side';
  if (isSide) plot.curve([[0, -1], [0, 1]], COLOURS.edge, 2); else ring(plot, [0, 0], COLOURS.edge, false);
  if (estimate) body(plot, estimate, isSide);
  if (goal) ghost(plot, goal, isSide);
  if (camera) mark(plot, camera[camera.length - 1], parted ? COLOURS.alarm : COLOURS.camera);
  plot.end();
  if (staleText) plot.say(staleText); else if (!estimate) plot.note('no angles yet');
}

/** The outline of a bent body: the line of the joints, a radius to both sides. */
function outline(joints) {
  const normals = joints.map((_, place) => {
    const [from, to] = [joints[Math.max(0, place - 1)], joints[Math.min(joints.length - 1, place + 1)]];
    const length = Math.hypot(to[0] - from[0], to[1] - from[1]) || 1;
    return [-(to[1] - from[1]) / length, (to[0] - from[0]) / length];
  });
  const edge = (side) => joints.map(([x, y], place) => [x + side * RADIUS_MM * normals[place][0], y + side * RADIUS_MM * normals[place][1]]);
  return [edge(1), edge(-1)];
}

function path(plot, points) {
  plot.pen.beginPath();
  points.forEach(([x, y], place) => plot.pen[place ? 'lineTo' : 'moveTo'](plot.x(x), plot.y(y)));
}

function body(plot, joints, isSide) {
  const pen = plot.pen;
  if (isSide) {
    const [upper, lower] = outline(joints);
    path(plot, [...upper, ...lower.slice().reverse()]);
    pen.closePath();
    pen.fillStyle = COLOURS.body;
    pen.fill();
    [pen.strokeStyle, pen.lineWidth] = [COLOURS.estimate, 1.5];
    pen.stroke();
    // The gaps between the links.
    upper.forEach((point, place) => { path(plot, [point, lower[place]]); pen.stroke(); });
  } else {
    ring(plot, joints[joints.length - 1], COLOURS.estimate, false, COLOURS.body);
  }
  plot.curve(joints, COLOURS.estimate, 2.5);
  joints.forEach((joint) => plot.dot(joint, COLOURS.estimate, 2.5, false));
}

function ghost(plot, joints, isSide) {
  plot.pen.setLineDash([5, 4]);
  if (isSide) {
    const [upper, lower] = outline(joints);
    plot.curve([...upper, ...lower.slice().reverse()], COLOURS.goal, 2);
  } else {
    ring(plot, joints[joints.length - 1], COLOURS.goal, true);
  }
  plot.pen.setLineDash([]);
}

function ring(plot, [x, y], colour, isDashed, fill) {
  const pen = plot.pen;
  pen.beginPath();
  pen.arc(plot.x(x), plot.y(y), Math.abs(plot.x(RADIUS_MM) - plot.x(0)), 0, 2 * Math.PI);
  if (fill) { pen.fillStyle = fill; pen.fill(); }
  [pen.strokeStyle, pen.lineWidth] = [colour, isDashed ? 2 : 1.5];
  pen.stroke();
}

/** Position of the tip by the camera. */
function mark(plot, [x, y], colour) {
  const [across, down, size] = [plot.x(x), plot.y(y), 9];
  plot.pen.strokeStyle = colour;
  plot.pen.lineWidth = 3;
  plot.stroke([[across - size, down - size], [across + size, down + size]]);
  plot.stroke([[across - size, down + size], [across + size, down - size]]);
}

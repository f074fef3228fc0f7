// The page with everything.
'use strict';

const plots = Object.fromEntries(
  ['pitch', 'yaw', 'error', 'plane', 'loop0', 'loop1', 'side', 'front'].map((id) => [id, new Plot(id)]));

/** Reason why the plots do not move, if they do not. */
function staleText(lag) {
  if (lag > 1500) return 'NO ANSWER FROM THE MONITOR';
  if (live.problem) return 'NO CONTROLLER';
  const stream = live.estimate;
  return stream && stream.stale ? `STALE ${age(stream.age_ms)}` : '';
}

start((lag) => {
  showBanner(live, lag);
  if (!live) return;
  const parted = partedNow(recent, live);
  showHeader(live, lag, parted);
  showWhy(live, lag);
  showJoints(live, lastError(recent, live), parted);
  showMotors(live);
  showLoop(live);
  showModels(live);
  showAdaptation(live);
  showEvents(live, lag);
  const [now, text] = [live.now_s + lag / 1000, staleText(lag)];
  drawStrip(plots.pitch, 0, recent, now, text);
  drawStrip(plots.yaw, 1, recent, now, text);
  drawError(plots.error, recent, now, text);
  drawPlane(plots.plane, recent, live, now, text);
  drawLoop(plots.loop0, 0, recent, live, now, text);
  plots.loop1.canvas.hidden = live.motors && live.motors.length < 2;
  drawLoop(plots.loop1, 1, recent, live, now, text);
  drawSnake(plots.side, plots.front, live.snake, parted, text);
});

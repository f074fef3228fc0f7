// Asks the monitor for what is new, ten times a second at most, and shows it. It sends nothing but this question.
'use strict';

const PERIOD_MS = 100;
const KEEP_S = 30;
const recent = { run: 0, sample: 0, frame: 0, samples: [], frames: [] };
let live = null;
// When the last answer came, on the clock of this browser.
let heard = performance.now();
const plots = Object.fromEntries(['pitch', 'yaw', 'plane', 'loop0', 'loop1'].map((id) => [id, new Plot(id)]));

function take(answer) {
  if (answer.run !== recent.run) Object.assign(recent, { run: answer.run, samples: [], frames: [] });
  recent.samples.push(...answer.samples);
  recent.frames.push(...answer.frames);
  [recent.sample, recent.frame] = [answer.next_sample, answer.next_frame];
  for (const rows of [recent.samples, recent.frames]) {
    const fresh = rows.findIndex((row) => row[0] >= answer.now_s - KEEP_S);
    rows.splice(0, fresh < 0 ? rows.length : fresh);
  }
  live = answer;
  heard = performance.now();
}

async function ask() {
  try {
    const question = `live?run=${recent.run}&sample=${recent.sample}&frame=${recent.frame}`;
    const answer = await fetch(question, { cache: 'no-store', signal: AbortSignal.timeout(3000) });
    if (answer.ok) take(await answer.json());
  } catch {
    // Told on the page by its age; the next question may do better.
  }
  setTimeout(ask, performance.now() - heard > 2000 ? 1000 : PERIOD_MS);
}

/** Why the plots stand still, if they do. */
function staleText(lag) {
  if (lag > 1500) return 'NO ANSWER FROM THE MONITOR';
  if (live.problem) return 'NO CONTROLLER';
  const stream = live.estimate;
  return stream && stream.stale ? `STALE ${age(stream.age_ms)}` : '';
}

function show() {
  const lag = performance.now() - heard;
  showBanner(live, lag);
  if (live) {
    showHeader(live, lag);
    showJoints(live);
    showMotors(live);
    showLoop(live);
    showModels(live);
    showAdaptation(live);
    showEvents(live, lag);
    const [now, text] = [live.now_s + lag / 1000, staleText(lag)];
    drawStrip(plots.pitch, 0, recent, now, text);
    drawStrip(plots.yaw, 1, recent, now, text);
    drawPlane(plots.plane, recent, live.hull, now, text);
    drawLoop(plots.loop0, 0, recent, live, now, text);
    plots.loop1.canvas.hidden = live.motors && live.motors.length < 2;
    drawLoop(plots.loop1, 1, recent, live, now, text);
  }
}

// A page that nobody sees is not drawn: requestAnimationFrame stands still then.
let waits = false;
setInterval(() => {
  if (waits) return;
  waits = true;
  requestAnimationFrame(() => {
    waits = false;
    show();
  });
}, PERIOD_MS);
ask();

// Polls the monitor for new data, at most ten times a second. It sends nothing but these requests.
'use strict';

const PERIOD_MS = 100;
const KEEP_S = 30;
const recent = { run: 0, sample: 0, frame: 0, samples: [], frames: [] };
let live = null;
// Arrival of the last answer, by the clock of this browser.
let answeredAt = performance.now();

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
  answeredAt = performance.now();
}

async function ask() {
  try {
    const question = `live?run=${recent.run}&sample=${recent.sample}&frame=${recent.frame}`;
    const answer = await fetch(question, { cache: 'no-store', signal: AbortSignal.timeout(3000) });
    if (answer.ok) take(await answer.json());
  } catch {
    // The page shows the age of the last answer; the next request may succeed.
  }
  setTimeout(ask, performance.now() - answeredAt > 2000 ? 1000 : PERIOD_MS);
}

/** Calls `show` ten times a second, but not on a hidden page: requestAnimationFrame pauses there. */
function start(show) {
  let waits = false;
  setInterval(() => {
    if (waits) return;
    waits = true;
    requestAnimationFrame(() => {
      waits = false;
      show(performance.now() - answeredAt);
    });
  }, PERIOD_MS);
  ask();
}

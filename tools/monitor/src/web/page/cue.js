// A sound for the operator: the nearer the tip is to a virtual fixture, or to the end of what the model has been calibrated
// for, the faster it beats. Off until somebody asks for it (key s). It sends nothing.
'use strict';

/** From here on it sounds, deg. */
const CUE_DEG = 3;
/** Nearer than this it is one tone, deg. */
const TOUCH_DEG = 0.1;
const CUES = { fixture: { hz: 880, words: 'a fixture' }, hull: { hz: 440, words: 'the end of the hull' } };
const BEEP_S = 0.06;
let audio = null;
let nextBeep = 0;

/** Distance of a point from the edge of a closed outline. */
function toEdge([x, y], outline) {
  const distances = outline.map(([x0, y0], place) => {
    const [x1, y1] = outline[(place + 1) % outline.length];
    const [dx, dy] = [x1 - x0, y1 - y0];
    const along = ((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy || 1);
    const share = Math.min(1, Math.max(0, along));
    return Math.hypot(x0 + share * dx - x, y0 + share * dy - y);
  });
  return Math.min(...distances);
}

/** What is near, and how near, deg; null: nothing, or the angles are not known. */
function cueOf({ estimate, fixtures, hull, state }) {
  if (!estimate || estimate.stale || !estimate.deg) return null;
  const cues = fixtures.filter(({ active, outline }) => active && outline)
    .map(({ outline }) => ({ kind: 'fixture', deg: toEdge(estimate.deg, outline) }));
  if (hull.length > 2) cues.push({ kind: 'hull', deg: toEdge(estimate.deg, hull) });
  // Backlash and load keep the tip away from a limit that holds the goal.
  if (state && state.clipped) cues.push({ kind: 'hull', deg: 0 });
  if (state && state.at_fixture) cues.push({ kind: 'fixture', deg: 0 });
  const nearest = cues.reduce((best, cue) => (best && best.deg <= cue.deg ? best : cue), null);
  return nearest && nearest.deg <= CUE_DEG ? nearest : null;
}

function beep(hz, span) {
  const [tone, volume, now] = [audio.createOscillator(), audio.createGain(), audio.currentTime];
  tone.frequency.value = hz;
  // Without a rise and a fall it would click.
  volume.gain.setValueAtTime(0, now);
  volume.gain.linearRampToValueAtTime(0.2, now + 0.005);
  volume.gain.setValueAtTime(0.2, now + span - 0.01);
  volume.gain.linearRampToValueAtTime(0, now + span);
  tone.connect(volume).connect(audio.destination);
  tone.start(now);
  tone.stop(now + span);
}

/** Sounds if it is time to, and says in words what it stands for; `old`: what is shown is not of now. */
function soundCue(live, old) {
  const cue = audio && !old ? cueOf(live) : null;
  byId('cue').textContent = cue ? `${cue.deg.toFixed(1)}° to ${CUES[cue.kind].words}` : '';
  const now = performance.now() / 1000;
  if (!cue || now < nextBeep) return;
  const touches = cue.deg < TOUCH_DEG;
  // From once a second down to ten times; touching has no gaps.
  nextBeep = now + (touches ? 0.1 : 0.1 + 0.9 * (cue.deg / CUE_DEG));
  beep(CUES[cue.kind].hz, touches ? 0.15 : BEEP_S);
}

function toggleSound() {
  // A browser lets a page sound only after a person has asked for it.
  if (audio) audio.close();
  audio = audio ? null : new AudioContext();
  byId('sound').textContent = audio ? 'sound is on (s)' : 'sound of limits (s)';
  byId('sound').setAttribute('aria-pressed', String(audio !== null));
}

addEventListener('keydown', (event) => {
  if (event.key === 's' && !event.ctrlKey && !event.altKey && !event.metaKey) toggleSound();
});
byId('sound').addEventListener('click', toggleSound);

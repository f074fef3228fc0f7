// A sound for the operator: the closer the tip is to a virtual fixture, or to the end of the calibrated range, the faster
// it beats. Off until the operator switches it on (key s). It sends nothing.
'use strict';

const CUES = { fixture: { hz: 880, words: 'a fixture' }, hull: { hz: 440, words: 'the end of the hull' } };
const BEEP_S = 0.06;
let audio = null;
let nextBeep = 0;

function beep(hz, span) {
  const [tone, volume, now] = [audio.createOscillator(), audio.createGain(), audio.currentTime];
  tone.frequency.value = hz;
  // Without ramps it would click.
  volume.gain.setValueAtTime(0, now);
  volume.gain.linearRampToValueAtTime(0.2, now + 0.005);
  volume.gain.setValueAtTime(0.2, now + span - 0.01);
  volume.gain.linearRampToValueAtTime(0, now + span);
  tone.connect(volume).connect(audio.destination);
  tone.start(now);
  tone.stop(now + span);
}

/** Beeps when due, and shows the meaning in words; `old`: the data shown are stale. */
function soundCue(live, old) {
  const cue = audio && !old ? live.cue : null;
  byId('cue').textContent = cue ? `${cue.deg.toFixed(1)}° to ${CUES[cue.kind].words}` : '';
  const now = performance.now() / 1000;
  if (!cue || now < nextBeep) return;
  nextBeep = now + cue.beat_s;
  // A continuous tone on contact.
  beep(CUES[cue.kind].hz, cue.touches ? 1.5 * cue.beat_s : BEEP_S);
}

function toggleSound() {
  // A browser allows sound only after a user action.
  if (audio) audio.close();
  audio = audio ? null : new AudioContext();
  byId('sound').textContent = audio ? 'sound is on (s)' : 'sound at limits (s)';
  byId('sound').setAttribute('aria-pressed', String(audio !== null));
}

addEventListener('keydown', (event) => {
  if (event.key === 's' && !event.ctrlKey && !event.altKey && !event.metaKey) toggleSound();
});
byId('sound').addEventListener('click', toggleSound);

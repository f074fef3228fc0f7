// The operator's second screen: state, reason, angles and error, to be read from two metres.
'use strict';

const plane = new Plot('plane');

/** The target of a task, in words and in the plane of pitch and yaw. */
function showTarget(lag, old) {
  const target = live.target;
  byId('task').hidden = !target;
  if (!target) return;
  const seen = live[target.by];
  const away = (axis) => (old || !seen || !seen.deg ? '–' : signed(target.deg[axis] - seen.deg[axis]) + '°');
  const what = target.follow ? 'follow the target' : `target ${target.number} of ${target.total}`;
  byId('target').textContent = `${what}: pitch ${away(0)}, yaw ${away(1)} to go; ` +
    `${target.follow ? '' : 'held '}${target.held_s.toFixed(1)} of ${target.hold_s.toFixed(1)} s`;
  drawPlane(plane, recent, live, live.now_s + lag / 1000, old ? 'STALE' : '');
}

/** The error is a warning above this, deg, and an alarm above twice this; to change it: /operator?limit=0.3. */
const LIMIT_DEG = Number(new URLSearchParams(location.search).get('limit')) || 0.5;

/** Flags that the operator needs in addition to the state; normal conditions are not shown. */
function showFlags() {
  const { state, camera, hand } = live;
  const flags = [];
  if (hand) {
    const arrow = (deg) => '→↗↑↖←↙↓↘'[((Math.round(deg / 45) % 8) + 8) % 8];
    const [pitch, yaw] = hand.directions_deg.map(arrow);
    flags.push(hand.open ? [`CLUTCH OPEN: ${hand.open}`, 'warn'] : [`FOLLOWS AT ${(100 * hand.scale).toFixed(0)} %`, 'on']);
    flags.push([`in the picture: +pitch ${pitch}, +yaw ${yaw}`, 'on']);
  }
  flags.push(...trialFlags(live.trial));
  if (!camera) flags.push(['no camera', 'on']);
  else if (camera.stale) flags.push([`CAMERA SILENT ${age(camera.age_ms)}`, 'warn']);
  else if (!camera.deg) flags.push(['CAMERA SEES NOTHING', 'warn']);
  if (state) {
    if (!state.watched) flags.push(['NO WATCHDOG', 'warn']);
    if (!state.model) flags.push(['NO MODEL', 'warn']);
    else if (!state.memory_known) flags.push(['MEMORY UNKNOWN', 'warn']);
    if (state.at_fixture) flags.push(['AT VIRTUAL FIXTURE', 'warn']);
    if (state.clipped) flags.push(['GOAL CLIPPED', 'warn']);
    if ((state.commander || '').startsWith('i2ris calibrate')) flags.push(['CALIBRATING', 'on']);
    else if (state.busy) flags.push(['BUSY', 'on']);
  }
  fillList(byId('flags'), flags);
}

start((lag) => {
  showBanner(live, lag);
  if (!live) return;
  showBadge(live, lag);
  showWhy(live, lag);
  showFlags();
  const old = lag > 1500 || !live.estimate || live.estimate.stale || !live.estimate.deg;
  // For reading from a distance: one digit less, and twice the size.
  const angle = (axis) => (old ? '–' : signed(live.estimate.deg[axis], 1));
  [byId('pitch').textContent, byId('yaw').textContent] = [angle(0), angle(1)];
  const error = lastError(recent, live);
  const parted = partedNow(recent, live);
  const length = error && !old ? Math.hypot(...error) : null;
  byId('error').textContent = length === null ? '–' : length.toFixed(2) + '°';
  const level = length === null ? '' : length > 2 * LIMIT_DEG ? ' far' : length > LIMIT_DEG ? ' off' : ' near';
  byId('error-tile').className = 'angle' + (parted ? ' parted' : level);
  byId('error-tile').firstElementChild.textContent = parted ? 'error; camera and estimate disagree' :
    `error, goal − camera (limit ${LIMIT_DEG}°)`;
  showTarget(lag, old);
  soundCue(live, old);
  byId('lease').textContent = commander(live.state);
});

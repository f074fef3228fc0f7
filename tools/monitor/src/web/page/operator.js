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
  byId('target').textContent = `target ${target.number} of ${target.total}: pitch ${away(0)}, yaw ${away(1)} to go; ` +
    `held ${target.held_s.toFixed(1)} of ${target.hold_s.toFixed(1)} s`;
  drawPlane(plane, recent, live, live.now_s + lag / 1000, old ? 'STALE' : '');
}

start((lag) => {
  showBanner(live, lag);
  if (!live) return;
  showBadge(live, lag);
  showWhy(live, lag);
  const old = lag > 1500 || !live.estimate || live.estimate.stale || !live.estimate.deg;
  const angle = (axis) => (old ? '–' : signed(live.estimate.deg[axis]) + '°');
  [byId('pitch').textContent, byId('yaw').textContent] = [angle(0), angle(1)];
  const error = lastError(recent, live);
  const parted = partedNow(recent, live);
  byId('error').textContent = error && !old ? Math.hypot(...error).toFixed(2) + '°' : '–';
  byId('error-tile').className = 'angle' + (parted ? ' parted' : '');
  byId('error-tile').firstElementChild.textContent = parted ? 'error; camera and estimate part' : 'error, goal − camera';
  showTarget(lag, old);
  byId('lease').textContent = commander(live.state);
});

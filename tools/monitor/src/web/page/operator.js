// The operator's second screen: state, reason, angles and error, to be read from two metres.
'use strict';

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
  byId('lease').textContent = commander(live.state);
});

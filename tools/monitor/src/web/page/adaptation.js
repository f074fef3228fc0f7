// The adaptation: a separate panel, shown only while the adaptation is on.
'use strict';

const DRIFT = [
  ['zero pitch', 57.29578, 'deg'], ['zero yaw', 57.29578, 'deg'],
  ['gain pitch', 100, '%'], ['gain pitch by yaw', 100, '%'],
  ['gain yaw by pitch', 100, '%'], ['gain yaw', 100, '%'],
  ['gap motor 0', 100, '%'], ['gap motor 1', 100, '%'],
  ['latency of the camera', 1000, 'ms'], ['slow state', 57.29578, 'deg'],
  ['slack motor 0', 100, '%'], ['slack motor 1', 100, '%'],
  ['play motor 0', 100, '%'], ['play motor 1', 100, '%'],
];

function adaptationPanel() {
  const found = byId('adaptation');
  if (found) return found;
  const panel = element('section');
  panel.id = 'adaptation';
  panel.append(element('h2', 'Adaptation'), element('p'), element('table'));
  document.querySelector('main').append(panel);
  return panel;
}

function showAdaptation(live) {
  const found = live.adaptation;
  if (!found || !found.on) {
    const panel = byId('adaptation');
    if (panel) panel.remove();
    return;
  }
  const panel = adaptationPanel();
  const reasons = found.pauses.length ? `NOTHING IS LEARNED: ${found.pauses.join(', ')}` : 'learning';
  panel.querySelector('p').textContent =
    `${reasons}. Camera ${found.calibrated_error_deg.toFixed(2)} deg from the calibrated model, ` +
    `${found.adapted_error_deg.toFixed(2)} deg from the adapted one. Frames: ${found.frames.used} used, ` +
    `${found.frames.refused} refused, ${found.frames.dropped} dropped.`;
  const mark = (used) => (used >= 0.7 ? 'warn' : '');
  const percent = (share) => `${Math.round(100 * share)} %`;
  const rows = DRIFT.map(([name, scale, unit], index) => [
    [name], [signed(scale * found.estimate[index])], [signed(scale * found.applied[index])], [unit],
    [percent(found.budget_used[index]), mark(found.budget_used[index])],
    [found.excited[index] ? '' : 'not shown by the motion'],
  ]);
  const total = [['all together'], [''], [''], [''], [percent(found.total_used), mark(found.total_used)], ['']];
  fill(panel.querySelector('table'), [head('', 'estimate', 'applied', '', 'budget', ''), ...rows, total]);
}

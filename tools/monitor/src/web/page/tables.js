// Words and numbers of the page. Text is inserted as text, never as markup.
'use strict';

const byId = (id) => document.getElementById(id);

function element(kind, text, style) {
  const made = document.createElement(kind);
  if (text !== undefined) made.textContent = text;
  if (style) made.className = style;
  return made;
}

/** Inserts new text only where it differs, which saves the browser a new layout. */
function fill(place, rows) {
  const key = JSON.stringify(rows);
  if (place.dataset.key === key) return;
  place.dataset.key = key;
  place.replaceChildren(...rows.map((row) => {
    const line = element('tr');
    line.append(...row.map(([text, style, kind]) => element(kind || 'td', text, style)));
    return line;
  }));
}

/** A value that rounds to zero has no sign: an error within the noise of the camera would flicker. */
const signed = (value, digits = 2) => {
  if (value === null || value === undefined) return '–';
  const size = Math.abs(value).toFixed(digits);
  return (Number(size) === 0 ? '' : value < 0 ? '−' : '+') + size;
};
const age = (ms) => (ms < 10000 ? (ms / 1000).toFixed(1) + ' s' : Math.round(ms / 1000) + ' s');
const head = (...texts) => texts.map((text) => [text, '', 'th']);

function showBadge(live, lag) {
  const state = live.state;
  const badge = byId('badge');
  const old = state && (state.stale || live.problem || lag > 1000);
  const name = !state ? (live.problem ? 'NO CONTROLLER' : 'NO STATE YET') : old ? 'STALE, was ' + state.name : state.name;
  badge.textContent = name;
  badge.className = 'badge ' + (!state ? 'none' : old ? 'stale' : state.name.toLowerCase());
  document.title = `${name} · i2ris`;
}

/** The commander, by name if it is known. */
function commander(state) {
  if (!state) return '';
  return state.lease ? `commander: ${state.commander || 'client ' + state.lease}` : 'no commander';
}

function showHeader(live, lag, parted) {
  showBadge(live, lag);
  const state = live.state;
  const flags = [];
  if (state) {
    flags.push([`for ${state.for_s} s`, 'on']);
    flags.push(...trialFlags(live.trial));
    flags.push(state.homed ? ['homed', 'on'] : ['NOT HOMED', 'warn']);
    if (state.busy) flags.push(['busy', 'on']);
    if (state.holding) flags.push(['holding', 'on']);
    if (state.clipped) flags.push(['GOAL CLIPPED', 'warn']);
    if (state.at_fixture) flags.push(['AT VIRTUAL FIXTURE', 'warn']);
    if (parted) flags.push([`CAMERA AND ESTIMATE PART BY ${parted.toFixed(1)} deg`, 'parted']);
    flags.push(state.memory_known ? ['memory known', 'on'] : ['memory unknown', state.model ? 'warn' : '']);
    if (!state.model) flags.push(['no model: angles not limited', 'warn']);
    flags.push(state.watched ? ['watchdog', 'on'] : ['NO WATCHDOG', 'warn']);
    if (state.compared) flags.push(['compared with camera', 'on']);
  }
  fillList(byId('flags'), flags);
  byId('lease').textContent = !state ? '' : `${commander(state)} · accepted ${state.accepted} · refused ${state.refused}` +
    (state.stale_stops ? ` · stale stops ${state.stale_stops}` : '');
  byId('place').textContent = `domain ${live.domain} · monitor ${live.version} · read-only`;
}

/** The trial being recorded, with its newest mark. */
function trialFlags(trial) {
  if (!trial) return [];
  if (trial.problem) return [[`TRIAL ${trial.name} NOT RECORDED: ${trial.problem}`, 'warn']];
  const mark = trial.mark && [`mark ${trial.mark[0]}: ${trial.mark[1]}, ${trial.mark_age_s} s ago`, 'on'];
  return [[`trial ${trial.name}, ${trial.for_s} s`, 'on'], ...(mark ? [mark] : [])];
}

/** Why the robot does not move as commanded, and what to do: the fault, or a fresh refusal, or the present reason. */
function showWhy(live, lag) {
  const place = byId('why');
  const known = lag <= 1500 && !live.problem && live.state && !live.state.stale;
  const [fault, news] = [(it) => it.code.startsWith('fault'), (it) => it.age_s !== null && it.age_s < 5];
  const reason = known && (live.why.find(fault) || live.why.find(news) || live.why[0]);
  const style = !reason ? '' : fault(reason) ? 'alarm' : news(reason) ? 'warning' : '';
  const key = JSON.stringify([reason && reason.text, style, known]);
  if (place.dataset.key === key) return;
  place.dataset.key = key;
  place.className = style;
  if (!reason) return place.replaceChildren(known ? 'nothing keeps the robot from moving' : '');
  place.replaceChildren(reason.text, element('span', '; action: ' + reason.advice));
}

function fillList(place, items) {
  const key = JSON.stringify(items);
  if (place.dataset.key === key) return;
  place.dataset.key = key;
  place.replaceChildren(...items.map(([text, style]) => element('li', text, style)));
}

function showBanner(live, lag) {
  const banner = byId('banner');
  let text = '';
  if (lag > 1500) text = `THE MONITOR DOES NOT ANSWER: everything below is ${age(lag)} old`;
  else if (live && live.problem) text = live.problem;
  else if (live && live.state && live.state.stale) text = `STALE: the controller has not sent its state for ${age(live.state.age_ms)}`;
  banner.textContent = text;
  banner.hidden = !text;
  document.body.classList.toggle('dead', lag > 1500);
}

/** `error`: goal minus camera; `parted`: camera and estimate are too far apart. */
function showJoints(live, error, parted) {
  const streams = [['goal', 'goal'], ['setpoint', 'setpoint'], ['estimate', 'estimate'], ['camera', 'camera']];
  const cells = (axis) => streams.flatMap(([key]) => {
    const stream = live[key];
    const style = (key === 'camera' && parted ? 'parted' : key) + (stream && stream.stale ? ' stale' : '');
    const value = [signed(stream && stream.deg && stream.deg[axis]), style];
    if (key !== 'estimate') return [value];
    const deviation = stream && stream.deviation_deg;
    return [value, [deviation ? '±' + deviation[axis].toFixed(2) : '–', style]];
  });
  const rows = [head('', 'goal', 'setpt.', 'estimate', 'sd', 'camera', 'error'),
    ...['pitch', 'yaw'].map((name, axis) => [[name, ''], ...cells(axis), [signed(error && error[axis]), 'error']])];
  const marks = [];
  for (const [key, name] of streams) {
    const stream = live[key];
    if (!stream) { if (key !== 'camera') marks.push(`${name} not received yet`); continue; }
    if (stream.stale) marks.push(`${name} STALE ${age(stream.age_ms)}`);
    else if (key === 'camera' && !stream.deg) marks.push('camera sees nothing');
  }
  if (live.estimate && live.estimate.is_position) marks.push('the model gives a position, not angles');
  fill(byId('joints'), rows);
  showMarks('joints', marks);
}

/** Stale or missing data, below a table. */
function showMarks(id, texts) {
  const place = byId(id);
  let line = place.nextElementSibling;
  if (!line || !line.classList.contains('marks')) {
    line = element('div', undefined, 'marks');
    place.after(line);
  }
  const key = texts.join('|');
  if (line.dataset.key === key) return;
  line.dataset.key = key;
  line.replaceChildren(...texts.flatMap((text) => [element('span', text, 'mark'), document.createTextNode(' ')]));
}

function showMotors(live) {
  const motors = live.motors || [];
  const row = (motor, number) => {
    const style = motor.stale ? 'stale' : '';
    const drive = motor.phase + (motor.error ? ', error ' + motor.error : '');
    return [[String(number), ''], [String(motor.setpoint_counts), style], [String(motor.measured_counts), style],
      [String(motor.current_ma), style], [motor.exchanges_per_s === null ? '–' : String(motor.exchanges_per_s), style],
      [drive, motor.bad || motor.error ? 'warn' : style], [motor.status, 'stale']];
  };
  const jaw = live.jaw && [['aux.', ''], ['', ''], [signed(live.jaw.deg && live.jaw.deg[0]) + '°', live.jaw.stale ? 'stale' : '']];
  fill(byId('motors'), [head('', 'setpt.', 'encoder', 'mA', 'bus/s', 'drive', 'status'), ...motors.map(row), ...(jaw ? [jaw] : [])]);
  const marks = motors.length ? [] : ['motors not received yet'];
  motors.forEach((motor, number) => {
    if (motor.age_ms === null) marks.push(`motor ${number} NEVER READ`);
    else if (motor.stale) marks.push(`motor ${number} STALE ${age(motor.age_ms)}`);
  });
  showMarks('motors', marks);
}

function showLoop(live) {
  const loop = live.loop;
  if (!loop) {
    fill(byId('loop'), []);
    return showMarks('loop', ['loop not received yet']);
  }
  const style = loop.stale ? 'stale' : '';
  const spans = (name, span) => [[name, ''], [String(span.p50_us), style], [String(span.p99_us), style], [String(span.max_us), style]];
  fill(byId('loop'), [head(`${loop.hz} Hz`, 'p50 us', 'p99 us', 'max us'), spans('late', loop.late), spans('compute', loop.compute)]);
  const marks = loop.stale ? [`loop STALE ${age(loop.age_ms)}`] : [];
  showMarks('loop', marks);
  let line = byId('granted');
  if (!line) {
    line = element('div');
    line.id = 'granted';
    byId('loop').nextElementSibling.after(line);
  }
  line.textContent = `missed ${loop.missed} of ${loop.missed + loop.ticks} ticks · ${loop.granted} · line ${loop.line}`;
  line.className = loop.real_time && !loop.missed_in_window ? '' : 'warn';
}

function showModels(live) {
  const models = live.models;
  const row = (name, model) => [[name, ''], [model ? model.name + (model.memory_known ? '' : ', memory unknown') : models.known ? 'none' : '–', 'text']];
  fill(byId('models'), [row('in use', models.used), row('staged', models.staged), row('previous', models.previous)]);
  showMarks('models', [models.problem, models.hull_problem].filter(Boolean));
}

/** Faults are in a separate list, so that nothing displaces them; when the robot has left FAULT, they move to the others. */
const FAULT_NEWS_MS = 60000;
function showEvents(live, lag) {
  const time = (event) => new Date(Date.now() - event.age_ms - lag).toLocaleTimeString([], { hour12: false });
  const row = (event) => [time(event), event.text + (event.count > 1 ? ` (${event.count} times)` : ''), event.severity,
    event.severity === 'info' ? '' : event.advice];
  const inFault = live.state && live.state.name === 'FAULT';
  const isAlarm = (event) => event.severity === 'alarm' && (inFault || event.age_ms + lag < FAULT_NEWS_MS);
  fillEvents(byId('alarms'), live.events.filter(isAlarm).slice(0, 8).map(row));
  fillEvents(byId('events'), live.events.filter((event) => !isAlarm(event)).slice(0, 30).map(row));
}

function fillEvents(place, rows) {
  const key = JSON.stringify(rows);
  if (place.dataset.key === key) return;
  place.dataset.key = key;
  place.replaceChildren(...rows.map(([when, text, severity, advice]) => {
    const line = element('li', undefined, severity);
    line.append(element('time', when), text);
    if (advice) line.append(element('small', 'action: ' + advice));
    return line;
  }));
}

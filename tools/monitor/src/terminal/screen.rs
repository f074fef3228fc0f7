//! How the screen is divided: everything at once where there is room, one view after the other
//! where there is not.

use i2ris::ipc::payload::{OperatingStateMsg, ReasonMsg};
use i2ris::ipc::{Message, OperatingState, Refusal};
use i2ris::robot::{Cause, Reason};
use i2ris::units::Nanos;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::key_handler::{KEYS, KeyHandler, Panel};
use super::style::{alarm, faint, flow, of_severity, warning};
use super::{charts, numbers};
use crate::dashboard::Dashboard;
use crate::latest_messages::{STALE, state_name};

/// From here on everything fits on one screen.
const WIDE: u16 = 110;
const TALL: u16 = 30;

/// Draws everything.
pub fn draw(
    frame: &mut Frame,
    dashboard: &Dashboard,
    key_handler: &KeyHandler,
    title: &str,
    now: Nanos,
) {
    let area = frame.area();
    let width = usize::from(area.width);
    let (head, foot) = (header(dashboard, title, width, now), footer(key_handler, width, now));
    let [top, middle, bottom] = Layout::vertical([
        Constraint::Length(lines_of(&head)),
        Constraint::Min(0),
        Constraint::Length(lines_of(&foot)),
    ])
    .areas(area);
    frame.render_widget(Paragraph::new(head), top);
    if area.width >= WIDE && middle.height >= TALL {
        everything(frame, middle, dashboard, key_handler, now);
    } else {
        one_view(frame, middle, dashboard, key_handler, now);
    }
    frame.render_widget(Paragraph::new(foot), bottom);
}

fn lines_of(lines: &[Line]) -> u16 {
    u16::try_from(lines.len()).unwrap_or(u16::MAX)
}

/// State, what it means, who commands, and what is wrong.
fn header(dashboard: &Dashboard, title: &str, width: usize, now: Nanos) -> Vec<Line<'static>> {
    let problem = dashboard.problem.iter().map(|problem| Span::styled(problem.clone(), alarm()));
    let mut lines = flow(problem, width);
    match &dashboard.view.state {
        None => lines.extend(flow([Span::styled(" STATE NOT RECEIVED YET ", alarm())], width)),
        Some(state) => {
            lines.extend(flow(state_items(dashboard, state, now), width));
            lines.extend(flow(command_items(dashboard, state), width));
        }
    }
    if width >= usize::from(WIDE) {
        lines.push(Line::from(Span::styled(title.to_owned(), faint())));
    }
    lines
}

fn state_items(dashboard: &Dashboard, state: &OperatingStateMsg, now: Nanos) -> Vec<Span<'static>> {
    let has = |flag: u32| state.flags & flag != 0;
    let name = state_name(state);
    let stale = state.age(now) > STALE;
    let badge = if stale {
        format!(" STALE {:.1} s, was {name} ", state.age(now).as_seconds())
    } else {
        format!(" {name} ")
    };
    let mut items = vec![Span::styled(badge, badge_style(state, stale))];
    items.extend(reason_items(dashboard, now));
    items.push(Span::raw(format!(
        "for {:.0} s",
        state.stamp().since(Nanos(state.since_ns)).as_seconds()
    )));
    let model = dashboard.models.used().map(|used| format!("model {}", used.name));
    for (flag, on, off) in [
        (OperatingStateMsg::HOMED, Some("homed"), Some("NOT HOMED")),
        (OperatingStateMsg::BUSY, Some("busy"), None),
        (OperatingStateMsg::HOLDING, Some("holding"), None),
        (OperatingStateMsg::CLIPPED, Some("CLIPPED TO HULL"), None),
        (OperatingStateMsg::FIXTURE, Some("AT VIRTUAL FIXTURE"), None),
        (OperatingStateMsg::MEMORY_KNOWN, Some("memory known"), Some("memory unknown")),
        (OperatingStateMsg::MODEL, model.as_deref().or(Some("model loaded")), Some("no model")),
        (OperatingStateMsg::WATCHED, Some("watchdog"), Some("NO WATCHDOG")),
        (OperatingStateMsg::COMPARED, Some("compared with camera"), None),
    ] {
        let text = if has(flag) { on } else { off };
        let warnings = ["NOT HOMED", "NO WATCHDOG", "CLIPPED TO HULL", "AT VIRTUAL FIXTURE"];
        let style = if text.is_some_and(|text| warnings.contains(&text)) {
            warning()
        } else {
            Style::new()
        };
        items.extend(text.map(|text| Span::styled(text.to_owned(), style)));
    }
    items
}

/// Why the robot does not move: the fault, and a fresh refusal, stop or clip; with what to do.
fn reason_items(dashboard: &Dashboard, now: Nanos) -> Vec<Span<'static>> {
    let view = &dashboard.view;
    let Some(fault) = view.fault() else {
        let warning_of = |reason: ReasonMsg| {
            let text = format!("{}; do: {}", reason.text(), reason.advice());
            Span::styled(text, warning())
        };
        return view.recent_warning(now).map(warning_of).into_iter().collect();
    };
    let text = view.present_error().map_or_else(
        || Reason::from(Cause::Fault(fault)).to_string(),
        |error| format!("{}; do: {}", error.text(), error.advice()),
    );
    vec![Span::styled(text, alarm())]
}

fn badge_style(state: &OperatingStateMsg, stale: bool) -> Style {
    let colour = match OperatingState::from_number(state.state) {
        _ if stale => Color::Red,
        Some(OperatingState::Enabled) => Color::Green,
        Some(OperatingState::Paused) => Color::Yellow,
        Some(OperatingState::Disabled) => Color::Gray,
        Some(OperatingState::Fault) | None => Color::Red,
    };
    Style::new()
        .fg(if colour == Color::Red { Color::White } else { Color::Black })
        .bg(colour)
        .add_modifier(Modifier::BOLD)
}

fn command_items(dashboard: &Dashboard, state: &OperatingStateMsg) -> Vec<Span<'static>> {
    let lease = match (state.lease_client_id, &dashboard.commander) {
        (0, _) => "no commander".to_owned(),
        (_, Some(name)) => format!("commander {name}"),
        (client, None) => format!("commander {client:016x}"),
    };
    let refused = format!("refused {}", state.refused);
    let mut items = vec![
        Span::raw(lease),
        Span::raw(format!("accepted {}", state.accepted)),
        Span::styled(refused, if state.refused > 0 { warning() } else { Style::new() }),
    ];
    let reason = Refusal::from_number(state.last_refusal).filter(|reason| *reason != Refusal::None);
    items.extend(reason.map(|reason| Span::raw(format!("last: {reason}"))));
    if state.stale_stops > 0 {
        items.push(Span::styled(format!("stale stops {}", state.stale_stops), warning()));
    }
    items
}

/// What was asked and answered, and every key.
fn footer(key_handler: &KeyHandler, width: usize, now: Nanos) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    if let Some(question) = key_handler.question(now) {
        lines.extend(flow([Span::styled(question.text.clone(), warning())], width));
        lines.extend(flow([key("y", "yes"), key("n", "no")].concat(), width));
    }
    if let Some(answer) = key_handler.answer(now) {
        let style = if answer.good { Style::new().fg(Color::Green) } else { alarm() };
        lines.extend(flow([Span::styled(answer.text.clone(), style)], width));
    }
    lines.extend(keys(width));
    lines
}

fn key(name: &str, meaning: &str) -> Vec<Span<'static>> {
    vec![Span::styled(format!("{name} {meaning}"), Style::new().add_modifier(Modifier::REVERSED))]
}

fn keys(width: usize) -> Vec<Line<'static>> {
    let mut lines: Vec<Line<'static>> = Vec::new();
    for (name, meaning) in KEYS {
        let item = [
            Span::styled(name, Style::new().add_modifier(Modifier::REVERSED)),
            Span::raw(format!(" {meaning}")),
        ];
        let long: usize = item.iter().map(Span::width).sum();
        match lines.last_mut() {
            Some(line) if line.width() + 2 + long <= width => {
                line.push_span(Span::raw("  "));
                line.extend(item);
            }
            _ => lines.push(Line::from(item.to_vec())),
        }
    }
    lines
}

/// Numbers and events on the left, plots on the right.
fn everything(
    frame: &mut Frame,
    area: Rect,
    dashboard: &Dashboard,
    key_handler: &KeyHandler,
    now: Nanos,
) {
    let [left, right] =
        Layout::horizontal([Constraint::Length(numbers::WIDTH as u16 + 3), Constraint::Min(0)])
            .areas(area);
    let text = numbers::lines(dashboard, numbers::WIDTH, now);
    let [top, bottom] =
        Layout::vertical([Constraint::Length(lines_of(&text) + 1), Constraint::Min(0)]).areas(left);
    frame.render_widget(Paragraph::new(text), top);
    scrolled(
        frame,
        Rect { width: numbers::WIDTH as u16, ..bottom },
        events(dashboard, numbers::WIDTH, now),
        key_handler.scroll,
    );
    let [strips, plots] =
        Layout::vertical([Constraint::Percentage(54), Constraint::Min(0)]).areas(right);
    draw_strips(frame, strips, dashboard, now);
    let [plane, loops] =
        Layout::horizontal([Constraint::Percentage(50), Constraint::Min(0)]).areas(plots);
    charts::plane(frame, plane, dashboard, now);
    draw_loops(frame, loops, dashboard, now);
}

/// One view, with its name beside those of the others.
fn one_view(
    frame: &mut Frame,
    area: Rect,
    dashboard: &Dashboard,
    key_handler: &KeyHandler,
    now: Nanos,
) {
    let width = usize::from(area.width);
    let tabs = flow(Panel::ALL.map(|panel| tab(panel, key_handler.panel)), width);
    let [top, rest] =
        Layout::vertical([Constraint::Length(lines_of(&tabs)), Constraint::Min(0)]).areas(area);
    frame.render_widget(Paragraph::new(tabs), top);
    match key_handler.panel {
        Panel::Numbers => {
            scrolled(frame, rest, numbers::lines(dashboard, width.min(60), now), key_handler.scroll)
        }
        Panel::Strips => draw_strips(frame, rest, dashboard, now),
        Panel::Plane => {
            with_legend(frame, rest, |frame, area| charts::plane(frame, area, dashboard, now))
        }
        Panel::Loops => {
            with_legend(frame, rest, |frame, area| draw_loops(frame, area, dashboard, now))
        }
        Panel::Events => scrolled(frame, rest, events(dashboard, width, now), key_handler.scroll),
    }
}

fn tab(panel: Panel, chosen: Panel) -> Span<'static> {
    let style =
        if panel == chosen { Style::new().add_modifier(Modifier::REVERSED) } else { faint() };
    Span::styled(panel.name(), style)
}

fn draw_strips(frame: &mut Frame, area: Rect, dashboard: &Dashboard, now: Nanos) {
    with_legend(frame, area, |frame, area| {
        let [pitch, yaw] =
            Layout::vertical([Constraint::Percentage(50), Constraint::Min(0)]).areas(area);
        charts::strip(frame, pitch, dashboard, 0, now);
        charts::strip(frame, yaw, dashboard, 1, now);
    });
}

/// Beside each other, or below each other where that is narrow.
fn draw_loops(frame: &mut Frame, area: Rect, dashboard: &Dashboard, now: Nanos) {
    let motors = charts::motors(dashboard);
    let parts = vec![Constraint::Ratio(1, motors as u32); motors];
    let layout = if area.width >= 56 { Layout::horizontal(parts) } else { Layout::vertical(parts) };
    for (motor, part) in layout.split(area).iter().enumerate() {
        charts::hysteresis(frame, *part, dashboard, motor, now);
    }
}

fn with_legend(frame: &mut Frame, area: Rect, plot: impl FnOnce(&mut Frame, Rect)) {
    let legend = flow(charts::legend(), usize::from(area.width));
    let [top, rest] =
        Layout::vertical([Constraint::Length(lines_of(&legend)), Constraint::Min(0)]).areas(area);
    frame.render_widget(Paragraph::new(legend), top);
    plot(frame, rest);
}

fn events(dashboard: &Dashboard, width: usize, now: Nanos) -> Vec<Line<'static>> {
    let mut lines = vec![Line::from(Span::styled("events seen since this started", faint()))];
    for event in dashboard.event_log.newest() {
        let count =
            if event.count > 1 { format!(" ({} times)", event.count) } else { String::new() };
        let age = format!("{:>4.0} s ago", now.since(event.stamp).as_seconds());
        lines.extend(flow(
            [
                Span::styled(age, faint()),
                Span::styled(format!("{}{count}", event.text), of_severity(event.severity)),
            ],
            width,
        ));
    }
    lines
}

/// As much as fits; what does not is counted.
fn scrolled(frame: &mut Frame, area: Rect, lines: Vec<Line<'static>>, scroll: usize) {
    let height = usize::from(area.height);
    if lines.len() <= height {
        return frame.render_widget(Paragraph::new(lines), area);
    }
    let room = height.saturating_sub(1);
    let first = scroll.min(lines.len() - room.min(lines.len()));
    let more = Line::from(Span::styled(
        format!("↑↓ lines {} to {} of {}", first + 1, first + room, lines.len()),
        warning(),
    ));
    let shown: Vec<Line> =
        lines.into_iter().skip(first).take(room).chain(std::iter::once(more)).collect();
    frame.render_widget(Paragraph::new(shown), area);
}

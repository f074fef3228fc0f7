//! How the screen is divided: everything at once where there is room, one view after the other
//! where there is not.

use i2ris::ipc::OperatingState;
use i2ris::units::Nanos;
use i2ris_report::view::{State, View};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::charts::{self, Plots};
use super::key_handler::{KEYS, KeyHandler, Panel};
use super::numbers;
use super::style::{alarm, faint, flow, of_severity, warning};
use crate::dashboard::Dashboard;

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
    let view = dashboard.view(now);
    let (head, foot) = (header(&view, title, width), footer(key_handler, width, now));
    let [top, middle, bottom] = Layout::vertical([
        Constraint::Length(lines_of(&head)),
        Constraint::Min(0),
        Constraint::Length(lines_of(&foot)),
    ])
    .areas(area);
    frame.render_widget(Paragraph::new(head), top);
    let content = Content { view: &view, plots: Plots::new(dashboard, &view, now), key_handler };
    if area.width >= WIDE && middle.height >= TALL {
        content.everything(frame, middle);
    } else {
        content.one_panel(frame, middle);
    }
    frame.render_widget(Paragraph::new(foot), bottom);
}

fn lines_of(lines: &[Line]) -> u16 {
    u16::try_from(lines.len()).unwrap_or(u16::MAX)
}

/// State, what it means, who commands, and what is wrong.
fn header(view: &View, title: &str, width: usize) -> Vec<Line<'static>> {
    let problem = view.problem.iter().map(|problem| Span::styled(problem.clone(), alarm()));
    let mut lines = flow(problem, width);
    match &view.state {
        None => lines.extend(flow([Span::styled(" STATE NOT RECEIVED YET ", alarm())], width)),
        Some(state) => {
            lines.extend(flow(state_items(view, state), width));
            lines.extend(flow(command_items(state), width));
            let trial = view.trial.iter().map(|trial| {
                let style = if trial.problem.is_some() { alarm() } else { Style::new() };
                Span::styled(trial.line(), style)
            });
            lines.extend(flow(trial, width));
        }
    }
    if width >= usize::from(WIDE) {
        lines.push(Line::from(Span::styled(title.to_owned(), faint())));
    }
    lines
}

fn state_items(view: &View, state: &State) -> Vec<Span<'static>> {
    let badge = match state.age.mark() {
        Some(mark) => format!(" {mark}, was {} ", state.name),
        None => format!(" {} ", state.name),
    };
    let mut items = vec![Span::styled(badge, badge_style(state))];
    items.push(Span::raw(format!("for {:.0} s", state.for_s)));
    let model = view.models.used.as_ref().map(|used| format!("model {}", used.name));
    let model = model.as_deref().unwrap_or("model loaded");
    for (is_set, on, off) in [
        (state.homed, "homed", "NOT HOMED"),
        (state.busy, "busy", ""),
        (state.holding, "holding", ""),
        (state.clipped, "CLIPPED TO HULL", ""),
        (state.at_fixture, "AT VIRTUAL FIXTURE", ""),
        (state.memory_known, "memory known", "memory unknown"),
        (state.model, model, "no model: angles not limited"),
        (state.watched, "watchdog", "NO WATCHDOG"),
        (state.compared, "compared with camera", ""),
    ] {
        let text = if is_set { on } else { off };
        let warnings = ["NOT HOMED", "NO WATCHDOG", "CLIPPED TO HULL", "AT VIRTUAL FIXTURE"];
        let style = if warnings.contains(&text) { warning() } else { Style::new() };
        items.extend((!text.is_empty()).then(|| Span::styled(text.to_owned(), style)));
    }
    items.extend(reason(view));
    items
}

/// Why the robot does not move: the fault, or a fresh refusal, stop or clip; with what to do.
fn reason(view: &View) -> Option<Span<'static>> {
    let is_fault = view.state.as_ref().is_some_and(|state| state.fault.is_some());
    let (why, style) = match is_fault {
        true => (view.why.first(), alarm()),
        false => (view.why.iter().find(|why| why.age_s.is_some()), warning()),
    };
    why.map(|why| Span::styled(format!("{}; do: {}", why.text, why.advice), style))
}

fn badge_style(state: &State) -> Style {
    let known = [
        (OperatingState::Enabled, Color::Green),
        (OperatingState::Paused, Color::Yellow),
        (OperatingState::Disabled, Color::Gray),
    ];
    let known = known.iter().find(|(it, _)| it.text() == state.name && !state.age.stale);
    let (front, back) = known.map_or((Color::White, Color::Red), |(_, back)| (Color::Black, *back));
    Style::new().fg(front).bg(back).add_modifier(Modifier::BOLD)
}

fn command_items(state: &State) -> Vec<Span<'static>> {
    let lease = match (&state.lease, &state.commander) {
        (None, _) => "no commander".to_owned(),
        (_, Some(name)) | (Some(name), None) => format!("commander {name}"),
    };
    let refused = format!("refused {}", state.refused);
    let mut items = vec![
        Span::raw(lease),
        Span::raw(format!("accepted {}", state.accepted)),
        Span::styled(refused, if state.refused > 0 { warning() } else { Style::new() }),
    ];
    items.extend(state.last_refusal.map(|reason| Span::raw(format!("last: {reason}"))));
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

/// What is between header and footer.
struct Content<'a> {
    view: &'a View,
    plots: Plots<'a>,
    key_handler: &'a KeyHandler,
}

impl Content<'_> {
    /// Numbers and events on the left, plots on the right.
    fn everything(&self, frame: &mut Frame, area: Rect) {
        let width = numbers::WIDTH as u16;
        let [left, right] =
            Layout::horizontal([Constraint::Length(width + 3), Constraint::Min(0)]).areas(area);
        let text = numbers::lines(self.view, numbers::WIDTH);
        let [top, bottom] =
            Layout::vertical([Constraint::Length(lines_of(&text) + 1), Constraint::Min(0)])
                .areas(left);
        frame.render_widget(Paragraph::new(text), top);
        self.scrolled(frame, Rect { width, ..bottom }, events(self.view, numbers::WIDTH));
        let [strips, plots] =
            Layout::vertical([Constraint::Percentage(54), Constraint::Min(0)]).areas(right);
        self.strips(frame, strips);
        let [plane, loops] =
            Layout::horizontal([Constraint::Percentage(50), Constraint::Min(0)]).areas(plots);
        self.plots.plane(frame, plane);
        self.loops(frame, loops);
    }

    /// One panel, with its name beside those of the others.
    fn one_panel(&self, frame: &mut Frame, area: Rect) {
        let width = usize::from(area.width);
        let tab = |panel: Panel| {
            let is_chosen = panel == self.key_handler.panel;
            let chosen = Style::new().add_modifier(Modifier::REVERSED);
            Span::styled(panel.name(), if is_chosen { chosen } else { faint() })
        };
        let tabs = flow(Panel::ALL.map(tab), width);
        let [top, rest] =
            Layout::vertical([Constraint::Length(lines_of(&tabs)), Constraint::Min(0)]).areas(area);
        frame.render_widget(Paragraph::new(tabs), top);
        match self.key_handler.panel {
            Panel::Numbers => self.scrolled(frame, rest, numbers::lines(self.view, width.min(60))),
            Panel::Strips => self.strips(frame, rest),
            Panel::Plane => {
                let rest = legend(frame, rest);
                self.plots.plane(frame, rest);
            }
            Panel::Loops => {
                let rest = legend(frame, rest);
                self.loops(frame, rest);
            }
            Panel::Events => self.scrolled(frame, rest, events(self.view, width)),
        }
    }

    fn strips(&self, frame: &mut Frame, area: Rect) {
        let area = legend(frame, area);
        let [pitch, yaw] =
            Layout::vertical([Constraint::Percentage(50), Constraint::Min(0)]).areas(area);
        self.plots.strip(frame, pitch, 0);
        self.plots.strip(frame, yaw, 1);
    }

    /// Beside each other, or below each other where that is narrow.
    fn loops(&self, frame: &mut Frame, area: Rect) {
        let motors = self.plots.motors;
        let parts = vec![Constraint::Ratio(1, motors as u32); motors];
        let layout =
            if area.width >= 56 { Layout::horizontal(parts) } else { Layout::vertical(parts) };
        for (motor, part) in layout.split(area).iter().enumerate() {
            self.plots.hysteresis(frame, *part, motor);
        }
    }

    /// As much as fits; what does not is counted.
    fn scrolled(&self, frame: &mut Frame, area: Rect, lines: Vec<Line<'static>>) {
        let height = usize::from(area.height);
        if lines.len() <= height {
            return frame.render_widget(Paragraph::new(lines), area);
        }
        let room = height.saturating_sub(1);
        let first = self.key_handler.scroll.min(lines.len() - room.min(lines.len()));
        let more = Line::from(Span::styled(
            format!("↑↓ lines {} to {} of {}", first + 1, first + room, lines.len()),
            warning(),
        ));
        let shown: Vec<Line> =
            lines.into_iter().skip(first).take(room).chain(std::iter::once(more)).collect();
        frame.render_widget(Paragraph::new(shown), area);
    }
}

/// Draws what the colours mean; what is left below it.
fn legend(frame: &mut Frame, area: Rect) -> Rect {
    let legend = flow(charts::legend(), usize::from(area.width));
    let [top, rest] =
        Layout::vertical([Constraint::Length(lines_of(&legend)), Constraint::Min(0)]).areas(area);
    frame.render_widget(Paragraph::new(legend), top);
    rest
}

fn events(view: &View, width: usize) -> Vec<Line<'static>> {
    let mut lines = vec![Line::from(Span::styled("events seen since this started", faint()))];
    for event in &view.events {
        let count =
            if event.count > 1 { format!(" ({} times)", event.count) } else { String::new() };
        let age = format!("{:>4.0} s ago", event.age_ms as f64 / 1000.0);
        let text = format!("{}{count}", event.text);
        let style = of_severity(event.severity);
        lines.extend(flow([Span::styled(age, faint()), Span::styled(text, style)], width));
    }
    lines
}

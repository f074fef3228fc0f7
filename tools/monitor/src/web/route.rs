//! Responses to requests. No request can change anything.

use std::net::IpAddr;

use super::http::{Request, Response};

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// Data that a browser already has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Since {
    /// Start of the monitor that the numbers belong to.
    pub run: u64,
    /// Numbers of the next sample and of the next frame.
    pub sample: u64,
    pub frame: u64,
}

impl Since {
    /// Parses a query, `run=1&sample=2&frame=3`. A missing or invalid number is 0: then everything
    /// is new.
    pub fn parse(query: &str) -> Self {
        let value = |name: &str| {
            let mut pairs = query.split('&').filter_map(|pair| pair.split_once('='));
            pairs
                .find(|(key, _)| *key == name)
                .and_then(|(_, value)| value.parse().ok())
                .unwrap_or(0)
        };
        Self { run: value("run"), sample: value("sample"), frame: value("frame") }
    }
}

/// Files that can be requested, in addition to the live data.
fn file(path: &str) -> Option<(&'static str, &'static str)> {
    Some(match path {
        "/" => (HTML, include_str!("page/page.html")),
        "/page.css" => (CSS, include_str!("page/page.css")),
        "/operator" => (HTML, include_str!("page/operator.html")),
        "/colours.css" => (CSS, include_str!("page/colours.css")),
        "/operator.css" => (CSS, include_str!("page/operator.css")),
        "/theme.js" => (SCRIPT, include_str!("page/theme.js")),
        "/live.js" => (SCRIPT, include_str!("page/live.js")),
        "/strips.js" => (SCRIPT, include_str!("page/strips.js")),
        "/snake.js" => (SCRIPT, include_str!("page/snake.js")),
        "/cue.js" => (SCRIPT, include_str!("page/cue.js")),
        "/operator.js" => (SCRIPT, include_str!("page/operator.js")),
        "/page.js" => (SCRIPT, include_str!("page/page.js")),
        "/plots.js" => (SCRIPT, include_str!("page/plots.js")),
        "/tables.js" => (SCRIPT, include_str!("page/tables.js")),
        "/adaptation.js" => (SCRIPT, include_str!("page/adaptation.js")),
        "/icon.svg" => ("image/svg+xml", include_str!("page/icon.svg")),
        _ => return None,
    })
}

/// Answers a request. `live` returns new data. `local`: the server listens on this machine only.
pub fn answer(request: &Request, local: bool, live: impl FnOnce(&Since) -> String) -> Response {
    if request.method != "GET" {
        return Response::refusal(
            405,
            "this monitor is read-only: it answers GET and nothing else",
        );
    }
    if request.has_body {
        return Response::refusal(400, "a GET has no body");
    }
    // A foreign page whose name resolves to this machine must not read the data.
    if local && !request.host.as_deref().is_some_and(is_local) {
        return Response::refusal(403, "open this page by its address, 127.0.0.1 or localhost");
    }
    let (path, query) = request.target.split_once('?').unwrap_or((request.target.as_str(), ""));
    match (path, file(path)) {
        ("/live", _) => Response::good("application/json", live(&Since::parse(query))),
        (_, Some((kind, text))) => Response::good(kind, text),
        _ => Response::refusal(404, "not found; the monitor is at /"),
    }
}

/// Whether a `Host` field names this machine.
fn is_local(host: &str) -> bool {
    let name = match host.rsplit_once(':') {
        Some((name, port)) if port.chars().all(|c| c.is_ascii_digit()) => name,
        _ => host,
    };
    let bare = name.trim_start_matches('[').trim_end_matches(']');
    name.eq_ignore_ascii_case("localhost")
        || bare.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_are_parsed_and_invalid_ones_are_zero() {
        assert_eq!(Since::parse("run=5&sample=7&frame=2"), Since { run: 5, sample: 7, frame: 2 });
        assert_eq!(Since::parse("sample=-1&run=x&&="), Since::default());
    }
}

//! Subset of HTTP/1.1 (RFC 9112) for a read-only page, and the responses to requests, of which none
//! can change anything. Bytes in, values out; heads are parsed by `httparse`.

use std::net::IpAddr;

/// Maximum length of a head, bytes. Browsers send a few hundred.
pub const MAX_HEAD_BYTES: usize = 8192;
const FIELDS: usize = 64;

/// A request, as far as it matters here.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    pub method: String,
    pub target: String,
    pub host: Option<String>,
    pub keep_alive: bool,
    /// A body follows, or is announced.
    pub has_body: bool,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Head {
    Partial,
    /// A request, and its length in bytes.
    Whole(Request, usize),
    Bad,
}

pub fn parse(bytes: &[u8]) -> Head {
    let mut fields = [httparse::EMPTY_HEADER; FIELDS];
    let mut head = httparse::Request::new(&mut fields);
    let length = match head.parse(bytes) {
        Ok(httparse::Status::Complete(length)) => length,
        Ok(httparse::Status::Partial) => return Head::Partial,
        Err(_) => return Head::Bad,
    };
    let (Some(method), Some(target), Some(version)) = (head.method, head.path, head.version) else {
        return Head::Bad;
    };
    let mut request = Request {
        method: method.to_owned(),
        target: target.to_owned(),
        host: None,
        keep_alive: version == 1,
        has_body: false,
    };
    for field in head.headers.iter() {
        let Ok(value) = std::str::from_utf8(field.value).map(str::trim) else { continue };
        match field.name.to_ascii_lowercase().as_str() {
            // Two of them are an attack.
            "host" if request.host.is_some() => return Head::Bad,
            "host" => request.host = Some(value.to_owned()),
            "connection" if value.eq_ignore_ascii_case("close") => request.keep_alive = false,
            "content-length" => request.has_body |= value != "0",
            "transfer-encoding" => request.has_body = true,
            _ => {}
        }
    }
    Head::Whole(request, length)
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Response {
    pub status: u16,
    pub kind: &'static str,
    pub body: Vec<u8>,
}

impl Response {
    pub fn good(kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self { status: 200, kind, body: body.into() }
    }

    pub fn refusal(status: u16, text: &str) -> Self {
        Self { status, kind: "text/plain; charset=utf-8", body: format!("{text}\n").into_bytes() }
    }

    /// The page may load nothing from other hosts, may not be framed, and is not cached.
    pub fn bytes(&self, keep_alive: bool) -> Vec<u8> {
        let reason = match self.status {
            200 => "OK",
            400 => "Bad Request",
            403 => "Forbidden",
            404 => "Not Found",
            405 => "Method Not Allowed",
            431 => "Request Header Fields Too Large",
            _ => "Service Unavailable",
        };
        let allow = if self.status == 405 { "Allow: GET\r\n" } else { "" };
        let head = format!(
            "HTTP/1.1 {} {reason}\r\nContent-Type: {}\r\nContent-Length: {}\r\n{allow}Connection: \
             {}\r\n\
             Cache-Control: no-store\r\nContent-Security-Policy: default-src 'none'; script-src \
             'self'; style-src 'self'; \
             img-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; \
             frame-ancestors 'none'\r\n\
             X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\r\n",
            self.status,
            self.kind,
            self.body.len(),
            if keep_alive { "keep-alive" } else { "close" },
        );
        [head.as_bytes(), &self.body].concat()
    }
}

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Since {
    /// Start of the monitor that the numbers belong to.
    pub run: u64,
    /// Numbers of the next sample and of the next frame.
    pub sample: u64,
    pub frame: u64,
}

impl Since {
    /// Parses a query, `run=1&sample=2&frame=3`. An invalid number is 0: all is new.
    pub fn parse(query: &str) -> Self {
        let value = |name: &str| {
            let mut pairs = query.split('&').filter_map(|pair| pair.split_once('='));
            let value = pairs.find(|(key, _)| *key == name);
            value.and_then(|(_, value)| value.parse().ok()).unwrap_or(0)
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
        let text = "this monitor is read-only: it answers GET and nothing else";
        return Response::refusal(405, text);
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
    use proptest::prelude::*;

    use super::*;

    fn whole(text: &str) -> Request {
        match parse(text.as_bytes()) {
            Head::Whole(request, length) => {
                assert_eq!(length, text.len());
                request
            }
            other => panic!("{text}: {other:?}"),
        }
    }

    #[test]
    fn a_head_is_read_whole_or_waited_for() {
        let text = "GET /live?after=3 HTTP/1.1\r\nHost: localhost:8766\r\nAccept: */*\r\n\r\n";
        let request = whole(text);
        assert_eq!((request.method.as_str(), request.target.as_str()), ("GET", "/live?after=3"));
        let rest = (request.host.as_deref(), request.keep_alive, request.has_body);
        assert_eq!(rest, (Some("localhost:8766"), true, false));
        assert!((0..text.len()).all(|end| parse(&text.as_bytes()[..end]) == Head::Partial));
        assert!(!whole("GET / HTTP/1.0\r\n\r\n").keep_alive);
        assert!(!whole("GET / HTTP/1.1\r\nConnection: Close\r\n\r\n").keep_alive);
        assert!(whole("POST / HTTP/1.1\r\nContent-Length: 5\r\n\r\n").has_body);
        assert!(whole("GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n").has_body);
    }

    #[test]
    fn anything_but_http_is_rejected() {
        for text in [
            "hello\r\n\r\n",
            "GET / HTTP/9\r\n\r\n",
            "GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n",
            "\0\0",
        ] {
            assert_eq!(parse(text.as_bytes()), Head::Bad, "{text}");
        }
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            parse(&bytes);
        }
    }

    #[test]
    fn queries_are_parsed_and_invalid_ones_are_zero() {
        assert_eq!(Since::parse("run=5&sample=7&frame=2"), Since { run: 5, sample: 7, frame: 2 });
        assert_eq!(Since::parse("sample=-1&run=x&&="), Since::default());
    }
}

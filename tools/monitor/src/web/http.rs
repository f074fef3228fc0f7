//! Subset of HTTP/1.1 (RFC 9112) for a read-only page. Bytes in, values out; heads are parsed by
//! `httparse`.

/// Maximum length of a head, bytes. Browsers send a few hundred.
pub const MAX_HEAD_BYTES: usize = 8192;
/// Maximum number of header fields.
const FIELDS: usize = 64;

/// A request, as far as it matters here.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    pub method: String,
    /// Path and query.
    pub target: String,
    pub host: Option<String>,
    /// The connection stays open afterwards.
    pub keep_alive: bool,
    /// A body follows, or is announced.
    pub has_body: bool,
}

/// Result of parsing the bytes so far.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Head {
    /// More has to come.
    Partial,
    /// A request, and its length in bytes.
    Whole(Request, usize),
    /// Not HTTP.
    Bad,
}

/// Reads the head of a request.
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
        let Ok(value) = std::str::from_utf8(field.value).map(str::trim) else {
            continue;
        };
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

/// Response to a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Response {
    pub status: u16,
    pub kind: &'static str,
    pub body: Vec<u8>,
}

impl Response {
    /// A successful response.
    pub fn good(kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self { status: 200, kind, body: body.into() }
    }

    /// A refusal with a sentence.
    pub fn refusal(status: u16, text: &str) -> Self {
        Self { status, kind: "text/plain; charset=utf-8", body: format!("{text}\n").into_bytes() }
    }

    /// Bytes to send. The page may load nothing from other hosts, may not be framed, and is not
    /// cached.
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
        assert_eq!(
            (request.host.as_deref(), request.keep_alive, request.has_body),
            (Some("localhost:8766"), true, false)
        );
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
}

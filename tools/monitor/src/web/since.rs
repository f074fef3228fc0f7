//! The part of the history that a browser has already.

/// What a browser has already.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Since {
    /// Of which start of the monitor.
    pub run: u64,
    /// The number of the next sample, and of the next frame.
    pub sample: u64,
    pub frame: u64,
}

impl Since {
    /// From a query, `run=1&sample=2&frame=3`. What is missing or no number is 0: then everything
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_are_read_and_nonsense_is_nothing() {
        assert_eq!(Since::parse("run=5&sample=7&frame=2"), Since { run: 5, sample: 7, frame: 2 });
        assert_eq!(Since::parse("sample=-1&run=x&&="), Since::default());
    }
}

//! Pairs of frames from two views.

use std::collections::VecDeque;

use i2ris::units::Nanos;

/// Pairs the frames of two views by their stamps, each view in the order of its stamps.
#[derive(Debug)]
pub struct FramePairer<T> {
    within: Nanos,
    waiting: [VecDeque<(Nanos, T)>; 2],
    ended: [bool; 2],
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PairResult<T> {
    /// One of each view, and the instant half-way between their stamps.
    Matched(Nanos, [T; 2]),
    /// One without a partner: its view, its stamp.
    Unmatched(usize, Nanos, T),
}

impl<T> FramePairer<T> {
    /// Pairs frames that are at most `within` apart.
    pub fn new(within: Nanos) -> Self {
        Self { within, waiting: [VecDeque::new(), VecDeque::new()], ended: [false; 2] }
    }

    pub fn push(&mut self, view: usize, stamp: Nanos, item: T) {
        self.waiting[view & 1].push_back((stamp, item));
    }

    pub fn end(&mut self, view: usize) {
        self.ended[view & 1] = true;
    }

    /// The view that has to deliver before the next result; `None`: both have ended.
    pub fn wanted(&self) -> Option<usize> {
        (0..2).filter(|view| !self.ended[*view]).min_by_key(|view| self.waiting[*view].len())
    }

    pub fn pop(&mut self) -> Option<PairResult<T>> {
        match [0, 1].map(|view| self.waiting[view].front().map(|(stamp, _)| *stamp)) {
            [Some(a), Some(b)] if a.0.abs_diff(b.0) <= self.within.0 => {
                let (_, first) = self.waiting[0].pop_front()?;
                let (_, second) = self.waiting[1].pop_front()?;
                Some(PairResult::Matched(Nanos(a.0.midpoint(b.0)), [first, second]))
            }
            [Some(a), Some(b)] => self.alone(usize::from(b < a)),
            [Some(_), None] if self.ended[1] => self.alone(0),
            [None, Some(_)] if self.ended[0] => self.alone(1),
            _ => None,
        }
    }

    /// Gives up waiting for a partner: the oldest one of a view that has any.
    pub fn give_up(&mut self) -> Option<PairResult<T>> {
        self.alone(0).or_else(|| self.alone(1))
    }

    fn alone(&mut self, view: usize) -> Option<PairResult<T>> {
        self.waiting[view].pop_front().map(|(stamp, item)| PairResult::Unmatched(view, stamp, item))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(first: &[u64], second: &[u64]) -> Vec<PairResult<u64>> {
        let mut pairer = FramePairer::new(Nanos(10));
        let mut sources = [first.iter(), second.iter()];
        let mut out = Vec::new();
        while let Some(view) = pairer.wanted() {
            match sources[view].next() {
                Some(stamp) => pairer.push(view, Nanos(*stamp), *stamp),
                None => pairer.end(view),
            }
            while let Some(pair) = pairer.pop() {
                out.push(pair);
            }
        }
        out
    }

    #[test]
    fn near_stamps_pair_and_the_pair_lies_half_way() {
        let both = |stamp, a, b| PairResult::Matched(Nanos(stamp), [a, b]);
        assert_eq!(run(&[100, 133], &[104, 131]), [both(102, 100, 104), both(132, 133, 131)]);
    }

    #[test]
    fn frames_after_the_end_of_the_other_view_are_unpaired() {
        assert_eq!(run(&[100, 133], &[]).len(), 2);
        assert!(run(&[], &[5]).iter().all(|t| *t == PairResult::Unmatched(1, Nanos(5), 5)));
    }

    #[test]
    fn views_that_never_meet_do_not_pair() {
        let found = run(&[100, 200, 300], &[150, 250, 350]);
        assert!(found.iter().all(|t| matches!(t, PairResult::Unmatched(..))) && found.len() == 6);
    }
}

//! Set-points that take effect by an edge: written, taken, and the bit lowered again before the
//! next.

use super::ask::Ask;
use crate::drive::AxisRequest;
use crate::drive::cia402::Controlword;

/// Where the present set-point stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Steer {
    /// The next one may be written.
    #[default]
    Ready,
    /// It is written; the edge is due.
    Written(AxisRequest),
    /// The edge was sent, maybe in vain; the bit must be lowered before the next.
    Raised,
}

impl Steer {
    /// What must come before the next set-point.
    pub(super) fn ask(self) -> Option<Ask> {
        match self {
            Self::Ready => None,
            Self::Written(request) => Some(Ask::Take(request)),
            Self::Raised => Some(Ask::Control(Controlword::ENABLE_OPERATION)),
        }
    }

    pub(super) fn written(&mut self, request: AxisRequest) {
        *self = Self::Written(request);
    }

    pub(super) fn taken(&mut self) {
        *self = Self::Raised;
    }

    pub(super) fn lowered(&mut self) {
        *self = Self::Ready;
    }

    /// An exchange failed. Whether the edge arrived is not known, so the bit is lowered; a newer
    /// set-point follows.
    pub(super) fn unanswered(&mut self) {
        if matches!(self, Self::Written(_)) {
            *self = Self::Raised;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bit_is_lowered_before_the_next_set_point_whatever_happens() {
        let request = AxisRequest {
            sequence: 3,
            ..AxisRequest::default()
        };
        let mut steer = Steer::default();
        assert_eq!(steer.ask(), None);
        steer.written(request);
        assert_eq!(steer.ask(), Some(Ask::Take(request)));
        steer.taken();
        assert_eq!(
            steer.ask(),
            Some(Ask::Control(Controlword::ENABLE_OPERATION))
        );
        steer.unanswered();
        assert_eq!(
            steer.ask(),
            Some(Ask::Control(Controlword::ENABLE_OPERATION)),
            "until it is acknowledged"
        );
        steer.lowered();
        assert_eq!(steer.ask(), None);
        steer.written(request);
        steer.unanswered();
        assert_eq!(
            steer.ask(),
            Some(Ask::Control(Controlword::ENABLE_OPERATION))
        );
    }
}
